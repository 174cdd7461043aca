"""From the axes of WebXR and OpenXR to those of `PoseFrame`.

Both have x to the right, y up and z backwards, and quaternions x-y-z-w. Their grip space lies in the palm: -z runs
along what the hand holds, from the little finger to the thumb; x is normal to the palm, into it in the right hand and
out of it in the left (OpenXR 1.1, section 6.3.1; WebXR's gripSpace is the same).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ig2mj.agents.humanoid.frames import PALM_CENTER, mirrored
from ig2mj.agents.parts import Vector
from ig2mj.vr.frames import Pose

FROM_XR = Rotation.from_matrix([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Turns vectors of XR's axes into ours: forward x, left y, up z."""

HAND_IN_GRIP = (
    Rotation.from_matrix([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]),
    Rotation.from_matrix([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
)
"""Left, right: the humanoid's hand in the grip. Exact quarter turns; iGibson's numbers for this are degrees that its
code takes for radians."""


def vector_from_xr(vector: Vector) -> np.ndarray:
    """A position, m, or a direction."""
    return FROM_XR.apply(np.asarray(vector, np.float64))


def head_from_xr(pos: Vector, xyzw: Vector) -> Pose:
    """A viewer's pose: looks along its -z there, along its x here."""
    return Pose.of(vector_from_xr(pos), FROM_XR * Rotation.from_quat(xyzw) * FROM_XR.inv())


def hand_from_grip(hand: int, pos: Vector, xyzw: Vector) -> Pose:
    """The humanoid's hand (0 left, 1 right) whose palm lies in the grip."""
    turn = FROM_XR * Rotation.from_quat(xyzw) * HAND_IN_GRIP[hand]
    return Pose.of(vector_from_xr(pos) - turn.apply(mirrored(hand, PALM_CENTER)), turn)
