"""Penetration depths of objects in given positions, which random placement must check, and which objects rest on which
links: those move along when a drawer is opened.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import TOUCH_TOLERANCE
from ig2mj.scene.scene import Scene

UPRIGHT = 0.5
"""Cosine between a contact's normal and the vertical from which the upper object rests on the lower one."""


class Overlaps:
    """Measures one state after another of a scene, with C MuJoCo and with nothing asleep."""

    def __init__(self, scene: Scene):
        """Binds a scene."""
        self._model = copy.copy(scene.model)
        self._model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        self._data = mujoco.MjData(self._model)
        tables = scene.tables
        self._tables = tables
        self._loose = ~tables.object_fixed & ~tables.object_parked
        self._owner = np.asarray(tables.geom_object)
        self._count = tables.num_objects

    def deepest(self, qpos: Float[np.ndarray, "nq"]) -> Float[np.ndarray, "O"]:
        """How deep each object stands in anything that is not part of it, metres; 0 where it stands in nothing."""
        data = self._collide(qpos)
        depth = np.zeros(self._count)
        if data.ncon:
            owner = self._owner[data.contact.geom]
            depth_of = np.where(owner[:, 0] != owner[:, 1], -data.contact.dist, 0.0)
            for side in range(2):
                known = owner[:, side] >= 0
                np.maximum.at(depth, owner[known, side], depth_of[known])
        return depth

    def carried(
        self, qpos: Float[np.ndarray, "nq"], mask: Bool[np.ndarray, "nq"], target: Float[np.ndarray, "nq"]
    ) -> tuple[Int[np.ndarray, "K"], Float[np.ndarray, "K 3"], Float[np.ndarray, "K 4"]]:
        """Loose objects that rest on nothing but links that move, and where these links carry them.

        Args:
          qpos: where everything is. mask, target: coordinates of hinges and slides that change, and their new values.

        Returns:
          Objects, and poses of their main bodies: positions (m) and quaternions (w-x-y-z), world frame.
        """
        model, data = self._model, self._collide(qpos)
        link = self._carriers(self._moving(mask))
        objects = np.array(sorted(link), int)
        roots = self._tables.object_root[objects]
        links = np.array([link[o] for o in objects], int)
        pos, quat = np.zeros((len(objects), 3)), np.zeros((len(objects), 4))
        before = [(np.array(data.xpos[b]), np.array(data.xquat[b])) for b in links]
        poses = [(np.array(data.xpos[b]), np.array(data.xquat[b])) for b in roots]
        data.qpos[:] = np.where(mask, target, qpos)
        mujoco.mj_kinematics(model, data)
        back, inner, turn, way = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(3)
        for k, b in enumerate(links):
            mujoco.mju_negQuat(back, before[k][1])
            mujoco.mju_rotVecQuat(way, poses[k][0] - before[k][0], back)
            mujoco.mju_mulQuat(inner, back, poses[k][1])
            mujoco.mju_rotVecQuat(pos[k], way.copy(), data.xquat[b])
            mujoco.mju_mulQuat(turn, data.xquat[b], inner)
            pos[k] += data.xpos[b]
            quat[k] = turn
        return objects, pos, quat

    def _collide(self, qpos: Float[np.ndarray, "nq"]) -> mujoco.MjData:
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self._model, data)
        mujoco.mj_comPos(self._model, data)
        mujoco.mj_collision(self._model, data)
        return data

    def _moving(self, mask: Bool[np.ndarray, "nq"]) -> Bool[np.ndarray, "B"]:
        """Bodies that move when these coordinates do."""
        model = self._model
        moving = np.zeros(model.nbody, bool)
        moving[model.jnt_bodyid[mask[model.jnt_qposadr]]] = True
        for body in range(1, model.nbody):  # parents come before their children
            moving[body] |= moving[model.body_parentid[body]]
        return moving

    def _carriers(self, moving: Bool[np.ndarray, "B"]) -> dict[int, int]:
        """Objects that rest on moving links only, or on others that do; and the link that carries each."""
        contact, tables = self._data.contact, self._tables
        below: dict[int, list[int]] = {}
        for n in np.flatnonzero(contact.dist <= TOUCH_TOLERANCE):
            lower, upper = contact.geom[n]
            up = contact.frame[n, 2]
            if abs(up) < UPRIGHT:
                continue
            if up < 0:
                lower, upper = upper, lower
            owner = int(self._owner[upper])
            if owner >= 0 and owner != self._owner[lower] and self._loose[owner]:
                below.setdefault(owner, []).append(int(self._model.geom_bodyid[lower]))
        found: dict[int, int] = {}
        while True:
            more = {}
            for owner, bodies in below.items():
                carriers = [b if moving[b] else found.get(int(tables.body_object[b])) for b in bodies]
                if owner not in found and all(c is not None for c in carriers):
                    more[owner] = carriers[0]
            if not more:
                return found
            found |= more
