"""`PackedFunction`: a pure function of arrays, compiled so that it takes just those on which its results depend.

Each array that enters a compiled function from the host, or leaves it, costs one to four microseconds: as much as the
work itself for one world. So small arrays are packed into one vector for each dtype before the call and unpacked after
it, on the host. Results are read-only NumPy arrays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr, jaxpr_as_fun

from ig2mj.engine.view import Array
from ig2mj.process.tracing import inputs_that_matter
from ig2mj.process.xla_small_call import SmallCall

LARGEST = 1 << 14
"""Numbers of an array that is worth a copy."""


class _Piece(NamedTuple):
    """Where an array stands: the vector's number, and a part of it."""

    vector: int
    part: slice
    shape: tuple[int, ...]


class Packing:
    """Arrays of known shapes as a few vectors: one of each dtype, and the large arrays and keys as they are."""

    def __init__(self, shapes: Sequence[Any]):
        """`shapes`: have shape and dtype."""
        alone = [isinstance(s.dtype, np.dtype) and math.prod(s.shape) <= LARGEST for s in shapes]
        self._dtypes = list(dict.fromkeys(s.dtype for s, small in zip(shapes, alone, strict=True) if small))
        self._members: list[list[int]] = [[] for _ in self._dtypes]
        self._pieces: list[_Piece] = []
        lengths, count = [0] * len(self._dtypes), len(self._dtypes)
        for i, (s, small) in enumerate(zip(shapes, alone, strict=True)):
            if small:
                vector, size = self._dtypes.index(s.dtype), math.prod(s.shape)
                self._pieces.append(_Piece(vector, slice(lengths[vector], lengths[vector] + size), s.shape))
                self._members[vector].append(i)
                lengths[vector] += size
            else:
                self._pieces.append(_Piece(count, slice(None), s.shape))
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
        small = len(self._members)
        return [
            vectors[vector][part].reshape(shape) if vector < small else vectors[vector]
            for vector, part, shape in self._pieces
        ]


class PackedFunction:
    """A traced function of a list of arrays that gives a list of arrays.

    Attributes:
      takes: places of the arguments on which its results depend; only these are given to `__call__`, in this order.
      call: the compiled function of vectors.
    """

    def __init__(self, traced: ClosedJaxpr, name: str, options: dict[str, int | bool] | None = None):
        """Compiles nothing yet: that happens at the first call.

        Args:
          traced: by `jax.make_jaxpr`. name: of the program, for people. options: of the compiler; with any of them the
            program is none that has to be fast, and is compiled as usual.
        """
        shapes = traced.in_avals
        self.takes = np.flatnonzero(inputs_that_matter(traced.jaxpr)).tolist()
        self._given, self._made = Packing([shapes[i] for i in self.takes]), Packing(traced.out_avals)
        function, small = jaxpr_as_fun(traced), options is None and _is_small(traced)

        def packed(vectors: list[Any]) -> list[jax.Array]:
            every: list[Any] = [None] * len(shapes)
            for i, array in zip(self.takes, self._given.taken_apart(vectors), strict=True):
                every[i] = array
            inputs = (_blank(s) if x is None else x for x, s in zip(every, shapes, strict=True))
            return self._made.traced(function(*inputs))

        packed.__name__ = name
        self.call = (SmallCall if small else jax.jit)(packed, compiler_options=options)

    def __call__(self, arrays: Sequence[Array]) -> list[Any]:
        """All results of the arguments at `takes`."""
        vectors = self.call(self._given.on_host(arrays))
        return self._made.taken_apart([_fetched(vector) for vector in vectors])


def _is_small(traced: ClosedJaxpr) -> bool:
    """Whether all that is taken is of one world."""
    return all(not a.shape or a.shape[0] <= 1 for a in traced.in_avals if len(a.shape) > 1)


def _blank(shape: Any) -> Any:
    numbers = np if isinstance(shape.dtype, np.dtype) else jnp
    return numbers.zeros(shape.shape, shape.dtype)


def _fetched(array: jax.Array) -> Array:
    return np.asarray(array) if isinstance(array.dtype, np.dtype) else array
