"""`OfView`: a function of the view, compiled so that it takes just the arrays on which its results depend.

Beside the native engine many fields of the view are only made when they are read, and every array that goes into a
compiled function or comes out of it costs one to four microseconds. So small ones go in and come out as one vector of
each dtype, which are put together and taken apart on the host: results are NumPy arrays that nobody may write to.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import SCHEMA, Array, PhysicsView, assemble, read_fields
from ig2mj.predicates.tracing import inputs_that_matter

LARGEST = 1 << 14
"""Numbers of an array that is worth a copy."""


class _Piece(NamedTuple):
    """Where an array stands: the vector's number, and a part of it."""

    vector: int
    part: slice
    shape: tuple[int, ...]


class _Packing:
    """Arrays of known shapes as a few vectors: one of each dtype, and the large arrays and keys as they are."""

    def __init__(self, shapes: Sequence[Any]):
        """`shapes`: have shape and dtype."""
        alone = [isinstance(s.dtype, np.dtype) and math.prod(s.shape) <= LARGEST for s in shapes]
        self.dtypes = list(dict.fromkeys(s.dtype for s, small in zip(shapes, alone, strict=True) if small))
        self._members: list[list[int]] = [[] for _ in self.dtypes]
        self.pieces: list[_Piece] = []
        lengths, count = [0] * len(self.dtypes), len(self.dtypes)
        for i, (s, small) in enumerate(zip(shapes, alone, strict=True)):
            if small:
                vector, size = self.dtypes.index(s.dtype), math.prod(s.shape)
                self.pieces.append(_Piece(vector, slice(lengths[vector], lengths[vector] + size), s.shape))
                self._members[vector].append(i)
                lengths[vector] += size
            else:
                self.pieces.append(_Piece(count, slice(None), s.shape))
                count += 1
        self._alone = [i for i, small in enumerate(alone) if not small]

    def on_host(self, arrays: Sequence[Array]) -> list[Any]:
        """The vectors, in NumPy; large arrays as they are."""
        packed: list[Any] = [
            np.concatenate([np.asarray(arrays[i]).reshape(-1) for i in members]) for members in self._members
        ]
        return packed + [arrays[i] for i in self._alone]

    def traced(self, arrays: Sequence[Array]) -> list[jax.Array]:
        """The vectors, in a compiled function."""
        packed = [jnp.concatenate([jnp.ravel(arrays[i]) for i in members]) for members in self._members]
        return packed + [jnp.asarray(arrays[i]) for i in self._alone]

    def taken_apart(self, vectors: Sequence[Any]) -> list[Any]:
        """The arrays again, on the host or in a compiled function."""
        return [
            vectors[p.vector][p.part].reshape(p.shape) if p.vector < len(self.dtypes) else vectors[p.vector]
            for p in self.pieces
        ]


class _Program(NamedTuple):
    """Fields of the view and leaves of the other arguments that matter, and a function of both."""

    reads: tuple[str, ...]
    takes: list[int]
    given: _Packing
    call: Callable[..., list[jax.Array]]
    made: _Packing
    structure: Any


class OfView:
    """A pure function whose first argument is the view; the others are pytrees. Traced at its first call."""

    def __init__(self, function: Callable[..., Any]):
        self._function = function
        self._programs: dict[Any, _Program] = {}  # by structure of the other arguments

    def __call__(self, view: PhysicsView, *others: Any) -> Any:
        leaves, structure = jax.tree.flatten(others)
        found = self._programs.get(structure)
        if found is None:
            found = self._programs[structure] = self._trace(view, leaves, structure)
        taken = read_fields(view, found.reads) + [leaves[i] for i in found.takes]
        vectors = [_fetched(vector) for vector in found.call(found.given.on_host(taken))]
        return jax.tree.unflatten(found.structure, found.made.taken_apart(vectors))

    def _cache_size(self) -> int:
        """How many programs were compiled; the name that JAX's own functions have for it."""
        return sum(program.call._cache_size() for program in self._programs.values())  # pyright: ignore

    def _trace(self, view: PhysicsView, leaves: list[Any], structure: Any) -> _Program:
        fields = read_fields(view, tuple(SCHEMA))
        shapes = [jax.ShapeDtypeStruct(jnp.shape(x), jnp.result_type(x)) for x in [*fields, *leaves]]

        structures = []

        def whole(every: list[Any]) -> list[Any]:
            others = jax.tree.unflatten(structure, every[len(fields) :])
            made = self._function(assemble(dict(zip(SCHEMA, every[: len(fields)], strict=True))), *others)
            found, made_structure = jax.tree.flatten(made)
            structures.append(made_structure)
            return found

        traced = jax.make_jaxpr(whole)(shapes)
        matters = np.flatnonzero(inputs_that_matter(traced.jaxpr)).tolist()
        given, results = _Packing([shapes[i] for i in matters]), _Packing(traced.out_avals)

        def call(vectors: list[Any]) -> list[jax.Array]:
            every: list[Any] = [None] * len(shapes)
            for i, array in zip(matters, given.taken_apart(vectors), strict=True):
                every[i] = array
            every = [_blank(s) if x is None else x for x, s in zip(every, shapes, strict=True)]
            return results.traced(whole(every))

        names = tuple(SCHEMA)
        return _Program(
            tuple(names[i] for i in matters if i < len(names)),
            [i - len(names) for i in matters if i >= len(names)],
            given,
            jax.jit(call),
            results,
            structures[0],
        )


def _blank(shape: jax.ShapeDtypeStruct) -> Any:
    return (
        np.zeros(shape.shape, shape.dtype) if isinstance(shape.dtype, np.dtype) else jnp.zeros(shape.shape, shape.dtype)
    )


def _fetched(array: jax.Array) -> Array:
    return np.asarray(array) if isinstance(array.dtype, np.dtype) else array
