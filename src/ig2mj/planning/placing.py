"""Placing what a hand holds, so that a relation becomes true."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.arm_orientations import points_ahead
from ig2mj.planning.clearance import Obstacles, straight
from ig2mj.planning.driving import go
from ig2mj.planning.grasping import grasp
from ig2mj.planning.moves import (
    ATTEMPTS,
    LET_GO,
    OVER,
    RETREAT,
    UP,
    Primitive,
    Program,
    ahead,
    first_way,
    hand_path,
    hand_with,
    quaternion,
    rest,
    travel,
    vector3,
)
from ig2mj.planning.opening import Tried, open_into
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.spots import Spot, grip_for, spots_for
from ig2mj.planning.stances import stances
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.world import PlannedWorld, Stance, Vector

SPARE = 0.03
"""m before its place from which on an object may touch what is around."""

DEEP = 0.4
"""m above a spot in a container that is open above, from which an object is let down to it."""

STANCES, WAYS, ARM_WAYS = 3, 30, 200
"""Stances for each spot, and ways of a hand that are looked for, at most: of one that floats, and of one on an arm."""


def place(predicate: str, until: str = "", turns_over: bool = True) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that makes a placement true.

    Args:
      until: the relation that ends it, if it is another. turns_over: where the hand has no way, it takes the object by
        another side, once.
    """

    def place(world: PlannedWorld, step: Step) -> Primitive:
        name, where = step.arguments
        hand_with(world, name)
        turned_over = not turns_over
        reason, detail, opened = "no_base", "", Tried()
        for attempt in range(ATTEMPTS):
            if name not in world.held:  # it fell, or was put where the relation is false
                again = yield from grasp(world, Step("grasp", (name,)))
                if not again.done:
                    break
            hand = hand_with(world, name)
            found = _plan(world, predicate, name, where, hand)
            if isinstance(found, str):
                reason = "no_path" if found == _NO_WAY else "no_base"
                detail = f"{found} {predicate}({name}, {where}) would be true"
                if predicate == "inside" and (yield from open_into(world, where, opened)):
                    continue
                if found == _NO_WAY and not turned_over and (yield from _regrasp(world, name, hand)):
                    turned_over = True
                    continue
                break
            stance, spot = found
            if reason := (yield from go(world, stance)):
                continue
            if name not in world.held:
                reason, detail = "slipped", f"the hand lost {name}"
                continue
            _, yaw = world.base
            target, quat, rotation = grip_for(world, hand, name, spot)
            fingers, palm = world.hand_axes(hand, rotation)
            target = target + LET_GO * UP
            spheres = world.spheres(fingers, palm, holding=name, hand=hand, rotation=rotation)
            obstacles = world.obstacles([name], world.stance)
            follows = world.follows(hand, quat, obstacles)
            back = [UP, -ahead(yaw)]
            way = hand_path(obstacles, spheres, world.grip(hand), target, back, SPARE, True, follows)
            if way is None:
                reason, detail = "no_path", f"the hand has no way with {name} to its place"
                continue
            keeps, turned = world.index(name), quaternion(quat)
            reason = yield [
                Phase(hand=hand, pos=vector3(world.grip(hand)), quat=turned, keeps=keeps, tolerance=0.05, limit=30,
                      after=""),
                *travel(hand, way, turned, keeps=keeps),
                Phase(hand=hand, pos=vector3(target), quat=turned, keeps=keeps, tolerance=0.015, turn_tolerance=0.1,
                      limit=20, after="", speed=0.03),
                Phase(hand=hand, close=False, until=Until.EMPTY, limit=10),
                Phase(hand=hand, pos=vector3(target - RETREAT * palm), tolerance=0.04, limit=15, after=""),
                *travel(hand, way[-2::-1], None),
                *rest(hand),
                Phase(until=Until.WAITED, limit=6),
            ]  # fmt: skip
            if world.facts.holds(until or predicate, name, where):
                return Outcome(attempts=attempt + 1)
            reason, detail = reason or "not_true_after", f"{name} is not where it was put"
        return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)

    return place


