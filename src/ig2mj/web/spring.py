"""Objects dragged by a spring from a point of theirs to the pointer: the spring of the window's mouse, for pages.

Pages say only now and then where the pointer is, so that a spring that is stretched far pulls on instead of letting go,
and it feels the mass that moves with the point: a light stick held at its end does not shake.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.viewer.mouse import RATE, limited, moment


@dataclasses.dataclass
class Drag:
    """A spring between a body and a point of the world.

    Attributes:
      body: MuJoCo id. point: in the body's frame, metres. target: world frame. mass: that the spring feels, kg.
    """

    body: int
    point: Float[np.ndarray, "3"]
    target: Float[np.ndarray, "3"]
    mass: float = 0.0


def grabbed_at(data: mujoco.MjData, drag: Drag) -> Float[np.ndarray, "3"]:
    """Where the point is now, world frame."""
    return data.xpos[drag.body] + data.xmat[drag.body].reshape(3, 3) @ drag.point


def felt_mass(model: mujoco.MjModel, data: mujoco.MjData, body: int, point: Float[np.ndarray, "3"]) -> float:
    """Kilograms: the least that moves when the point (world frame) is pulled, from the inertias at the joints' zero."""
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, jacobian, None, point, body)
    inverse = (jacobian / np.maximum(model.dof_M0, 1e-9)) @ jacobian.T
    largest = float(np.linalg.eigvalsh(inverse)[-1])
    return 1.0 / largest if largest > 1e-9 else 0.0


def carried(model: mujoco.MjModel, body: int) -> Float[np.ndarray, "3"]:
    """The weight of what hangs on a free joint, newtons: else objects would hang below the pointer."""
    root = int(model.body_rootid[body])
    joint = int(model.body_jntadr[root])
    if joint < 0 or model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
        return np.zeros(3)
    return float(model.body_subtreemass[root]) * np.array(model.opt.gravity)


def pull(model: mujoco.MjModel, data: mujoco.MjData, drag: Drag) -> None:
    """Puts the spring's force on the body, at most the mouse's 100 N, until it is changed or released."""
    at = grabbed_at(data, drag)
    if drag.mass <= 0:
        drag.mass = felt_mass(model, data, drag.body, at)
    both = np.zeros(6)
    mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, drag.body, both, 0)
    velocity = both[3:] + np.cross(both[:3], at - data.xpos[drag.body])
    force = drag.mass * RATE * (RATE * (drag.target - at) - 2 * velocity) - carried(model, drag.body)
    force = limited(force) if np.isfinite(force).all() else np.zeros(3)
    data.xfrc_applied[drag.body] = moment(force, at, data.xipos[drag.body])


def release(data: mujoco.MjData, drag: Drag) -> None:
    """Takes the force away."""
    data.xfrc_applied[drag.body] = 0
