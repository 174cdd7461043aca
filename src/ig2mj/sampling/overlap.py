"""How deep objects stand in others, in given positions: what random placing must check and physics would tear apart."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.scene.scene import Scene


class Overlaps:
    """Measures one state after another of a scene, with C MuJoCo and with nothing asleep."""

    def __init__(self, scene: Scene):
        """Binds a scene."""
        self._model = copy.copy(scene.model)
        self._model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        self._data = mujoco.MjData(self._model)
        self._owner = np.asarray(scene.tables.geom_object)
        self._count = scene.tables.num_objects

    def deepest(self, qpos: Float[np.ndarray, "nq"]) -> Float[np.ndarray, "O"]:
        """How deep each object stands in anything that is not part of it, metres; 0 where it stands in nothing."""
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_collision(self._model, data)
        depth = np.zeros(self._count)
        if data.ncon:
            owner = self._owner[data.contact.geom]
            depth_of = np.where(owner[:, 0] != owner[:, 1], -data.contact.dist, 0.0)
            for side in range(2):
                known = owner[:, side] >= 0
                np.maximum.at(depth, owner[known, side], depth_of[known])
        return depth
