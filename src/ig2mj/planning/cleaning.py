"""Wiping dust and scrubbing stains: a tool that a hand holds is pressed on particles, one place after another.

Where a tool is pressed is planned in `ig2mj.planning.cleaning_strokes`.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Callable, Generator, Sequence

import numpy as np

from ig2mj.geometry.host_rotations import turn_about
from ig2mj.planning.cleaning_area import is_behind, is_covered
from ig2mj.planning.cleaning_strokes import FEW, Stroke, plan_strokes, strokes_here
from ig2mj.planning.driving import go
from ig2mj.planning.grasping import grasp, held_again, put_down_others, with_free_hand
from ig2mj.planning.handing_over import hand_over_in_the_open
from ig2mj.planning.held_tools import CLOSE, TURNS, HeldTool, Region, regions_of
from ig2mj.planning.moves import (
    UP,
    Primitive,
    Program,
    ahead,
    go_home_past,
    hand_path,
    hand_with,
    strayed,
    travel,
    vector3,
)
from ig2mj.planning.opening_around import Tried, bars, open_around
from ig2mj.planning.phases import Phase
from ig2mj.planning.placing import bring_out
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.switching import toggle
from ig2mj.planning.turning_over import turn_over
from ig2mj.planning.world import DirtSpot, PlannedWorld, Stance, Vector

ROUNDS = 24
"""Stances from which an object is cleaned, at most."""

PRESSES, ARM_PRESSES = 4, 6
"""Agent steps that a tool is pressed: with each the hand is pulled farther into the face; the same of a hand on an arm,
which is slower."""

BEFORE, COMES = 0.03, 12
"""m before where a tool is pressed to which an arm brings it first, and agent steps for that at most: it moves by 5 to
10 mm in a step at the beginning, and would end before the face."""

TRIES = 4
"""Times that a particle is gone for."""

BESIDE, MOVED = 0.12, 4
"""m from dirt within which things are moved away where no tool reaches it, and how many at most."""

TURNED, RETAKEN = 2, 4
"""Times that a gripper turns over a tool which lies with the side up that cleans, or that a hand which floats gives one
to the other hand; and these together with those that a gripper lets it fall to take it from behind."""

REGRASPS = 8
"""Times that a tool which was lost is taken again."""


def clean(predicate: str) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that takes dust or stains off an object with a tool that a hand holds."""

    def clean(world: PlannedWorld, step: Step) -> Primitive:
        name, tool = step.arguments
        hand_with(world, tool)
        if predicate == "stained" and not world.facts.holds("soaked", tool):
            return Outcome("no_grasp", f"{tool} is not soaked")
        if world.domain.has(tool, "toggleable") and not world.facts.holds("toggled_on", tool):
            yield from put_down_others(world, tool)
            yield from with_free_hand(world, _switched_on(world, tool))  # the only hand lets go of it for that
        reason, detail, lost, tried = "no_base", f"no dirt of {name} is in reach", 0, collections.Counter[int]()
        visited, turned = list[Stance](), 0
        opened, moved, came = Tried(), set[str](), list[Vector]()
        for attempt in range(ROUNDS):
            if not world.facts.holds(predicate, name):
                break
            if tool not in world.held:
                lost += 1
                again = None if lost > REGRASPS else (yield from grasp(world, Step("grasp", (tool,))))
                if again is None or not again.done:
                    return Outcome("slipped", f"the hand lost {tool}", attempts=attempt + 1)
                visited.clear()  # it is held in another way
            hand = hand_with(world, tool)
            if world.body.opening is None and is_covered(world, tool, hand):
                yield from put_down_others(world, tool)
                if failed := (yield from hand_over_in_the_open(world, tool, hand)):
                    reason, detail = failed, f"{tool} cannot be taken by the side that does not clean"
                    continue
                hand = hand_with(world, tool)
            elif is_covered(world, tool, hand) and turned < TURNED:
                turned += 1
                if not (yield from _turned_over(world, tool, hand)):
                    return Outcome("slipped", f"{tool} was put down to be turned over", attempts=attempt + 1)
                hand = hand_with(world, tool)
            spots = [spot for spot in world.dirt(predicate, name) if tried[spot.number] < TRIES]
            spots.sort(key=lambda spot: tried[spot.number])
            plan, floats = plan_strokes(world, name, tool, hand, spots, visited), world.body.opening is None
            if plan is None and floats and turned < TURNED and _is_askew(world, tool):
                turned += 1
                visited.clear()
                yield from put_down_others(world, tool)
                yield from hand_over_in_the_open(world, tool, hand)
                continue
            while plan is None and (yield from _opened(world, name, tool, opened)) and tool in world.held:
                plan = plan_strokes(world, name, tool, hand, spots, visited)
            while plan is None and (yield from _clear_away(world, name, tool, spots, moved)) and tool in world.held:
                plan = plan_strokes(world, name, tool, hand, spots, ())
            if plan is None and not floats and turned < RETAKEN and _is_askew(world, tool):
                turned += 1
                if not (yield from _turned_over(world, tool, hand_with(world, tool))):
                    return Outcome("slipped", f"{tool} was put down to be taken from behind", attempts=attempt + 1)
                continue
            if plan is None and tool not in world.held:
                continue  # it was lost meanwhile
            if plan is None and floats:
                plan = plan_strokes(world, name, tool, hand, spots, visited, around=True)
            if plan is None:
                break
            if strayed(world, hand):
                yield from go_home_past(world, hand, came)
                came = []
                if tool not in world.held:
                    continue
            visited.append(plan.stance)
            if failed := (yield from go(world, plan.stance)):
                reason, detail = failed, f"no path leads to where the dirt of {name} is in reach"
                tried.update(spot.number for spot in plan.covered)
                continue
            if not floats and tool in world.held:  # a base on wheels stops some cm off, where arms have other ways
                plan = strokes_here(world, name, tool, hand, spots) or plan
            for stroke in plan.strokes:
                tried[stroke.spot.number] += 1
                if not world.facts.holds(predicate, name) or tool not in world.held:
                    break
                spot = next((s for s in world.dirt(predicate, name) if s.number == stroke.spot.number), None)
                if spot is None:
                    continue
                present = dataclasses.replace(stroke, spot=spot)  # a drawer may have moved
                program, way = _program(world, tool, hand, present)
                if not program and strayed(world, hand):
                    yield from go_home_past(world, hand, came)
                    came = []
                    program, way = _program(world, tool, hand, present) if tool in world.held else ([], [])
                if program:
                    came = [*([world.grip(hand)] if floats or not came else came), *way]
                    reason, detail = (yield program), f"{tool} did not take enough off {name}"
        if tool in world.held:
            yield from go_home_past(world, hand_with(world, tool), came)
        if not world.facts.holds(predicate, name):
            return Outcome()
        return Outcome(reason or "not_true_after", detail)

    return clean


