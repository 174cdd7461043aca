"""Trees of arrays without those that have no elements, for programs over several devices.

XLA for GPUs ends with a segmentation fault while it compiles a `jax.shard_map` that is handed an array without elements
and does anything with it (JAX 0.11.2, not 0.10.2: Shardy's `ManualComputationUnusedInputsPattern`; a program
for CPUs compiles). Ours have some, e.g. the image and label arrays of runs that have none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
from jax.sharding import PartitionSpec


def nonempty(tree: Any) -> list[Any]:
    """The leaves that have elements: arrays, or shapes of `jax.eval_shape`."""
    return [a for a in jax.tree.leaves(tree) if a.size]


def specs_of(tree: Any, specs: Any) -> Any:
    """A partition spec for each leaf. `specs`: one for all, or a tree of them already."""
    return jax.tree.map(lambda _: specs, tree) if isinstance(specs, PartitionSpec) else specs


def nonempty_specs(tree: Any, specs: Any) -> list[PartitionSpec]:
    """The partition specs of the leaves of `nonempty`."""
    each = jax.tree.leaves(specs_of(tree, specs), is_leaf=_is_spec)
    return [spec for a, spec in zip(jax.tree.leaves(tree), each, strict=True) if a.size]


def shards_of(tree: Any, specs: Any, count: int) -> Any:
    """Shapes and types of what one of `count` devices has of each leaf."""

    def part(spec: PartitionSpec, a: Any) -> jax.ShapeDtypeStruct:
        axes = (*spec, *[None] * (len(a.shape) - len(spec)))
        shape = (size // count if axis else size for size, axis in zip(a.shape, axes, strict=True))
        return jax.ShapeDtypeStruct(tuple(shape), a.dtype)

    return jax.tree.map(part, specs_of(tree, specs), tree, is_leaf=_is_spec)


def restored(tree: Any, leaves: Sequence[Any]) -> Any:
    """The whole tree again.

    Args:
      tree: of the same structure; of its leaves without elements, arrays are kept and shapes become arrays. leaves:
        those of `nonempty`.
    """
    rest = iter(leaves)

    def leaf(known: Any) -> Any:
        if known.size:
            return next(rest)
        return jnp.zeros(known.shape, known.dtype) if isinstance(known, jax.ShapeDtypeStruct) else known

    return jax.tree.map(leaf, tree)


def _is_spec(node: Any) -> bool:
    return isinstance(node, PartitionSpec)
