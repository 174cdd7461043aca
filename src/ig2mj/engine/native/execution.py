"""`HostExecution`: how functions run next to the native engine, whose worlds change in place on the host.

Functions that step worlds run as they are, in Python. Pure functions of arrays in them are compiled, each by itself.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.base import Physics, Write
from ig2mj.engine.packing import LARGEST, PackedFunction
from ig2mj.engine.view import SCHEMA, Array, PhysicsView, assemble, read_fields, with_eyes_later
from ig2mj.process.gc_pause import GC_PAUSED


class HostExecution:
    """Part of `NativeEngine`: see `ig2mj.engine.base.Engine`, "How functions run"."""

    def compile(self, function: Callable[..., Any], shortcut: Callable[..., Any] | None = None) -> Callable[..., Any]:
        """See `Engine.compile`. Results are read-only NumPy arrays."""
        return HostFunction(function, shortcut)

    def program(
        self, function: Callable[..., Any], check: Callable[[Any], None] | None = None, **options: Any
    ) -> Callable[..., Any]:
        """See `Engine.program`: the function itself. The engine checks physics in every call."""
        return function

    def when_any(self, mask: Bool[Array, "W"], act: Callable[..., Any], *operands: Any, cheap: bool = False) -> Any:
        """See `Engine.when_any`."""
        if np.asarray(mask).any():
            return act(*operands)
        one, *more = operands
        return operands if more else one

    def repeat(self, body: Callable[[Any], tuple[Any, Any]], carry: Any, length: int) -> tuple[Any, Any]:
        """See `Engine.repeat`."""
        last = None
        for _ in range(length):
            carry, last = body(carry)
        return carry, last

    def constants(self, tree: Any) -> Any:
        """See `Engine.constants`: NumPy arrays."""
        return jax.tree.map(np.asarray, tree)

    def kept(self, tree: Any) -> Any:
        """See `Engine.kept`: the same, since no step changes an array that it returned."""
        return tree

    def kept_row(self, tree: Any, world: int) -> tuple[Any, int]:
        """See `Engine.kept_row`: all worlds, of which nothing is copied."""
        return tree, world

    def copied(self, tree: Any) -> Any:
        """See `Engine.copied`. Views are shared, since they are never changed."""
        return jax.tree.map(_copy_of, tree, is_leaf=_is_view)

    def with_eyes(self, view: PhysicsView, poses: Callable[[], tuple[Array, Array]]) -> PhysicsView:
        """See `Engine.with_eyes`: the poses are computed when one of them is read."""
        return with_eyes_later(view, poses)

    def write_with_view(
        self,
        physics: Physics,
        write: Write,
        before: PhysicsView,
        worlds: Bool[Array, "W"] | None = None,
    ) -> tuple[Physics, PhysicsView]:
        """See `Engine.write_with_view`. Worlds that nothing is written to keep their arrays."""
        engine: Any = self
        physics = engine.write(physics, write)
        return physics, engine.view(physics)


class _Program(NamedTuple):
    """A compiled function, which of the flattened arguments it takes, and what it gives.

    Attributes:
      takes: numbers of leaves, each with what reads the array from it: a field of a view, or None for the leaf itself.
      reads: those fields.
    """

    takes: list[tuple[int, Callable[[Any], Array] | None]]
    reads: frozenset[str]
    function: PackedFunction
    structure: Any


class HostFunction:
    """A pure function of pytrees, compiled to take only the arrays on which its results depend.

    Views may stand anywhere in the arguments. Fields that nothing depends on are never read, so that those that the
    native engine makes on first read are not made.
    """

    def __init__(self, function: Callable[..., Any], shortcut: Callable[..., Any] | None = None):
        """Traces nothing yet. Arguments as of `Engine.compile`."""
        self._function, self._shortcut = function, shortcut
        self._name = getattr(function, "__name__", "function").strip("_")
        self._programs: dict[Any, _Program] = {}  # by structure and shapes of the arguments
        self._last: tuple[Any, _Program | None] = None, None

    def __call__(self, *arguments: Any) -> Any:
        if self._shortcut is not None:
            found = self._shortcut(*arguments)
            if found is not None:
                return found
        return self.flat(*jax.tree.flatten(arguments, is_leaf=_is_view))

    def flat(self, leaves: list[Any], structure: Any) -> Any:
        """The function of flattened arguments, in which a view is one leaf.

        Args:
          structure: of the arguments. The same object as in the last call: with arrays of the same shapes.
        """
        program = self._program(leaves, structure)
        taken = [leaves[i] if read is None else read(leaves[i]) for i, read in program.takes]
        return jax.tree.unflatten(program.structure, program.function(taken))

    def traced(self, leaves: list[Any], structure: Any) -> frozenset[str]:
        """`reads` of flattened arguments as of `flat`, without compiling or calling anything."""
        return self._program(leaves, structure).reads

    def _program(self, leaves: list[Any], structure: Any) -> _Program:
        last, program = self._last
        if structure is not last or program is None:
            key = structure, *[leaf.__class__ if _is_view(leaf) else getattr(leaf, "shape", ()) for leaf in leaves]
            program = self._programs.get(key)
            if program is None:
                program = self._programs[key] = self._trace(leaves, structure)
            self._last = structure, program
        return program

    @property
    def reads(self) -> frozenset[str]:
        """Fields of views on which results depend, of all programs so far."""
        return frozenset[str]().union(*(program.reads for program in self._programs.values()))

    @property
    def takes(self) -> frozenset[int]:
        """Numbers of the other leaves of the arguments on which results depend, of all programs so far; a view is one
        leaf."""
        return frozenset(i for program in self._programs.values() for i, read in program.takes if read is None)

    def _cache_size(self) -> int:
        """How many programs are compiled; JAX's own functions have this name for it."""
        return sum(program.function.call._cache_size() for program in self._programs.values())  # pyright: ignore

    def _trace(self, leaves: list[Any], structure: Any) -> _Program:
        names, arrays, places = tuple(SCHEMA), list[Array](), list[tuple[int, Callable[[Any], Array] | None]]()
        fields = list[str]()
        for i, leaf in enumerate(leaves):
            if _is_view(leaf):
                arrays += read_fields(leaf, names)
                places += [(i, operator.attrgetter(name)) for name in names]
                fields += names
            else:
                arrays.append(leaf)
                places.append((i, None))
                fields.append("")
        shapes = [jax.ShapeDtypeStruct(jnp.shape(x), jnp.result_type(x)) for x in arrays]
        structures = []

        def whole(every: list[Any]) -> list[Any]:
            rest = iter(every)
            given = [
                assemble({name: next(rest) for name in names}) if _is_view(leaf) else next(rest) for leaf in leaves
            ]
            made, made_structure = jax.tree.flatten(self._function(*jax.tree.unflatten(structure, given)))
            structures.append(made_structure)
            return made

        with GC_PAUSED:
            traced = jax.make_jaxpr(whole)(shapes)
            images = any(_is_image(a.shape) for a in (*traced.in_avals, *traced.out_avals))
            function = PackedFunction(traced, self._name, {} if images else None)  # they are worth several threads
        reads = frozenset(fields[i] for i in function.takes if fields[i])
        return _Program([places[i] for i in function.takes], reads, function, structures[0])


def _is_image(shape: tuple[int, ...]) -> bool:
    """Whether an array has the size of images and their axes (worlds, cameras, rows, columns), which relations of all
    pairs of objects do not have."""
    return len(shape) > 3 and math.prod(shape) > LARGEST


def _is_view(node: Any) -> bool:
    return isinstance(node, PhysicsView)


def _copy_of(leaf: Any) -> Any:
    if isinstance(leaf, np.ndarray):
        return leaf.copy()
    return leaf.fork() if hasattr(leaf, "fork") else leaf  # nobody can change JAX's arrays, nor views
