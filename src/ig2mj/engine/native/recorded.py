"""`Pieces`: a world's snapshot in few arrays, for those who take one in every step.

One call of MuJoCo copies nearly all of its state, and what did not change is the same array as before, so that `is`
tells what need not be written again. `Pieces.cuts` tells where in them the leaves of a `Snapshot` are.

Axis: F frames.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.native.one_world import NativeWorld
from ig2mj.engine.snapshot import AXIS

_IN_ORDER = {
    "time": mujoco.mjtState.mjSTATE_TIME,
    "qpos": mujoco.mjtState.mjSTATE_QPOS,
    "qvel": mujoco.mjtState.mjSTATE_QVEL,
    "act": mujoco.mjtState.mjSTATE_ACT,
    "qacc_warmstart": mujoco.mjtState.mjSTATE_WARMSTART,
    "ctrl": mujoco.mjtState.mjSTATE_CTRL,
    "mocap_pos": mujoco.mjtState.mjSTATE_MOCAP_POS,
    "mocap_quat": mujoco.mjtState.mjSTATE_MOCAP_QUAT,
}
"""In the order in which `mj_getState` puts them, which is that of their bits."""

_ROWS = {"mocap_pos": (3,), "mocap_quat": (4,)}

_OTHERS = ("eq_active", "eq_data", "tree_asleep")
"""Pieces that have a scene's part and an agents' part, behind the vector of the first piece."""


class Cut(NamedTuple):
    """A leaf's place: rows `start` to `stop` of a piece; `shape`: of the leaf, None: as the rows are."""

    piece: int
    start: int = 0
    stop: int | None = None
    shape: tuple[int, ...] | None = None

    def __call__(self, piece: np.ndarray) -> np.ndarray:
        """The leaf [F, ...] from the piece [F, ...]."""
        rows = piece[:, self.start : self.stop] if piece.ndim > 1 else piece
        return rows if self.shape is None else rows.reshape(len(piece), *self.shape)


class Pieces:
    """Makes the pieces of a world. Attributes: cuts: of leaves of `NativeWorld.save()`, in the order of its pytree."""

    def __init__(self, model: mujoco.MjModel, layout: ModelLayout, own_fields: tuple[str, ...]):
        """Finds the places of both parts."""
        assert sorted(map(int, _IN_ORDER.values())) == [int(bit) for bit in _IN_ORDER.values()]
        self._which = sum(int(bit) for bit in _IN_ORDER.values())
        self._size = mujoco.mj_stateSize(model, self._which)
        middles, at = layout.scene_sizes, 1  # behind the time
        parts: dict[str, tuple[Cut, Cut]] = {}
        for name, bit in list(_IN_ORDER.items())[1:]:
            row = _ROWS.get(name, ())
            middle, end = at + middles[name] * math.prod(row), at + mujoco.mj_stateSize(model, int(bit))
            shapes = [((stop - start) // math.prod(row), *row) for start, stop in ((at, middle), (middle, end))]
            parts[name] = Cut(0, at, middle, shapes[0]), Cut(0, middle, end, shapes[1])
            at = end
        for piece, name in enumerate(_OTHERS, 1):
            parts[name] = Cut(piece, 0, middles[name]), Cut(piece, middles[name])
        scene, agents = ([parts[name][k] for name in AXIS] for k in (0, 1))
        time, fields = Cut(0, 0, 1, ()), [Cut(7 + k) for k in range(len(own_fields))]
        self.cuts = [*scene, Cut(4), *agents, Cut(5), Cut(6), time, *fields]

    def __call__(self, world: NativeWorld) -> list[np.ndarray]:
        """Of a world's present state. They are not changed later, and must not be."""
        data, vector = world.data, np.empty(self._size)
        mujoco.mj_getState(world.model, data, vector, self._which)
        others = [data.eq_active.astype(bool), world.fields["eq_data"], data.tree_asleep.copy()]
        own = (world.fields[name] for name in world.statics.own_fields)
        return [vector, *others, world.units, world.agents_touch(), world.ignored, *own]
