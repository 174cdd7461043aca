"""Moving the play area: by sticks, and to where the robot stands (iGibson's VR interface).

This runs with the devices, never with physics, so that a person who walks by the stick sees the home move at once.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ig2mj.agents.humanoid.frames import EYE_POS
from ig2mj.vr.frames import PlayArea, Pose, PoseFrame
from ig2mj.vr.mapping import heading

SPEED = 0.6
"""m/s of a stick that is pushed all the way: 0.02 m in each of iGibson's 30 frames a second."""

LIFT_SPEED = 0.3
"""m/s upwards: 0.01 m in each frame."""

HEIGHTS = (0.0, 1.8)
"""m by which the floor of the play area may be above the home's."""

LIFT_FROM, TURN_FROM, REST_BELOW = 0.7, 0.7, 0.3
"""Where the other stick begins to lift and to turn, and where it is back."""

DEAD = 0.12
"""Sticks below this are at rest."""

TURN = math.radians(30.0)
"""A turn by the stick: in one step, since a smooth one makes many people sick. iGibson's has none."""

LONGEST = 0.1
"""s of a step at most: after a pause, people do not fly through the home."""


def moved(area: PlayArea, frame: PoseFrame, seconds: float) -> PlayArea:
    """The play area after `seconds` of what the sticks say. Pure.

    The left one walks where the head faces; the right one lifts and lowers, and turns about the head.
    """
    seconds = min(max(seconds, 0.0), LONGEST)
    (side, forward), (turn, lift) = (hand.stick for hand in frame.hands)
    if frame.head is not None and (size := math.hypot(side, forward)) > DEAD:
        yaw = heading(area.pose * frame.head)
        if yaw is not None:
            step = SPEED * seconds * min(size, 1.0) / size
            dx = step * (forward * math.cos(yaw) + side * math.sin(yaw))
            dy = step * (forward * math.sin(yaw) - side * math.cos(yaw))
            area = dataclasses.replace(area, x=area.x + dx, y=area.y + dy)
    if abs(lift) > LIFT_FROM:
        z = area.z + math.copysign(LIFT_SPEED * seconds, lift)
        area = dataclasses.replace(area, z=float(np.clip(z, *HEIGHTS)))
    if abs(turn) > TURN_FROM and not area.turning and frame.head is not None:
        area = dataclasses.replace(_turned(area, frame.head, -math.copysign(TURN, turn)), turning=True)
    elif abs(turn) < REST_BELOW and area.turning:
        area = dataclasses.replace(area, turning=False)
    return area


def brought_to(area: PlayArea, head: Pose, body: Pose) -> PlayArea:
    """The play area in which a head is above a robot's body and faces as it does; its height stays. Pure.

    Args:
      head: in the play area. body: in the world.
    """
    forward = body.turn.apply((1.0, 0.0, 0.0))
    faced = heading(area.pose * head)
    requested = math.atan2(forward[1], forward[0])
    area = _turned(area, head, requested - (requested if faced is None else faced))
    eye = body.pos + np.array([math.cos(requested), math.sin(requested), 0.0]) * EYE_POS[0]
    now = (area.pose * head).pos
    return dataclasses.replace(area, x=area.x + float(eye[0] - now[0]), y=area.y + float(eye[1] - now[1]))


def _turned(area: PlayArea, head: Pose, angle: float) -> PlayArea:
    """Turned about the head."""
    before = (area.pose * head).pos
    area = dataclasses.replace(area, yaw=math.remainder(area.yaw + angle, math.tau))
    after = (area.pose * head).pos
    return dataclasses.replace(area, x=area.x + float(before[0] - after[0]), y=area.y + float(before[1] - after[1]))
