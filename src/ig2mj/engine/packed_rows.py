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
        self._kinds: dict[Any, tuple[Any, list[jax.ShapeDtypeStruct], Callable[..., Array]]] = {}

    def begin(self, rows: Int[np.ndarray, "k"], *arguments: Any) -> Callable[[], Any]:
        """Begins to copy rows to the host. Returns a function that waits for them: the tree in numpy arrays [k, ...] of
        their own."""
        given, structure = jax.tree.flatten(arguments)
        kind = structure, tuple((a.shape, a.dtype) for a in given)
        if kind not in self._kinds:
            self._kinds[kind] = self._kind(structure, given)
        tree, leaves, pack = self._kinds[kind]
        packed = pack(rows, given)
        packed.copy_to_host_async()
        return lambda: jax.tree.unflatten(tree, _unpacked(np.asarray(packed), leaves))

    def _kind(
        self, structure: Any, given: Sequence[Any]
    ) -> tuple[Any, list[jax.ShapeDtypeStruct], Callable[..., Array]]:
        """Structure, shapes and types of what is read, and what packs it: a program of the arguments' leaves, since
        flattening them takes as long as the call."""
        structures = []

        def leaves(traced: Sequence[Any]) -> list[Array]:
            found, tree = jax.tree.flatten(self.read(*jax.tree.unflatten(structure, traced)))
            structures.append(tree)
            return found

        def packed(rows: Int[Array, "k"], traced: Sequence[Any]) -> UInt8[Array, "k B"]:
            return jnp.concatenate([_bytes_of(leaf[rows]) for leaf in leaves(traced)], axis=1)

        shapes = jax.eval_shape(leaves, given)
        return structures[0], shapes, jax.jit(packed)


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
