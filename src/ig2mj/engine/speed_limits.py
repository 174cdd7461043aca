"""Limits of how fast objects may move and turn, applied after each physics step.

Physics steps of 1/120 s cannot resolve contacts of what turns by half a radian in one: a thin object then gains energy
with each and is thrown, at hundreds of metres a second, until its speed is no number. Limits after each control step
are too late: what is pressed against a pan or a wall is at 20 to 30 m/s within its four physics steps. Other engines
have such limits: Bullet's is a quarter of a turn in a step, PhysX's 100 rad/s by default. Robots have none here, since
their servos have their own. What moves faster than `guards.TOP_SPEED` is flagged as before. `docs/notes/lost.md`.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.engine.view import Array

TOP_LINEAR, TOP_ANGULAR = 30.0, 60.0
"""m/s and rad/s, of free bodies and of joints: half again what a world is flagged at, and half a radian in a step."""

_JOINT = mujoco.mjtJoint
_PARTS = {
    _JOINT.mjJNT_FREE: ((3, TOP_LINEAR), (3, TOP_ANGULAR)),
    _JOINT.mjJNT_BALL: ((3, TOP_ANGULAR),),
    _JOINT.mjJNT_SLIDE: ((1, TOP_LINEAR),),
    _JOINT.mjJNT_HINGE: ((1, TOP_ANGULAR),),
}


class SpeedLimits:
    """The limits of a scene's objects. `body_agent`: the agent of each body, -1: none."""

    def __init__(self, model: mujoco.MjModel, body_agent: Int[np.ndarray, "B"]):
        members, limits = [], []  # of each vector: three degrees of freedom (`nv`: none), and its limit
        group = np.zeros(model.nv, int)
        for joint in range(model.njnt):
            first = int(model.jnt_dofadr[joint])
            if body_agent[model.jnt_bodyid[joint]] >= 0:
                continue
            for count, limit in _PARTS[_JOINT(int(model.jnt_type[joint]))]:
                group[first : first + count] = len(members) + 1
                members.append([*range(first, first + count), *[model.nv] * (3 - count)])
                limits.append(limit)
                first += count
        self._members = np.array(members, int).reshape(-1, 3)
        self._limits = np.array(limits)
        self._group = group  # of each degree of freedom, from 1; 0: an agent's, without a limit

    def hold(self, qvel: Float[np.ndarray, "nv"]) -> None:
        """Limits speeds in place; quick where none can be beyond its limit. Speeds that MuJoCo
        takes for no numbers stay as they are, for it to say so in its next step."""
        if min(TOP_LINEAR, TOP_ANGULAR) ** 2 < qvel.dot(qvel) < mujoco.mjMAXVAL**2:
            qvel[:] = self.limited(qvel)

    def limited(self, qvel: Float[Array, "*W nv"]) -> Float[Array, "*W nv"]:
        """Speeds within their limits, each in its direction. What is slower stays as it is, to the bit."""
        xp: Any = np if isinstance(qvel, np.ndarray) else jnp
        if not len(self._limits):
            return qvel
        padded = xp.concatenate([qvel, xp.zeros_like(qvel[..., :1])], -1)
        speed = xp.sqrt(xp.square(padded[..., self._members]).sum(-1))
        limits = self._limits.astype(qvel.dtype)
        share = xp.where(speed > limits, limits / xp.maximum(speed, limits), 1.0)
        share = xp.concatenate([xp.ones_like(share[..., :1]), share], -1)
        return qvel * share[..., self._group].astype(qvel.dtype)
