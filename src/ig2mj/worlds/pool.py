"""`Pool`: many settled initial states of a scene. A batched reset gathers its rows; nothing is solved on the device.

A pool of the bare scene serves the scene with any robot (`ig2mj.engine.snapshot`). `ig2mj.sampling.settled` makes pools
with the native engine; the file is an npz archive.

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

from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array
from ig2mj.errors import InputError
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.archive import HEADER, build, read_arrays, read_header, save_tree

FORMAT_VERSION = 2
"""1: scene and agents were not separate (`ig2mj.engine.snapshot`)."""


@struct.dataclass
class Pool:
    """Rows of initial states: physics, and extended states. Every array begins with the row axis."""

    physics: Snapshot
    states: ExtendedStates

    @property
    def size(self) -> int:
        return self.physics.time.shape[0]

    def rows(self, index: Int[Array, "W"]) -> Pool:
        """The rows of these numbers, in that order. On the host for numpy's numbers, else it may be traced."""
        read = np.asarray if isinstance(index, np.ndarray) else jnp.asarray
        return jax.tree.map(lambda a: read(a)[index], self)


def stack(pools: list[Pool]) -> Pool:
    """One pool of the rows of several."""
    return jax.tree.map(lambda *rows: np.concatenate([np.asarray(r) for r in rows]), *pools)


def save_pool(pool: Pool, file: str | os.PathLike, scene: Scene, note: dict[str, Any] | None = None) -> None:
    """Writes a pool of the scene. `note`: how it was made, for people."""
    header = {"kind": "pool", "format_version": FORMAT_VERSION, "scene": scene.name, "digest": scene.digest}
    save_tree(file, pool, {**header, **(note or {})})


def load_pool(file: str | os.PathLike, scene: Scene | None = None) -> Pool:
    """Reads a pool.

    Args:
      scene: what it is for, with whatever agents: it must be the very scene, converted once, that the pool was made in.
        None: unchecked.

    Raises:
      InputError: the file is missing, broken, of another scene, or of another format.
    """
    header = read_header(file)
    mend = "make a pool of this scene with `ig2mj pool`"
    if header.get("kind") != "pool" or header.get("format_version") != FORMAT_VERSION:
        raise InputError(file, f"is no pool of format {FORMAT_VERSION}", mend=mend)
    if scene is not None and header.get("scene") != scene.name:
        raise InputError(file, f"is a pool of scene '{header.get('scene')}', not of '{scene.name}'", mend=mend)
    if scene is not None and header.get("digest") != scene.digest:
        raise InputError(file, f"was made before '{scene.name}' was converted as it is now", mend=mend)
    arrays = read_arrays(file, "")
    arrays.pop(HEADER)
    pool = build(Pool, arrays, file)
    lengths = {len(array) if array.ndim else 0 for array in arrays.values()}
    if len(lengths) != 1:
        raise InputError(file, f"has arrays of different lengths: {', '.join(map(str, sorted(lengths)))}", mend=mend)
    if not pool.size:
        raise InputError(file, "has no rows", mend=mend)
    return pool
