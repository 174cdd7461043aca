"""Ways of what a hand has just taken to where it is carried: along the hand's own way, where that has room for it, else
around what is in the way. What stands below something that it cannot pass, such as a carton below the keyboard of a
piano, is drawn out first: the base goes back with it just above the floor.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Generator, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.planning.clearance import straight
from ig2mj.planning.driving import FAR_BACK_STEPS, shift
from ig2mj.planning.moves import TOUCHES, Program, ahead, as_close, hand_path, quaternion, travel, vector3, way_home
from ig2mj.planning.occupancy import RESOLUTION
from ig2mj.planning.phases import Phase
from ig2mj.planning.world import HELD_MARGIN, PlannedWorld, Stance, Vector

FARTHEST, STEP = 1.2, 0.15
"""m that the base goes back at most, and between the places at which the hand may have a way."""

ASIDE = (0.0, np.pi / 4, -np.pi / 4, np.pi / 2, -np.pi / 2)
"""rad from straight back in which the base goes."""


def has_room(world: PlannedWorld, name: str, hand: int, points: Sequence[Vector]) -> bool:
    """Whether what a hand holds keeps clear along points of the hand's way, as it is turned now; what it touches where
    it is does not count there."""
    obstacles, held = world.obstacles([name]), _held(world, name, hand)
    return all(straight(obstacles, held, a, b) for a, b in itertools.pairwise([world.grip(hand), *points]))


def led_out(
    world: PlannedWorld, name: str, hand: int, ends: Sequence[Vector], carries: Phase
) -> Generator[Program, str, str | None]:
    """A hand on an arm brings what it holds to where it carries that, past the robot's own base and what is around.
    Returns why it did not, "" where it did; None: its own way has room, or there is no other.

    Args:
      ends: points of its own way. carries: the phase in which the hand goes to where it carries.
    """
    obstacles, grip = world.obstacles([name], world.stance), world.grip(hand)
    held = _as_close_as_now(world, name, hand, TOUCHES)
    if all(straight(obstacles, held, a, b) for a, b in itertools.pairwise([grip, *ends])):
        return None
    program = _around(world, name, hand, carries)
    if program is None:
        there = _back_to_room(world, name, hand)
        if there is None:
            return None
        level = vector3(about_vertical(-world.stance.yaw) @ (grip - world.from_body(np.zeros(3))))
        goes = shift(there, carries.keeps, within=FAR_BACK_STEPS)
        if reason := (yield [dataclasses.replace(goes, hand=hand, pos=level, in_body=True)]):
            return reason
        program = _around(world, name, hand, carries) or [carries]
    return (yield program)


def _around(world: PlannedWorld, name: str, hand: int, carries: Phase) -> Program | None:
    """The way of a hand on an arm to where it carries what it holds, from where the robot stands; None: none is
    found."""
    quat, grip, goal = quaternion(world.hand_quat(hand)), world.grip(hand), world.carried(hand, world.stance)
    obstacles = world.obstacles([name], world.stance)
    follows = world.follows(hand, quat, obstacles)
    for share in (1.0, TOUCHES):
        held = _as_close_as_now(world, name, hand, share)
        way = hand_path(obstacles, held, grip, goal, search=share < 1.0, follows=follows, strays=True)
        if way is not None:
            return [*travel(hand, way, quat, keeps=carries.keeps), carries]
    return None


def _back_to_room(world: PlannedWorld, name: str, hand: int) -> Stance | None:
    """The nearest stance behind the robot from which a hand has room to where it carries what it holds, and on to
    which the base goes a little farther; None: there is none."""
    behind, grip, goal = _back(world, name, hand, (0.0,)), world.grip(hand), world.carried(hand, world.stance)
    for share in (1.0, TOUCHES):
        held = _as_close_as_now(world, name, hand, share)
        for number, there in enumerate(behind):
            off = np.array([*np.subtract(there.xy, world.stance.xy), 0.0])
            if hand_path(world.obstacles([name], there), held, grip + off, goal + off) is not None:
                return behind[min(number + 1, len(behind) - 1)]
    return None


def _as_close_as_now(world: PlannedWorld, name: str, hand: int, share: float) -> Float[np.ndarray, "n 4"]:
    """Points of what a hand holds about its grasp point, with a share of their radii, which may be as close to what is
    around as they are now."""
    points, grip = world.points(name) - world.grip(hand), world.grip(hand)
    spheres = np.column_stack([points, np.full(len(points), share * HELD_MARGIN)])
    return as_close(world.obstacles([name], world.stance), spheres, grip)


def drawn_out(world: PlannedWorld, name: str, hand: int, carries: Phase) -> Program | None:
    """The way of a floating hand to where it carries what it holds; None: none is found.

    Args:
      carries: the phase in which the hand goes there.
    """
    way = way_home(world, hand, name, np.zeros(3))
    if way is not None:
        return [*travel(hand, way, None, keeps=carries.keeps), carries]
    for there in _back(world, name, hand):
        moved = np.array([*np.subtract(there.xy, world.stance.xy), 0.0])
        way = way_home(world, hand, name, moved)
        if way is not None:
            goes = shift(there, keeps=carries.keeps)
            return [goes, *travel(hand, way, None, keeps=carries.keeps), carries]
    return None


def _back(world: PlannedWorld, name: str, hand: int, aside: Sequence[float] = ASIDE) -> list[Stance]:
    """Stances to which the base can go straight with what a hand holds where it is, the nearest first.

    Args:
      aside: rad from straight back in which it goes.
    """
    floor, stance, grip = world.floor(), world.stance, world.grip(hand)
    obstacles, held = world.obstacles([name]), _held(world, name, hand)
    here, found, blocked = np.array(stance.xy), list[Stance](), set[float]()
    for apart in np.arange(STEP, FARTHEST + STEP / 2, STEP):
        for turn in aside:
            way = -about_vertical(turn) @ ahead(stance.yaw)
            x, y = here + apart * way[:2]
            free = floor.nearest((float(x), float(y)), RESOLUTION) is not None
            if turn in blocked or not free or not straight(obstacles, held, grip, grip + apart * way):
                blocked.add(turn)
                continue
            found.append(Stance((float(x), float(y)), stance.yaw, stance.rise))
    return found


def _held(world: PlannedWorld, name: str, hand: int) -> Float[np.ndarray, "n 4"]:
    """Points of what a hand holds about its grasp point, with a radius, but for those that touch something."""
    points, grip = world.points(name), world.grip(hand)
    radius = TOUCHES * HELD_MARGIN
    apart = world.obstacles([name]).distance(points) > radius
    return np.column_stack([points - grip, np.full(len(points), radius)])[apart]
