"""Frames and constants of the bimanual humanoid: iGibson's BehaviorRobot (behavior_robot.py).

Body frame: x forward, y left, z up, origin in the middle of the body, 0.55 m above the floor.

Hand frame of the right hand: fingers point along -y, the palm's face looks along +z, the thumb is on the -x side. At
rest the fingers point forward and the palm faces down. The left hand is its mirror image in y.
"""

from __future__ import annotations

import numpy as np

from ig2mj.agents.parts import normalized

HANDS = ("left_hand", "right_hand")
"""Order of the hands everywhere."""

FINGERS = ("thumb", "index", "middle", "ring", "pinky")
SEGMENTS = ("proximal", "middle")

BODY_HEIGHT = 0.55
"""m: the body's origin above the floor."""

BODY_Z = (0.0, 2.0)
"""m: limits of the body's height in the world."""

EYE_POS = (0.05, 0.0, 0.4)
"""m, body frame: the eye's rest; its orientation there is the body's."""

HAND_POS = np.array([[0.1, 0.12, 0.05], [0.1, -0.12, 0.05]])
"""m, body frame: rest of left and right hand."""

HAND_QUAT = np.stack([normalized((0.15, 0.7, 0.7, 0.0)), normalized((0.15, -0.7, 0.7, 0.0))])
"""w-x-y-z, body frame."""

SHOULDER_POS = np.array([[-0.15, 0.15, 0.3], [-0.15, -0.15, 0.3]])
NECK_POS = np.array([-0.15, 0.0, 0.3])
"""m, body frame: centres of the spheres that hands and eye are kept in. (iGibson's code swaps these with those of its
body without a tracker; with the swapped ones the eye would be out of reach at rest.)"""

HAND_REACH, EYE_REACH = 1.2, 0.5
"""m: radii of these spheres."""

MAX_MOVE, MAX_TURN = 0.3, 1.0
"""m and rad: the largest step of body, hand or eye in one action."""

FINGER_CLOSED, THUMB_CLOSED = 1.2, 0.6
"""rad at which both joints of a finger, and of the thumb, are closed; open is 0."""

GHOST_DISTANCE = 0.15
"""m between a hand and its target from which its ghost is shown at the target."""

CAMERA_QUAT = (0.5, 0.5, -0.5, -0.5)
"""From the eye's frame (x forward, z up) to MuJoCo's camera frame (-z forward, y up)."""


def mirrored(hand: int, points: np.ndarray | tuple) -> np.ndarray:
    """Points [..., 3] given for the right hand, for hand 0 (left) or 1 (right)."""
    return np.asarray(points, np.float64) * (1.0, 1.0 if hand == 1 else -1.0, 1.0)


PALM_BASE, PALM_CENTER = (0.0, 0.0, 0.015), (0.0, -0.04, 0.01)
"""m, hand frame, right: where rays of assistive grasping start; the second is the grasp point."""

TIP = (0.0, -0.055, 0.025)
THUMB_START = ((-0.012, -0.020, 0.030), (-0.004, -0.008, 0.020))
"""m, right, in the frame of a finger's outer link: the tip; of the thumb's outer link: where rays start.

The frames of links are parallel to the hand's while the hand is open; iGibson's are turned by a quarter about x.
"""
