"""What the mouse does to objects, as in iGibson's viewer.

An object that was picked (double-click) is dragged by a spring from the point that was clicked to where the mouse is
(Ctrl and the right button), with at most 100 N; a spring that is stretched too far lets go. A push is along the line of
sight. Ctrl and the left button turn the object, as MuJoCo does.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

MAX_FORCE = 100.0
"""N: iGibson's."""

LET_GO = 1.0
"""m between the point and the mouse at which the spring lets go. (iGibson's 0.2 m are of a rigid constraint.)"""

RATE = 12.0
"""1/s: natural frequency of the critically damped spring with an object at its end."""

PUSH_TIME = 0.1
"""Seconds for which a push lasts."""


def spring(
    anchor: Float[np.ndarray, "3"],
    velocity: Float[np.ndarray, "3"],
    target: Float[np.ndarray, "3"],
    mass: float,
    weight: float = 0.0,
) -> Float[np.ndarray, "3"] | None:
    """Force, N, on the point of an object that was clicked; None where the spring lets go.

    Args:
      anchor, velocity: of the point, world frame, m and m/s. target: where the mouse is.
      mass: kg of what is dragged. weight: N that the spring carries in addition.
    """
    offset = np.asarray(target, float) - anchor
    if np.linalg.norm(offset) > LET_GO:
        return None
    force = mass * (RATE**2 * offset - 2 * RATE * np.asarray(velocity, float)) + np.array([0.0, 0.0, weight])
    return limited(force)


def push(sight: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Force of a push, N, along a line of sight of any length but 0."""
    return MAX_FORCE * np.asarray(sight, float) / np.linalg.norm(sight)


def limited(force: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """The force, no larger than `MAX_FORCE`."""
    size = float(np.linalg.norm(force))
    return force if size <= MAX_FORCE else force * (MAX_FORCE / size)


def moment(force: Float[np.ndarray, "3"], point: Float[np.ndarray, "3"], com: Float[np.ndarray, "3"]) -> np.ndarray:
    """Force and torque [6] about a centre of mass of a force at a point; MuJoCo's `xfrc_applied`."""
    return np.concatenate([force, np.cross(np.asarray(point, float) - com, force)])


class Mouse:
    """The forces of the mouse on one world; `apply` before every control step."""

    def __init__(self) -> None:
        self._held, self._pushes, self._lost = 0, 0, False

    def push(self, step_time: float) -> None:
        """Pushes what is picked for `PUSH_TIME`. `step_time`: s of a control step."""
        self._pushes = max(1, round(PUSH_TIME / step_time))

    def apply(
        self, model: mujoco.MjModel, data: mujoco.MjData, perturb: mujoco.MjvPerturb, sight: Float[np.ndarray, "3"]
    ) -> None:
        """Puts the present forces on the bodies of `data`, and takes away those of before.

        Args:
          perturb: what is picked and where the mouse is. sight: direction in which the camera looks, world frame.
        """
        if self._held:
            data.xfrc_applied[self._held], self._held = 0.0, 0
        body, dragging = int(perturb.select), bool(perturb.active)
        self._lost &= dragging
        if not 0 < body < model.nbody:  # decoration is behind the scene's own bodies
            self._pushes = 0
            return
        point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ perturb.localpos
        force = np.zeros(3)
        if self._pushes:
            self._pushes -= 1
            force = push(sight)
        elif dragging and perturb.active & int(mujoco.mjtPertBit.mjPERT_TRANSLATE):
            pulled = None if self._lost else self._pull(model, data, perturb, point)
            self._lost = pulled is None
            force = np.zeros(3) if pulled is None else pulled
        elif dragging:
            mujoco.mjv_applyPerturbPose(model, data, perturb, 0)
            mujoco.mjv_applyPerturbForce(model, data, perturb)
            self._held = body
            return
        if force.any():
            data.xfrc_applied[body], self._held = moment(force, point, data.xipos[body]), body

    def _pull(
        self, model: mujoco.MjModel, data: mujoco.MjData, perturb: mujoco.MjvPerturb, point: np.ndarray
    ) -> np.ndarray | None:
        body, motion = int(perturb.select), np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, motion, 0)
        velocity = motion[3:] + np.cross(motion[:3], point - data.xpos[body])
        joint = int(model.body_jntadr[body])
        free = joint >= 0 and model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
        mass = float(model.body_subtreemass[body])
        weight = -mass * float(model.opt.gravity[2]) if free else 0.0
        return spring(point, velocity, perturb.refselpos, mass, weight)
