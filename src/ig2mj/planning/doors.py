"""Doors between rooms in a robot's way: found by the search for a way. What is shut is opened, and a leaf that stands
open across the only way is swung shut."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Generator

import numpy as np
from jaxtyping import Bool

from ig2mj.engine.writes import joints
from ig2mj.planning.bodies import HandedBody
from ig2mj.planning.clutter import moved_out_of_the_way, nearest_floor, target_of
from ig2mj.planning.driving import NEAR, go
from ig2mj.planning.free_floor import NEAR_START, FreeFloor
from ig2mj.planning.grasping import held_again, release, set_aside
from ig2mj.planning.moves import Primitive, Program, free_hand, guarded
from ig2mj.planning.occupancy import door_objects
from ig2mj.planning.opening import SHUT, joints_of, move_joint
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld, Stance

MOST_DOORS = 6
"""Doors that are opened for one primitive."""

SWINGS, SWING, MOVED = 14, 0.3, 0.03
"""Swings of a door at most; share of its range that it is moved in one; and from which on it has moved."""

WIDE = 0.9
"""Share of its range from which on a door between rooms counts as wide open."""

OFF, SWEPT = 1.0, 100.0
"""m from where a leaf moves at which things are put down, and m of way that a metre closer counts as."""

BESIDE = 0.6
"""m between a way and the middle of a door's leaf that it leads through, at most."""


Action = Callable[[PlannedWorld, Step], Primitive]


def through_doors(world: PlannedWorld, step: Step, action: Action) -> Primitive:
    """A primitive; where shut doors are in its way they are opened, and it begins again. A base that climbs no
    edges of carpets goes around them, and over them where it fails otherwise."""
    outcome = yield from guarded(_through_doors(world, step, action))
    blocked = outcome.reason in ("no_base", "no_path", "timeout")
    if not blocked or world.body.climbs or not world.planner.occupancy.covered.any():
        return outcome
    world.crosses = True
    return (yield from guarded(_through_doors(world, step, action)))


def _through_doors(world: PlannedWorld, step: Step, action: Action) -> Primitive:
    outcome = yield from action(world, step)
    for _ in range(MOST_DOORS):
        door = door_in_the_way(world, step) if outcome.reason in ("no_base", "no_path") else None
        if door is None:
            moved = outcome.reason == "no_base" and (yield from _leaf_swung_aside(world, step))
            if not moved and (outcome.reason != "no_base" or not (yield from moved_out_of_the_way(world, step))):
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
    """Opens a door by short swings, each from a new stance, as wide as it goes: a base that drives close by a leaf
    brushes it, and swings it shut. None, or why it still is in the way, in words; "" for a robot that opens no doors.
    """
    if not isinstance(world.body, HandedBody):
        return ""
    tried = 0
    for attempt in range(SWINGS):
        shut = [j for j in joints_of(world, door) if j.fraction < WIDE]
        if not shut:
            break
        before, to = shut[0].fraction, min(shut[0].fraction + SWING, 1.0)
        yield from move_joint(world, shut[0], free_hand(world, attempt), True, tried, to)
        moved = {j.name: j.fraction for j in joints_of(world, door)}[shut[0].name] - before > MOVED
        tried = 0 if moved else tried + attempt % 2
        if not moved and door_in_the_way(world, step) != door:
            break
    return None if door_in_the_way(world, step) != door else ", and no hand can move it"


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


@dataclasses.dataclass(frozen=True, eq=False)
class _Leaf:
    """A door that stands open with its leaf in the way.

    Attributes:
      door: its name. floor: where a robot can stand while the door is shut. near: of these cells those on the same side
        as what a step is about, to which the robot can drive while the door is open.
    """

    door: str
    floor: FreeFloor
    near: Bool[np.ndarray, "h w"]

    def before(self, stance: Stance) -> bool:
        """Whether a stance is on that floor."""
        return bool(self.near[tuple(self.floor.occupancy.cells(np.array(stance.xy)))])

    def off(self, world: PlannedWorld) -> Stance:
        """The nearest stance on that floor which the leaf does not come near, looking away from that; the farthest from
        it where it comes near all."""
        cells = np.argwhere(self.near)
        middles, (here, _) = self.floor.occupancy.middles(cells), world.base
        sweep = np.concatenate([j.sweep(0.0) for j in joints_of(world, self.door)])[:, :2]
        apart = np.linalg.norm(middles[:, None] - sweep[None], axis=-1).min(1)
        way = world.floor().distances(here, NEAR_START)[tuple(cells.T)]
        best = int(np.argmin(way - SWEPT * np.minimum(apart, OFF)))
        x, y = middles[best]
        yaw = np.arctan2(*(middles[best] - sweep.mean(0))[::-1])
        return Stance((float(x), float(y)), float(yaw))


def leaf_in_the_way(world: PlannedWorld, step: Step) -> _Leaf | None:
    """The first door whose open leaf is across the only way to near what a step is about; None: there is none."""
    tables, scene, number = world.domain.model.tables, world.stage.scene, {}
    for door in door_objects(tables).tolist():
        if any(j.fraction > SHUT for j in joints_of(world, tables.object_names[door])):
            number[door] = tables.openable_object == door
    point = target_of(world, step) if number and isinstance(world.body, HandedBody) else None
    if point is None or nearest_floor(world, now := world.floor(), point, world.body.reach) is not None:
        return None
    goal = nearest_floor(world, world.floor(without=list(number)), point, world.body.reach)
    if goal is None:
        return None
    reached = np.isfinite(now.distances(world.base[0], NEAR_START))
    for door, own in number.items():
        world.query.load(world.stage.snapshot(world.world))
        shut = joints(scene.model.nq, tables.openable_qposadr[own], tables.openable_closed[own])
        world.query.write(shut)
        floor = world.floor(view=world.query.view)
        near = reached & floor.joined(goal)
        if near.any():
            return _Leaf(tables.object_names[door], floor, near)
    return None


def _leaf_swung_aside(world: PlannedWorld, step: Step) -> Generator[Program, str, bool]:
    """Swings the leaf that `leaf_in_the_way` finds from its other side, until it is in the way no longer; what hands
    hold, which a leaf would meet, is put down there before. Returns whether it is not, and they hold it again."""
    leaf = leaf_in_the_way(world, step)
    if leaf is None:
        return False
    held = [name for name in dict.fromkeys(world.held) if name and not world.domain.fixed(name)]
    if held and (yield from go(world, leaf.off(world))):
        return False
    for name in held:
        if name in world.held:  # else it was lost on the way
            yield from release(world, Step("release", (name,)))
    tried, left = 0, leaf
    for attempt in range(SWINGS):
        joint = next((j for j in joints_of(world, leaf.door) if j.fraction > SHUT), None)
        if joint is None or left is None:
            break
        yield from move_joint(world, joint, free_hand(world, attempt), False, tried, stands=left.before)
        now = next(j.fraction for j in joints_of(world, leaf.door) if j.name == joint.name)
        tried = 0 if joint.fraction - now > MOVED else tried + attempt % 2
        left = leaf_in_the_way(world, step)
    for name in held:
        if not (yield from held_again(world, name)):
            return False
    return left is None


def _is_wide(world: PlannedWorld, door: str) -> bool:
    return all(j.fraction >= WIDE for j in joints_of(world, door))
