"""Holding a light container where it stands with one hand while the other moves its lid or puts something into it.

A hand that meets the rim of a jar, or that lifts its lid, throws it over: it is lighter than what the hand presses
with. Held by its side it stays as it is.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.grasps import grasp_poses, main_pieces, ordered
from ig2mj.planning.moves import OPENS, RETREAT, Program, rest, travel, vector3
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.taking import closing_on, way_to
from ig2mj.planning.world import PlannedWorld, Vector

GRAVITY, THROWN, LIGHT = 9.81, 1.8, 1.0
"""m/s2; N at the top of a container up to which it is thrown over by a hand that meets it; kg up to which one is held:
the flap of a backpack swings shut when a hand takes hold of that."""

FOOT, AROUND = 0.02, 16
"""m above a container's lowest point up to which it stands on something; horizontal directions that it may fall to."""

LEVEL = 0.3
"""Vertical part of a palm and of fingers up to which a hand at the side of a container leaves its mouth free."""

POSES = 6
"""Poses that ways are looked for to."""

SLOWLY = 0.02
"""m in an agent step of a hand that goes off what it has held."""

Result = TypeVar("Result")


def is_thrown_over(world: PlannedWorld, name: str) -> bool:
    """Whether a container is to be held while the other hand is at it: it is loose, falls over easily, and the robot
    has another hand, which floats."""
    if world.body.opening is not None or len(world.body.hands) < 2 or not name:
        return False
    domain = world.domain
    if domain.fixed(name) or not domain.graspable(name) or world.mass(name) > LIGHT:
        return False
    trunk, centre = world.vertices_of_pieces(main_pieces(domain.model.tables, world.index(name))), world.com(name)
    low, high = float(trunk[:, 2].min()), float(trunk[:, 2].max())
    angles = np.arange(AROUND) * (2 * np.pi / AROUND)
    sides = np.stack([np.cos(angles), np.sin(angles)])
    foot = trunk[trunk[:, 2] < low + FOOT][:, :2] - centre[:2]
    lever = max(float((foot @ sides).max(0).min()), 0.0)
    return world.mass(name) * GRAVITY * lever / max(high - low, FOOT) < THROWN


def steadied(
    world: PlannedWorld, name: str, hand: int, action: Generator[Program, str, Result]
) -> Generator[Program, str, Result]:
    """Does something with a hand while the other holds a container where it stands, if that is thrown over otherwise
    and the other hand is free and has a way to its side."""
    way = None
    if is_thrown_over(world, name) and not world.held[1 - hand] and name not in world.held:
        way = yield from _hold(world, name, 1 - hand)
    result = yield from action
    if way is not None:
        yield from _let_go(world, name, 1 - hand, way)
    return result


def past_hand(world: PlannedWorld, obstacles: Obstacles, hand: int) -> Obstacles:
    """The same with one of the robot's hands as it is, and with what it holds, but for a container that stands."""
    name = world.held[hand]
    spheres = world.spheres(*world.hand_axes(hand), holding="" if is_thrown_over(world, name) else name, hand=hand)
    return obstacles.with_carried(spheres + np.array([*world.grip(hand), 0.0]))


def _hold(world: PlannedWorld, name: str, hand: int) -> Generator[Program, str, list[Vector] | None]:
    """The hand takes hold of a container by its side, and keeps it where it stands; returns the way that it came; None:
    it does not hold it."""
    obstacles = past_hand(world, world.obstacles([name]), 1 - hand)
    poses = grasp_poses(world, name, obstacles)
    poses = [p for p in poses if abs(p.palm[2]) < LEVEL and world.reaches(hand, world.stance, p.at(p.before))]
    across = [p for p in poses if abs(p.fingers[2]) < LEVEL]
    for pose in ordered(across or poses, world.stance.yaw, False)[:POSES]:
        if (way := way_to(world, name, hand, pose, obstacles)) is None:
            continue
        stood = world.pose(name)
        yield closing_on(world, name, hand, pose, way, slowly=True)
        if world.held[hand] == name:
            yield [_put_back(world, name, hand, *stood)]
            return [*way[-2::-1]]
        yield _off(world, hand, [*way[-2::-1]])
        return None
    return None


def _put_back(world: PlannedWorld, name: str, hand: int, pos: Vector, quat: Float[np.ndarray, "4"]) -> Phase:
    """A hand brings a container that it has pushed and tilted as it took it to where it stood before."""
    now, frame = world.pose(name)[0], matrices_on_host(world.pose(name)[1][None])[0]
    turn = matrices_on_host(quat[None])[0] @ frame.T
    there = vector3(pos + turn @ (world.grip(hand) - now))
    turned = world.turned_hand(hand, turn)
    return Phase(
        hand=hand, pos=there, quat=turned, tolerance=0.004, turn_tolerance=0.02, limit=20, after="", speed=SLOWLY
    )


def _let_go(world: PlannedWorld, name: str, hand: int, way: Sequence[Vector]) -> Generator[Program, str, None]:
    if world.held[hand] == name:
        yield [
            Phase(hand=hand, close=False, until=Until.EMPTY, limit=10),
            Phase(hand=hand, close=False, until=Until.WAITED, limit=OPENS),
        ]
    yield _off(world, hand, way)


def _off(world: PlannedWorld, hand: int, way: Sequence[Vector]) -> Program:
    back = vector3(world.grip(hand) - RETREAT * world.hand_axes(hand)[1])
    return [
        Phase(hand=hand, close=False, pos=back, tolerance=0.03, limit=20, after="", speed=SLOWLY),
        *travel(hand, way, None),
        *rest(hand),
    ]
