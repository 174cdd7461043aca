"""Frames of bodies, number by number, for programs in which an axis of vectors costs a GPU kernels of its own.

XLA makes one kernel of operations on arrays of one shape. Stacks, cross products and sums over an axis of three part
them; three arrays do not.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ig2mj.geometry.poses import AnyArray, matrix_rows

Numbers = Sequence[AnyArray]
"""The x, y and z of vectors: three arrays of one shape."""


class Frames(NamedTuple):
    """Poses of some bodies.

    Attributes:
      turn: rotation matrices, by row and column. at: positions, m, world frame. None: the world's frame.
    """

    turn: list[list[AnyArray]] | None
    at: list[AnyArray] | None

    @classmethod
    def of(cls, pos: Float[AnyArray, "W B 3"], quat: Float[AnyArray, "W B 4"], bodies: Int[np.ndarray, "*n"]) -> Frames:
        """Those of bodies, [W, *n]."""
        pos, quat = jnp.asarray(pos)[:, bodies], jnp.asarray(quat)[:, bodies]
        return cls(matrix_rows(*(quat[..., i] for i in range(4))), [pos[..., i] for i in range(3)])

    def with_axes(self, *axes: int) -> Frames:
        """With axes of length 1 at these places."""
        return jax.tree.map(lambda x: jnp.expand_dims(x, axes), self)

    def turned(self, vector: Numbers) -> list[AnyArray]:
        """Directions in the bodies' frames, in the world's."""
        if self.turn is None:
            return list(vector)
        return [dot(row, vector) for row in self.turn]

    def points(self, point: Numbers) -> list[AnyArray]:
        """Points in the bodies' frames, in the world's."""
        return list(point) if self.at is None else [a + v for a, v in zip(self.at, self.turned(point), strict=True)]

    def offset(self, point: Numbers) -> list[AnyArray]:
        """From the bodies to points in the world's frame."""
        return list(point) if self.at is None else [point[i] - self.at[i] for i in range(3)]

    def local(self, vector: Numbers) -> list[AnyArray]:
        """Directions in the world's frame, in the bodies'."""
        if self.turn is None:
            return list(vector)
        return [dot([row[j] for row in self.turn], vector) for j in range(3)]

    def up(self) -> list[AnyArray]:
        """The direction upwards, in the bodies' frames."""
        return list(np.eye(3, dtype=np.float32)[2]) if self.turn is None else list(self.turn[2])


def numbers(vectors: AnyArray) -> list[AnyArray]:
    """The numbers of vectors [..., 3]."""
    return [vectors[..., i] for i in range(vectors.shape[-1])]


def total(values: AnyArray, axis: int = -1) -> jax.Array:
    """The sum over a short axis, number by number: it becomes part of the kernel that uses it, where a reduction is one
    of its own."""
    return _combined(operator.add, values, axis)


def some(values: AnyArray, axis: int = -1) -> jax.Array:
    """Whether any is true along a short axis; see `total`."""
    return _combined(operator.or_, values, axis)


def _combined(operation: Callable[[jax.Array, jax.Array], jax.Array], values: AnyArray, axis: int) -> jax.Array:
    array = jnp.asarray(values)
    if not array.shape[axis]:
        return jnp.sum(array, axis=axis, dtype=array.dtype)
    parts = [jax.lax.index_in_dim(array, i, axis, keepdims=False) for i in range(array.shape[axis])]
    return functools.reduce(operation, parts)


def sums(values: Numbers, axis: int) -> Sequence[jax.Array]:
    """The sums of arrays of one shape over an axis, in one reduction."""

    def added(one: tuple, other: tuple) -> tuple:
        return tuple(a + b for a, b in zip(one, other, strict=True))

    operands = tuple(jnp.asarray(v) for v in values)
    return jax.lax.reduce(operands, tuple(np.zeros((), v.dtype) for v in operands), added, (axis % operands[0].ndim,))


def dot(one: Numbers, other: Numbers) -> AnyArray:
    """Their product."""
    return sum(a * b for a, b in zip(one, other, strict=True))  # pyright: ignore[reportReturnType]
