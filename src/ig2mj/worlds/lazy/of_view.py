"""`OfView`: a function of the view, compiled so that it takes just the arrays on which its results depend.

Beside the native engine many fields of the view are only made when they are read, and arrays are dear to hand over
(`ig2mj.worlds.lazy.packing`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ig2mj.engine.view import SCHEMA, PhysicsView, assemble, read_fields
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.worlds.lazy.packing import PackedFunction


class _Program(NamedTuple):
    """Fields of the view and leaves of the other arguments that matter, a function of both, and what it gives."""

    reads: tuple[str, ...]
    takes: list[int]
    function: PackedFunction
    structure: Any


class OfView:
    """A pure function whose first argument is the view; the others are pytrees. Traced at its first call.

    Results are NumPy arrays that nobody may write to.
    """

    def __init__(self, function: Callable[..., Any]):
        self._function = function
        self._name = getattr(function, "__name__", "of_view").strip("_")
        self._programs: dict[Any, _Program] = {}  # by structure of the other arguments

    def __call__(self, view: PhysicsView, *others: Any) -> Any:
        leaves, structure = jax.tree.flatten(others)
        found = self._programs.get(structure)
        if found is None:
            found = self._programs[structure] = self._trace(view, leaves, structure)
        taken = read_fields(view, found.reads) + [leaves[i] for i in found.takes]
        return jax.tree.unflatten(found.structure, found.function(taken))

    @property
    def reads(self) -> frozenset[str]:
        """Fields of the view on which results depend, of all calls so far."""
        return frozenset[str]().union(*(program.reads for program in self._programs.values()))

    def _cache_size(self) -> int:
        """How many programs were compiled; the name that JAX's own functions have for it."""
        return sum(program.function.call._cache_size() for program in self._programs.values())  # pyright: ignore

    def _trace(self, view: PhysicsView, leaves: list[Any], structure: Any) -> _Program:
        names = tuple(SCHEMA)
        shapes = [jax.ShapeDtypeStruct(jnp.shape(x), jnp.result_type(x)) for x in [*read_fields(view, names), *leaves]]
        structures = []

        def whole(every: list[Any]) -> list[Any]:
            others = jax.tree.unflatten(structure, every[len(names) :])
            made = self._function(assemble(dict(zip(names, every[: len(names)], strict=True))), *others)
            found, made_structure = jax.tree.flatten(made)
            structures.append(made_structure)
            return found

        with GC_PAUSED:
            function = PackedFunction(jax.make_jaxpr(whole)(shapes), self._name)
        return _Program(
            tuple(names[i] for i in function.takes if i < len(names)),
            [i - len(names) for i in function.takes if i >= len(names)],
            function,
            structures[0],
        )
