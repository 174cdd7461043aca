"""Mixing: what stirs is dipped into a container and moved to its walls, until the contents have become a substance."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.planning.grasping import held_again, put_down_others
from ig2mj.planning.holding import Hold, hold_at
from ig2mj.planning.moves import DOWN, UP, Primitive, Program, ahead, carry, hand_with, quaternion, travel, vector3
from ig2mj.planning.openings import opening_of
from ig2mj.planning.phases import Phase
from ig2mj.planning.placing import bring_out
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.supplies import ingredients
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.states.substances.streams import UPWARDS

LEANS, TURNS = (0.3, 0.0, 0.7), (0.0, 0.8, -0.8, 1.6, -1.6, 3.1)
"""rad from the vertical by which the tool leans, and about the vertical by which it is turned."""

ABOVE, BOTTOM = 0.03, 0.006
"""m above the middle of an opening at which the tip is held first, and above the lowest point of the container at
which it stirs."""

REACH, STROKES, ROUNDS = 0.9, 8, 2
"""Share of the way from the middle of the opening to its rim that the tip goes, directions, and times all around."""

STRIDE, SPEED, LIMIT, TRIES = 0.01, 0.01, 4, 4
"""m between looks at the contents, so that what stirs does not press a container over; m of the hand in an agent step,
agent steps of a stride, and ways of holding the tool that are tried."""


def mix(world: PlannedWorld, step: Step) -> Primitive:
    """Stirs until the container contains the substance."""
    name, tool, substance = step.arguments
    if reason := next(filter(None, map(world.domain.impossible, step.adds)), ""):
        return Outcome("not_true_after", reason)
    if tool not in world.domain.stirrers:
        return Outcome("no_grasp", f"{tool} does not stir, or cannot be carried")
    hand_with(world, tool)
    if name in world.held and not (yield from bring_out(world, name)).done:
        return Outcome("no_base", f"there is no place on which {name} could stand")
    failed = set[int]()
    reason, detail = "no_path", f"the hand has no way with {tool} to above {name}"
    for attempt in range(TRIES):
        if _holds(world, step):
            return Outcome(attempts=max(attempt, 1))
        if lacking := ingredients(world.facts, name, substance):
            return Outcome("not_true_after", f"{name} lacks {lacking} for {substance}", attempts=max(attempt, 1))
        if not (yield from held_again(world, tool)):
            return Outcome("slipped", f"the hand lost {tool}", attempts=max(attempt, 1))
        yield from put_down_others(world, tool)
        if opening_of(world, name).normal[2] < UPWARDS:
            return Outcome("no_path", f"the opening of {name} does not face upwards", attempts=max(attempt, 1))
        hand = hand_with(world, tool)
        left = lambda hand=hand: [h for h in _above(world, name, tool, hand) if h.number not in failed]  # noqa: E731
        reason, way, number = yield from hold_at(world, tool, hand, left)
        if number < 0 and tool in world.held:
            break
        failed.add(number)
        if tool not in world.held:
            continue
        if not reason:
            high = world.grip(hand)
            yield from _stirred(world, step, hand)
            if tool in world.held:
                yield [_at(world, hand, high, world.index(tool))]
        if tool in world.held:
            yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
        detail = f"{tool} does not reach what is in {name}"
    met = _holds(world, step)
    return Outcome("" if met else reason or "not_true_after", "" if met else detail, attempts=TRIES)


def _holds(world: PlannedWorld, step: Step) -> bool:
    return all(world.facts.holds(wish.predicate, *wish.arguments) for wish in step.adds)


def _above(world: PlannedWorld, name: str, tool: str, hand: int) -> list[Hold]:
    """The tool with its far end above the middle of the opening and the hand above that, leaning and turned."""
    top = opening_of(world, name).centre + ABOVE * UP
    points = world.points(tool) - world.grip(hand)
    tip = points[int(np.linalg.norm(points, axis=1).argmax())]
    found, out = list[Hold](), ahead(world.base[1])
    for lean in LEANS:
        upright = turn_onto(tip, np.cos(lean) * DOWN + np.sin(lean) * out)
        for turn in TURNS:
            tilt = about_vertical(turn) @ upright
            found.append(Hold(top, -(tilt @ tip), tilt, len(found)))
    return found


def _stirred(world: PlannedWorld, step: Step, hand: int) -> Generator[Program, str, None]:
    """The tip goes down, and from the middle to the walls, all around."""
    name, tool, _ = step.arguments
    opening, keeps = opening_of(world, name), world.index(tool)
    points = world.points(tool)
    tip, grip = points[int(points[:, 2].argmin())], world.grip(hand)
    middle: Vector = np.array([*opening.centre[:2], float(world.vertices(name)[:, 2].min()) + BOTTOM])
    around = [c - opening.centre for c in opening.rim[:: max(1, len(opening.rim) // STROKES)]]
    strokes = [middle + share * np.array([*c[:2], 0.0]) for c in around for share in (REACH, 0.0)]
    at = tip
    for point in (middle, *strokes * ROUNDS):
        count = max(1, int(np.ceil(np.linalg.norm(point - at) / STRIDE)))
        for there in np.linspace(at, point, count + 1)[1:]:
            if (yield [_at(world, hand, grip + there - tip, keeps)]) or _holds(world, step):
                return
        at = point


def _at(world: PlannedWorld, hand: int, grip: Vector, keeps: int) -> Phase:
    """The hand moves straight to a place, turned as it is."""
    quat = quaternion(world.hand_quat(hand))
    return Phase(
        hand=hand, pos=vector3(grip), quat=quat, keeps=keeps, tolerance=0.01, limit=LIMIT, after="", speed=SPEED
    )