def _regrasp(world: PlannedWorld, name: str, hand: int) -> Generator[Program, str, bool]:
    """Puts down what a hand holds, and takes it by its rim, as far as possible from where the hand had it."""
    pos, quat = world.pose(name)
    before = matrices_on_host(quat[None])[0].T @ (world.grip(hand) - pos)
    put = yield from place("on_floor", turns_over=False)(world, Step("place_on_floor", (name, world.facts.room(name))))
    if not put.done:
        return False
    pos, quat = world.pose(name)
    there = pos + matrices_on_host(quat[None])[0] @ before
    taken = yield from grasp(world, Step("grasp", (name,)), lambda pose: float(np.linalg.norm(pose.point - there)))
    return taken.done


def _has_room(obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"], goal: Vector) -> bool:
    """Whether the hand with what it holds has room right before its place, on some side."""
    turns = np.arange(8) * (np.pi / 4)
    level = np.stack([np.cos(turns), np.sin(turns), np.zeros(8)], axis=1)
    points = goal + np.concatenate([[OVER * UP], SPARE * np.concatenate([[UP], level])])
    return any(obstacles.clear(np.column_stack([spheres[:, :3] + point, spheres[:, 3]])) for point in points)


def bring_out(world: PlannedWorld, name: str) -> Primitive:
    """Puts an object onto open floor of the room where it is."""
    if name not in world.held:
        taken = yield from grasp(world, Step("grasp", (name,)))
        if not taken.done:
            return taken
    return (yield from place("on_floor")(world, Step("place_on_floor", (name, world.facts.room(name)))))


_NO_SPOT, _NO_STANCE = "there is no room for a place where", "no free floor is in reach of a place where"
_NO_WAY = "the hand has no way to a place where"


def _plan(world: PlannedWorld, predicate: str, name: str, where: str, hand: int) -> tuple[Stance, Spot] | str:
    """A stance and a pose of the object's main body, of those with a way for the hand; else what is lacking."""
    obstacles, floor = world.obstacles([name]), world.floor()
    lacking, seen = _NO_SPOT, list[Stance]()

    def spots() -> Iterator[tuple[Spot, Vector, np.ndarray]]:
        """Spots with room for the hand, with its grasp point and spheres; those that are open above, and that the hand
        cannot be let down to, at last."""
        nonlocal lacking
        last = []
        for spot in spots_for(world, predicate, name, where):
            target, _, rotation = grip_for(world, hand, name, spot)
            spheres = world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)
            lacking = _NO_WAY if lacking == _NO_SPOT else lacking
            if not _has_room(obstacles, spheres, target + LET_GO * UP):
                continue
            found, over = (spot, target, spheres), target + (LET_GO + OVER) * UP
            if predicate == "inside" and not spot.roofed and not straight(obstacles, spheres, over + DEEP * UP, over):
                last.append(found)
            else:
                yield found
        yield from last

    def candidates() -> Iterator[tuple[Stance, Spot]]:
        nonlocal lacking
        for spot, target, spheres in spots():
            lacking = _NO_STANCE if lacking == _NO_WAY and not seen else lacking
            palm = world.hand_axes(hand, grip_for(world, hand, name, spot)[2])[1]
            for stance in stances(world, hand, target, floor, world.away(spheres), most=STANCES):
                lacking = _NO_WAY
                if points_ahead(world, palm, stance.yaw):
                    seen.append(stance)
                    yield stance, spot

    def has_way(candidate: tuple[Stance, Spot], search: bool) -> bool:
        stance, spot = candidate
        target, quat, rotation = grip_for(world, hand, name, spot)
        spheres = world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)
        start, back = world.carried(hand, stance), [UP, -ahead(stance.yaw)]
        standing = obstacles.about(stance.xy, *world.body.trunk)
        follows = world.follows(hand, quat, standing, stance)
        return hand_path(standing, spheres, start, target + LET_GO * UP, back, SPARE, search, follows) is not None

    most = WAYS if world.body.opening is None else ARM_WAYS
    return first_way(candidates(), has_way, most) or lacking
