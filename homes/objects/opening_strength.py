"""A hand of limited strength opens joints in MuJoCo: how far it gets, and whether what it opened stays there."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

STRENGTH = {mujoco.mjtJoint.mjJNT_SLIDE: 20.0, mujoco.mjtJoint.mjJNT_HINGE: 5.0}  # N, N m
SPEED = {mujoco.mjtJoint.mjJNT_SLIDE: 0.4, mujoco.mjtJoint.mjJNT_HINGE: 1.2}  # m/s, rad/s
PATIENCE = 6.0  # s that the hand pushes
URGE = 0.5  # s of standing still after which it pushes with all its strength
WAIT = 1.0  # s after it let go


@dataclasses.dataclass(frozen=True)
class Opened:
    """Shares of a joint's range, 0 closed and 1 open.

    Attributes:
      reached: where the hand got to. stayed: where the joint is a while after it let go there.
      half: where it let go half-way; half_stayed: where the joint is a while after that.
      met: bodies of others that the moving part touched when it got no farther.
    """

    joint: str
    reached: float
    stayed: float
    half: float
    half_stayed: float
    met: tuple[str, ...] = ()

    @property
    def works(self) -> bool:
        """It opened all the way, and stayed where it was left, open and half-way."""
        return self.reached > 0.97 and self.stayed > 0.95 and abs(self.half_stayed - self.half) < 0.05


def open_joint(model: mujoco.MjModel, joint: str, closed: float, opened: float) -> Opened:
    """Opens one joint from the model's first keyframe (or its initial state), with everything else as it is there.

    The hand pushes with no more than 20 N or 5 N m, at a walking pace; a loose object is held where it lies.

    Args:
      closed, opened: the joint's positions, metres or radians.
    """
    index = model.joint(joint).id
    hand = _Hand(model, index, closed, opened)
    half = hand.push(0.5)
    hand.wait()
    half_stayed = hand.share
    reached = hand.push(0.99)
    met = hand.met() if reached <= 0.97 else ()
    hand.wait()
    return Opened(joint, reached, hand.share, half, half_stayed, met)


class _Hand:
    def __init__(self, model: mujoco.MjModel, joint: int, closed: float, opened: float):
        self.model, self.joint = model, joint
        self.data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, self.data, 0)
        mujoco.mj_forward(model, self.data)
        self.closed, self.span = closed, opened - closed
        self.q, self.v = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        self.body = int(model.jnt_bodyid[joint])
        root = int(model.body_rootid[self.body])
        first = int(model.body_jntadr[root])
        loose = first >= 0 and model.jnt_type[first] == mujoco.mjtJoint.mjJNT_FREE
        self.held = (int(model.jnt_qposadr[first]), int(model.jnt_dofadr[first])) if loose else None
        self.start = self.data.qpos.copy()

    @property
    def share(self) -> float:
        return float((self.data.qpos[self.q] - self.closed) / self.span)

    def push(self, goal: float) -> float:
        """Moves the joint to a share of its range, if it can; where it got to."""
        model, data, v = self.model, self.data, self.v
        kind = mujoco.mjtJoint(int(model.jnt_type[self.joint]))
        sign, step = float(np.sign(self.span)), model.opt.timestep
        inertia = float(model.dof_M0[v])
        urge = 0.0
        for _ in range(round(PATIENCE / step)):
            pace = SPEED[kind] - sign * data.qvel[v]
            urge = float(np.clip(urge + pace / SPEED[kind] * step / URGE, 0.0, 1.0))
            force = inertia * pace / (5 * step) + sign * data.qfrc_bias[v] + model.dof_frictionloss[v]
            data.qfrc_applied[v] = sign * np.clip(force + urge * STRENGTH[kind], 0.0, STRENGTH[kind])
            self._step()
            if self.share > goal:
                break
        return self.share

    def wait(self) -> None:
        """Lets go and waits."""
        self.data.qfrc_applied[self.v] = 0.0
        self.data.qvel[self.v] = 0.0
        for _ in range(round(WAIT / self.model.opt.timestep)):
            self._step()

    def _step(self) -> None:
        mujoco.mj_step(self.model, self.data)
        if self.held is not None:
            q, v = self.held
            self.data.qpos[q : q + 7] = self.start[q : q + 7]
            self.data.qvel[v : v + 6] = 0.0

    def met(self) -> tuple[str, ...]:
        """Names of bodies of other objects that touch what the joint moves."""
        found = set()
        for geoms in self.data.contact.geom[self.data.contact.dist < 0]:
            bodies = [int(self.model.geom_bodyid[g]) for g in geoms]
            moved = [self._is_moved(body) for body in bodies]
            if moved[0] != moved[1]:
                found.add(self.model.body(bodies[moved[0]]).name)
        return tuple(sorted(found))

    def _is_moved(self, body: int) -> bool:
        while body > self.body:
            body = int(self.model.body_parentid[body])
        return body == self.body
