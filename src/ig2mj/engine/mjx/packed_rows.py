"""Rows of many arrays as one array of bytes: one copy to the host in place of one for each array.

Axes: W worlds, k rows, B bytes of a row of all arrays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int, UInt8


class PackedRows:
    """Takes rows of the arrays of a tree, compiled for each number of rows.

    Attributes:
      read: the tree, traced, from the arguments of `begin`; its arrays have an axis of W worlds first.
    """

    def __init__(self, read: Callable[..., Any]):
        self.read = read
        self._pack = jax.jit(self._packed)
        self._kinds: dict[Any, tuple[Any, list[jax.ShapeDtypeStruct]]] = {}

    def begin(self, rows: Int[np.ndarray, "k"], *arguments: Any) -> Callable[[], Any]:
        """Begins to copy rows to the host. Returns a function that waits for them: the tree in numpy arrays [k, ...] of
        their own."""
        given, structure = jax.tree.flatten(arguments)
        kind = structure, tuple((a.shape, a.dtype) for a in given)
        if kind not in self._kinds:
            self._kinds[kind] = self._kind(arguments)
        tree, leaves = self._kinds[kind]
        packed = self._pack(rows, *arguments)
        packed.copy_to_host_async()
        return lambda: jax.tree.unflatten(tree, _unpacked(np.asarray(packed), leaves))

    def _kind(self, arguments: Sequence[Any]) -> tuple[Any, list[jax.ShapeDtypeStruct]]:
        """Structure, shapes and types of what is read."""
        structures = []

        def leaves(*traced: Any) -> list[Array]:
            found, structure = jax.tree.flatten(self.read(*traced))
            structures.append(structure)
            return found

        shapes = jax.eval_shape(leaves, *arguments)
        return structures[0], shapes

    def _packed(self, rows: Int[Array, "k"], *arguments: Any) -> UInt8[Array, "k B"]:
        return jnp.concatenate([_bytes_of(leaf[rows]) for leaf in jax.tree.leaves(self.read(*arguments))], axis=1)


def _bytes_of(array: Array) -> UInt8[Array, "k b"]:
    """The bytes of each row."""
    plain = array.astype(jnp.uint8) if array.dtype == bool else array
    return jax.lax.bitcast_convert_type(plain, jnp.uint8).reshape(len(array), -1)


def _unpacked(packed: UInt8[np.ndarray, "k B"], leaves: Sequence[jax.ShapeDtypeStruct]) -> list[np.ndarray]:
    """Arrays of the bytes that `_bytes_of` makes of them. `leaves`: [W, ...]."""
    found, end = [], 0
    for leaf in leaves:
        begin, end = end, end + math.prod(leaf.shape[1:]) * leaf.dtype.itemsize
        part = np.array(packed[:, begin:end]).view(leaf.dtype) if end > begin else np.zeros(0, leaf.dtype)
        found.append(part.reshape(len(packed), *leaf.shape[1:]))
    return found
