"""Handing an object from one hand to the other, in the air: how a robot takes it by its other side."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.planning.cleaning_area import cleaning_area, is_covered
from ig2mj.planning.driving import go
from ig2mj.planning.free_floor import NEAR_START
from ig2mj.planning.grasps import grasp_poses
from ig2mj.planning.moves import BELOW, DOWN, RETREAT, UP, Program, ahead, carry, rest, vector3
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.world import PlannedWorld, Rotation, Stance, Vector

IN_FRONT = (0.45, 0.0, 0.45)
"""m, in the body's frame: where an object is handed over."""

ABOVE = 0.15
"""m above it at which the other hand comes to it."""

ROOM, HEADINGS = 0.3, (0.0, np.pi / 2, -np.pi / 2, np.pi)
"""m to spare around a robot that hands something over where it had no room for that, and rad by which it turns."""


def hand_over(world: PlannedWorld, name: str, hand: int) -> Generator[Program, str, str]:
    """The hand turns its palm up, or the side down with which a tool cleans that it holds by its rim, and the other
    takes the object from above; returns the reason why it does not."""
    other, index = 1 - hand, world.index(name)
    yaw = world.base[1]
    front = world.from_body(np.array(IN_FRONT))
    quat = world.body.turned(hand, ahead(yaw), UP)
    area, out = cleaning_area(world, name)
    if area is not None and not is_covered(world, name, hand):
        edge, side = world.grip(hand) - world.com(name), float(np.sign(world.body.carry[hand][1]))
        turned = cleaning_down(out, edge, side * np.array([-np.sin(yaw), np.cos(yaw), 0.0]))
        quat, front = world.turned_hand(hand, turned), front + turned @ edge
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


def hand_over_in_the_open(world: PlannedWorld, name: str, hand: int) -> Generator[Program, str, str]:
    """As `hand_over`; where that fails, and the hand still holds the object, once more where there is room."""
    reason = yield from hand_over(world, name, hand)
    place = roomy(world) if reason and world.held[hand] == name and not world.held[1 - hand] else None
    if place is None:
        return reason
    yield [carry(world, hand, keeps=world.index(name), name=name)]
    if (yield from go(world, place)) or world.held[hand] != name:
        return reason
    return (yield from hand_over(world, name, hand))


def roomy(world: PlannedWorld) -> Stance | None:
    """The nearest place with `ROOM` around the robot and floor ahead, where it does not stand and look now; None: there
    is none."""
    floor, (here, now) = world.floor(), world.base
    far = np.where(floor.spare >= ROOM, floor.distances(here, NEAR_START), np.inf)
    cells = np.argwhere(np.isfinite(far))
    cells = cells[np.argsort(far[tuple(cells.T)], kind="stable")]
    top = np.array(floor.free.shape) - 1
    for x, y in floor.occupancy.middles(cells):
        for turn in HEADINGS:
            elsewhere = np.hypot(x - here[0], y - here[1]) > NEAR_START
            front = np.array([x, y]) + IN_FRONT[0] * ahead(now + turn)[:2]
            cell = np.clip(floor.occupancy.cells(front), 0, top)
            if (elsewhere or turn) and floor.free[tuple(cell)]:
                return Stance((float(x), float(y)), now + turn)
    return None


def cleaning_down(out: Vector, edge: Vector, aside: Vector) -> Rotation:
    """The rotation after which a tool's side that cleans faces down, with the edge that is held to a side.

    Args:
      out: where that side faces now. edge: from the tool's middle to where it is held. aside: level unit vector.
    """
    down = turn_onto(out, DOWN)
    held = down @ edge
    return about_vertical(float(np.arctan2(aside[1], aside[0]) - np.arctan2(held[1], held[0]))) @ down