def _is_askew(world: PlannedWorld, tool: str) -> bool:
    """Whether a hand holds a tool, and not from behind: by its rim it is in the way of the side that cleans."""
    if tool not in world.held:
        return False
    return not is_behind(world, tool, world.hand_axes(hand_with(world, tool))[1])


def _turned_over(world: PlannedWorld, tool: str, hand: int) -> Generator[Program, str, bool]:
    """Lets a tool fall onto its side that cleans and takes it again; returns whether it is held again."""
    yield from turn_over(world, tool, hand)
    return (yield from held_again(world, tool))


def _opened(world: PlannedWorld, name: str, tool: str, opened: Tried) -> Generator[Program, str, bool]:
    """As `open_around`; where the only hand holds the tool, that is put down for it."""
    if not bars(world, name, opened):
        return False
    yield from put_down_others(world, tool)
    return (yield from with_free_hand(world, open_around(world, name, opened)))


def _clear_away(
    world: PlannedWorld, name: str, tool: str, spots: Sequence[DirtSpot], moved: set[str]
) -> Generator[Program, str, bool]:
    """Puts what stands next to dirt, the nearest first, onto open floor; returns whether there was something that has
    not been moved."""
    if not spots or len(moved) >= MOVED:
        return False
    points = np.array([s.pos + CLOSE * s.normal for s in spots])
    near = list[tuple[float, str]]()
    for other in world.domain.loose:
        if other in (name, tool, *world.held) or other in moved or not world.domain.graspable(other):
            continue
        low, high = world.facts.box(other)
        apart = np.linalg.norm(points - np.clip(points, low, high), axis=1).min()
        if apart < BESIDE:
            near.append((float(apart), other))
    if not near:
        return False
    other = min(near)[1]
    moved.add(other)
    yield from put_down_others(world, tool)
    yield from with_free_hand(world, _brought_out(world, other))
    return True


