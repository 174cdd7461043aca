"""`Pool`: many settled initial states of a scene. A batched reset gathers its rows; nothing is solved on the device.

`ig2mj.sampling.settled` makes pools with the native engine; the file is an npz archive.

Axis: P rows.
"""

from __future__ import annotations

import os
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Int

from ig2mj.engine.base import Snapshot
from ig2mj.engine.view import Array
from ig2mj.errors import InputError
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.archive import load_tree, read_header, save_tree

FORMAT_VERSION = 1


@struct.dataclass
class Pool:
    """Rows of initial states: physics, and extended states. Every array begins with the row axis."""

    physics: Snapshot
    states: ExtendedStates

    @property
    def size(self) -> int:
        return self.physics.qpos.shape[0]

    def rows(self, index: Int[Array, "W"]) -> Pool:
        """The rows of these numbers, in that order. On the host for numpy's numbers, else it may be traced."""
        read = np.asarray if isinstance(index, np.ndarray) else jnp.asarray
        return jax.tree.map(lambda a: read(a)[index], self)


def stack(pools: list[Pool]) -> Pool:
    """One pool of the rows of several."""
    return jax.tree.map(lambda *rows: np.concatenate([np.asarray(r) for r in rows]), *pools)


def save_pool(pool: Pool, file: str | os.PathLike, scene: str, note: dict[str, Any] | None = None) -> None:
    """Writes a pool. `scene`: the scene's name; `note`: how it was made, for people."""
    save_tree(file, pool, {"kind": "pool", "format_version": FORMAT_VERSION, "scene": scene, **(note or {})})


def load_pool(file: str | os.PathLike, like: Pool, scene: str) -> Pool:
    """Reads a pool of the scene; `like`: any pool of it, for the shapes.

    Raises:
      InputError: the file is missing, broken, of another scene, or of another version.
    """
    header = read_header(file)
    mend = "make a pool of this scene with `ig2mj pool`"
    if header.get("kind") != "pool" or header.get("format_version") != FORMAT_VERSION:
        raise InputError(file, "is no pool of this version", mend=mend)
    if header.get("scene") != scene:
        raise InputError(file, f"is a pool of scene '{header.get('scene')}', not of '{scene}'", mend=mend)
    pool, _ = load_tree(file, like)
    if not pool.size:
        raise InputError(file, "has no rows", mend=mend)
    return pool
