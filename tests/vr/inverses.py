"""Inverses of what devices give: the poses that a device would report for a head and a hand."""

from __future__ import annotations

import numpy as np

from ig2mj.agents.humanoid.frames import PALM_CENTER, mirrored
from ig2mj.vr.frames import Pose
from ig2mj.vr.xr_axes import FROM_XR, HAND_IN_GRIP


def to_xr(pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Position and x-y-z-w of a head in XR's axes: the inverse of `head_from_xr`."""
    return FROM_XR.inv().apply(pose.pos), (FROM_XR.inv() * pose.turn * FROM_XR).as_quat()


def grip_of_hand(hand: int, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """Position and x-y-z-w of the grip that a hand lies in: the inverse of `hand_from_grip`."""
    palm = pose.pos + pose.turn.apply(mirrored(hand, PALM_CENTER))
    return FROM_XR.inv().apply(palm), (FROM_XR.inv() * pose.turn * HAND_IN_GRIP[hand].inv()).as_quat()
