"""Doors between rooms that are shut in a robot's way: found by the search for a way, and opened."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Generator

import numpy as np

from ig2mj.planning.bodies import HandedBody
from ig2mj.planning.clutter import moved_out_of_the_way, nearest_floor, target_of
from ig2mj.planning.driving import NEAR
from ig2mj.planning.grasping import held_again, set_aside
from ig2mj.planning.moves import Primitive, Program, free_hand
from ig2mj.planning.occupancy import door_objects
from ig2mj.planning.opening import joints_of, move_joint
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld

MOST_DOORS = 6
"""Doors that are opened for one primitive."""

SWINGS, SWING, MOVED = 14, 0.3, 0.03
"""Swings of a door at most; share of its range that it is moved in one; and from which on it has moved."""

WIDE = 0.9
"""Share of its range from which on a door between rooms counts as wide open."""

BESIDE = 0.6
"""m between a way and the middle of a door's leaf that it leads through, at most."""


Action = Callable[[PlannedWorld, Step], Primitive]


def through_doors(world: PlannedWorld, step: Step, action: Action) -> Primitive:
    """A primitive; where shut doors are in its way they are opened, and it begins again. A base that climbs no
    edges of carpets goes around them, and over them where it fails otherwise."""
    outcome = yield from _through_doors(world, step, action)
    blocked = outcome.reason in ("no_base", "no_path", "timeout")
    if not blocked or world.body.climbs or not world.planner.occupancy.covered.any():
        return outcome
    world.crosses = True
    return (yield from _through_doors(world, step, action))


def _through_doors(world: PlannedWorld, step: Step, action: Action) -> Primitive:
    outcome = yield from action(world, step)
    for _ in range(MOST_DOORS):
        door = door_in_the_way(world, step) if outcome.reason in ("no_base", "no_path") else None
        if door is None:
            if outcome.reason != "no_base" or not (yield from moved_out_of_the_way(world, step)):
                return outcome
            outcome = yield from action(world, step)
            continue
        aside = (yield from set_aside(world)) if isinstance(world.body, HandedBody) else ""
        detail = yield from _swing(world, door, step)
        held = not aside or (yield from held_again(world, aside))
        if detail is not None:
            return dataclasses.replace(outcome, reason="no_path", detail=f"{door} is shut in the way{detail}")
        if not held:
            return dataclasses.replace(outcome, reason="slipped", detail=f"{aside} was put down to open {door}")
        outcome = yield from action(world, step)
    return outcome


def _swing(world: PlannedWorld, door: str, step: Step) -> Generator[Program, str, str | None]:
    """Opens a door by short swings, each from a new stance, until it is in the way no longer. None, or why it still is,
    in words; "" for a robot that opens no doors."""
    if not isinstance(world.body, HandedBody):
        return ""
    tried = 0
    for attempt in range(SWINGS):
        shut = [j for j in joints_of(world, door) if j.fraction < WIDE]
        if not shut:
            break
        before, to = shut[0].fraction, min(shut[0].fraction + SWING, 1.0)
        yield from move_joint(world, shut[0], free_hand(world, attempt), True, tried, to)
        now = {j.name: j.fraction for j in joints_of(world, door)}[shut[0].name]
        tried = 0 if now - before > MOVED else tried + attempt % 2
        if door_in_the_way(world, step) != door:
            return None
    return ", and no hand can move it"


def door_in_the_way(world: PlannedWorld, step: Step) -> str | None:
    """The first shut door without which the robot could come near what a step is about; None: there is none."""
    names = world.domain.model.tables.object_names
    doors = [int(d) for d in door_objects(world.domain.model.tables) if not _is_wide(world, names[d])]
    point = target_of(world, step) if doors else None
    if point is None:
        return None
    here, _ = world.base
    floor, reach = world.floor(), world.body.reach if isinstance(world.body, HandedBody) else NEAR
    if nearest_floor(world, floor, point, reach) is not None:
        return None
    freed = world.floor(without=doors)
    goal = nearest_floor(world, freed, point, reach)
    way = None if goal is None else freed.way(here, goal)
    if way is None:  # what lies behind the door may be pushed by it
        loose = [world.index(n) for n in world.domain.loose]
        freed = world.floor(without=[*doors, *loose])
        goal = nearest_floor(world, freed, point, reach)
        way = None if goal is None else freed.way(here, goal)
    if way is None:
        return None
    lines = [(a, b, max(2, int(np.linalg.norm(b - a) / 0.05))) for a, b in itertools.pairwise(way)]
    points = np.concatenate([np.linspace(a, b, count) for a, b, count in lines])
    passed: list[tuple[int, str]] = []
    for door in doors:
        leaf = np.concatenate([j.vertices for j in joints_of(world, names[door])])[:, :2].mean(0)
        near = np.flatnonzero(np.linalg.norm(points - leaf, axis=1) < BESIDE)
        if len(near):
            passed.append((int(near[0]), names[door]))
    return min(passed)[1] if passed else None


def _is_wide(world: PlannedWorld, door: str) -> bool:
    return all(j.fraction >= WIDE for j in joints_of(world, door))
