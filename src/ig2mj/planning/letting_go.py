"""How a hand brings what it holds to a spot, lets it go there, and goes back."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.planning.clearance import HELD, Obstacles, straight
from ig2mj.planning.moves import (
    LET_GO,
    OPENS,
    RETREAT,
    TOUCHES,
    UP,
    Program,
    ahead,
    hand_path,
    quaternion,
    rest,
    travel,
    turn_at,
    turning_point,
    vector3,
)
from ig2mj.planning.opening import way_off
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.spots import Spot, grip_for
from ig2mj.planning.steadying import is_thrown_over, past_hand
from ig2mj.planning.world import PlannedWorld, Vector

SPARE = 0.03
"""m before its place from which on an object may touch what is around."""

FALLING = 15
"""Agent steps that an object falls which does not stand or lie where it is let go."""

CLOSER = 0.005
"""m by which a hand that is drawn back may come closer to what is around than it is."""


Letting = tuple[Vector, list[Vector], Vector, Sequence[float] | np.ndarray, Vector]
"""Where a hand turns what it holds, its way from there, where it lets go, its orientation there, and where it goes back
to then."""


def letting_go(
    world: PlannedWorld, name: str, hand: int, planned: Letting, falls: bool
) -> Generator[Program, str, str]:
    """A hand brings what it holds where it lets it go, from where the robot stands, and goes back; returns why it did
    not. Where what it has let go is in its way back, as the pocket of a bag above it, it first goes off that.

    Args:
      falls: it does not stand or lie there by itself.
    """
    start, way, target, quat, back = planned
    keeps, turned = world.index(name), quaternion(quat)
    waits = Phase(until=Until.WAITED, limit=FALLING if falls else 6)
    reason = yield [
        *turn_at(world, hand, start, turned, keeps),
        *travel(hand, way, turned, keeps=keeps),
        Phase(hand=hand, pos=vector3(target), quat=turned, keeps=keeps, tolerance=0.015, turn_tolerance=0.1, limit=20,
              after="", speed=0.03),
        Phase(hand=hand, close=False, until=Until.EMPTY, limit=10),
        Phase(hand=hand, close=False, until=Until.WAITED, limit=OPENS),
        Phase(hand=hand, pos=vector3(back), tolerance=0.04, limit=15, after=""),
    ]  # fmt: skip
    if reason:
        return reason
    returns = [*way[-2::-1], start]
    if world.body.opening is None and is_caught(world, name, hand, returns):
        off = way_off(world, hand, among_walls=True)
        if off:
            return (yield [*off, waits])
    return (yield [*travel(hand, returns, None), *rest(hand), waits])


def is_caught(world: PlannedWorld, name: str, hand: int, way: Sequence[Vector]) -> bool:
    """Whether an object that a hand has let go is in the hand's way."""
    own, grip = world.only(world.index(name)), world.grip(hand)
    spheres = world.spheres(*world.hand_axes(hand)) * (1.0, 1.0, 1.0, TOUCHES)
    spheres = spheres[own.distance(spheres[:, :3] + grip) > spheres[:, 3]]
    return not all(straight(own, spheres, a, b) for a, b in itertools.pairwise([grip, *way]))


def way_to_spot(world: PlannedWorld, name: str, hand: int, spot: Spot) -> Letting | None:
    """How a hand brings what it holds to a spot from where the robot stands; None: it has no way."""
    _, yaw = world.base
    target, quat, rotation = grip_for(world, hand, name, spot)
    fingers, palm = world.hand_axes(hand, rotation)
    target = target + (LET_GO + spot.drop) * UP
    spheres = spheres_at(world, name, hand, spot)
    obstacles = world.obstacles([name], world.stance)
    if (other := 1 - hand) < len(world.held) and is_thrown_over(world, world.held[other]):  # which holds the container
        obstacles = past_hand(world, obstacles, other)
    start = turning_point(obstacles, spheres, world.grip(hand), yaw)
    follows = world.follows(hand, quat, obstacles)
    way = hand_path(obstacles, spheres, start, target, entries_to(spot, yaw), SPARE, True, follows, turns=True)
    if way is None:
        return None
    return start, way, target, quat, drawn_back(obstacles, world.spheres(fingers, palm), target, palm)


def entries_to(spot: Spot, yaw: float) -> list[Vector]:
    """Directions from which a hand of a robot that looks along `yaw` (rad) may come to a spot with what it holds: from
    above, from the robot, and past the sides that look to the robot of what the spot is under."""
    back = -ahead(yaw)
    return [UP, back, *(out for out in spot.outs if out @ back > 0.0)]


def spheres_at(world: PlannedWorld, name: str, hand: int, spot: Spot) -> Float[np.ndarray, "S 4"]:
    """Spheres of a hand with an object, about its grasp point, with the object turned as it would be at a spot."""
    _, _, rotation = grip_for(world, hand, name, spot)
    found = world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)
    return np.where((found[:, 3:] < HELD) & spot.tight, found * (1.0, 1.0, 1.0, TOUCHES), found)


def drawn_back(obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"], target: Vector, palm: Vector) -> Vector:
    """Where a hand that has let go at `target` is drawn back to, off what it held: where it stays itself if it has less
    room behind, as between the sides of a container, which it would press what it held against.

    Args:
      spheres: of the hand alone.
    """

    def room(point: Vector) -> float:
        return float((obstacles.distance(spheres[:, :3] + point) - spheres[:, 3]).min())

    least = min(room(target), 0.0) - CLOSER
    backs = (target - share * RETREAT * palm for share in (1.0, 0.5, 0.25))
    return next((back for back in backs if room(back) > least), target)
