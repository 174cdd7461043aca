"""Handing an object from one hand to the other, in the air: how a robot takes it by its other side."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ig2mj.planning.grasps import grasp_poses
from ig2mj.planning.moves import BELOW, DOWN, RETREAT, UP, Program, ahead, carry, rest, vector3
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.world import PlannedWorld

IN_FRONT = (0.45, 0.0, 0.45)
"""m, in the body's frame: where an object is handed over."""

ABOVE = 0.15
"""m above it at which the other hand comes to it."""


def hand_over(world: PlannedWorld, name: str, hand: int) -> Generator[Program, str, str]:
    """The hand turns its palm up, and the other takes the object from above; returns the reason why it does not."""
    other, index = 1 - hand, world.index(name)
    yaw = world.base[1]
    front = world.from_body(np.array(IN_FRONT))
    quat = world.body.turned(hand, ahead(yaw), UP)
    reason = yield [
        Phase(hand=hand, pos=vector3(front), quat=quat, keeps=index, tolerance=0.03, turn_tolerance=0.1, limit=60)
    ]
    if reason:
        return reason
    poses = [p for p in grasp_poses(world, name, world.obstacles([name])) if p.palm @ DOWN > 0.9]
    if not poses:
        return "no_grasp"
    centre = world.com(name)
    pose = min(poses, key=lambda p: float(np.linalg.norm(p.point - centre)) - 0.1 * float(p.fingers @ ahead(yaw)))
    quat, deep, onto = world.body.turned(other, pose.fingers, pose.palm), vector3(pose.at(-BELOW)), vector3(pose.point)
    reason = yield [
        Phase(hand=other, pos=vector3(pose.at(ABOVE)), quat=quat, tolerance=0.03, limit=60, after=""),
        Phase(hand=other, pos=onto, quat=quat, close=False, tolerance=0.012, limit=20, after="", speed=0.03),
        Phase(hand=other, pos=deep, until=Until.HELD, object=index, close=True, limit=15, after="no_grasp", speed=0.02),
        Phase(hand=hand, close=False, until=Until.EMPTY, limit=15),
        Phase(hand=hand, pos=vector3(world.grip(hand) + RETREAT * DOWN), tolerance=0.04, limit=15, after=""),
        *rest(hand),
        carry(world, other, keeps=index, name=name),
    ]  # fmt: skip
    if world.held[other] == name:
        return ""
    yield rest(other)
    return reason or "slipped"