def _switched_on(world: PlannedWorld, tool: str) -> Generator[Program, str, bool]:
    return (yield from toggle(True)(world, Step("toggle_on", (tool,)))).done


def _brought_out(world: PlannedWorld, name: str) -> Generator[Program, str, bool]:
    return (yield from bring_out(world, name)).done


def _program(world: PlannedWorld, tool: str, hand: int, stroke: Stroke) -> tuple[Program, list[Vector]]:
    """Presses the tool on a particle and lifts it, and the way there; nothing where the hand has none. The planned turn
    of the tool is tried first."""
    obstacles, stance, spot = world.obstacles([tool], world.stance), world.stance, stroke.spot
    held = HeldTool(world, tool, hand, stroke.share)
    regions = regions_of(held, stance.yaw, spot.normal)
    planned = regions[min(stroke.turn, len(regions) - 1)]
    if world.body.opening is not None:
        turns = [turn_about(spot.normal, angle) @ planned.rotation for angle in TURNS]
        regions = [planned, *(Region.turned(turn, held.corners) for turn in turns)]
    turns = [planned, *(r for r in regions if r is not planned)]
    for strays in (False,) if world.body.opening is None else (False, True):  # at last where it strays into something
        ways = 0
        for region in turns:
            if not world.reaches(hand, stance, region.at(spot)):
                continue
            spheres = held.spheres(region.rotation)
            if not obstacles.clear(spheres + np.array([*region.above(spot), 0.0])):
                continue
            follows = world.follows(hand, world.turned_hand(hand, region.rotation), obstacles)
            back, goal = [UP, -ahead(stance.yaw), spot.normal], region.above(spot)
            way = hand_path(obstacles, spheres, world.grip(hand), goal, back, follows=follows, strays=strays)
            if way is not None and (follows is None or follows.passes([*way, region.at(spot)])):
                return _press(world, tool, hand, region, spot, way), way
            ways += 1
            if ways == FEW:
                break
    return [], []


def _press(world: PlannedWorld, tool: str, hand: int, region: Region, spot: DirtSpot, way: Sequence[Vector]) -> Program:
    keeps, arm = world.index(tool), world.body.opening is not None
    quat, target = world.turned_hand(hand, region.rotation), region.at(spot)
    press = Phase(
        hand=hand, pos=vector3(target), quat=quat, keeps=keeps, tolerance=0.004, limit=PRESSES, after="", speed=0.03
    )
    before = vector3(target + BEFORE * spot.normal)
    comes = dataclasses.replace(press, pos=before, tolerance=0.01, limit=COMES)
    return [
        *travel(hand, way, quat, keeps=keeps),
        *([comes, dataclasses.replace(press, limit=ARM_PRESSES)] if arm else [press]),
        Phase(hand=hand, pos=vector3(way[-1]), keeps=keeps, tolerance=0.03, limit=12, after=""),
    ]
