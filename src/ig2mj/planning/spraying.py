"""Spraying: one hand points a spray at an object, another one switches it on, until the object has what it should."""

from __future__ import annotations

import functools

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.grasping import held_again, put_down_others
from ig2mj.planning.holding import Hold, hold_at, wait_until
from ig2mj.planning.moves import UP, Primitive, ahead, carry, hand_with, travel
from ig2mj.planning.openings import Surfaces, opening_of, surfaces
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.supplies import contents, litres, required_litres
from ig2mj.planning.switching import toggle
from ig2mj.planning.world import PlannedWorld, Stance, Vector
from ig2mj.states.substances.applying import REACH, SPRAY_RATE, in_cone
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import CONTAINS

APART = (0.2, 0.32, 0.44)
"""m between the nozzle and the point at which it points."""

PITCHES = (0.0, 0.35, 0.7, 1.05)
"""rad by which it points down."""

FACING = -0.25
"""Product of the normal of a point and the direction of the spray, at most."""

SPARE, TRIES = 4.0, 4
"""s that are sprayed beyond what it takes, and places that are tried."""


def spray(world: PlannedWorld, step: Step) -> Primitive:
    """Sprays until what the step adds holds, and switches the spray off."""
    name, tool, substance = step.arguments
    if reason := next(filter(None, map(world.domain.impossible, step.adds)), ""):
        return Outcome("not_true_after", reason)
    if tool not in world.domain.sprays:
        return Outcome("no_grasp", f"{tool} does not spray, or the robot has one hand")
    hand_with(world, tool)
    (wish, *_), failed = step.adds, set[int]()
    seconds = required_litres(world.facts, wish) / SPRAY_RATE + SPARE
    reason, detail = "no_path", f"the hand has no way with {tool} to where it points at {name}"
    for attempt in range(TRIES):
        if world.facts.holds(wish.predicate, *wish.arguments):
            return Outcome(attempts=max(attempt, 1))
        if litres(world.facts, tool, substance) < CONTAINS:
            return Outcome("not_true_after", f"{tool} contains no {substance}", attempts=max(attempt, 1))
        if not (yield from held_again(world, tool)):
            return Outcome("slipped", f"the hand lost {tool}", attempts=max(attempt, 1))
        yield from put_down_others(world, tool)
        hand, now = hand_with(world, tool), _Aims(world, name, tool, hand_with(world, tool))
        left = lambda now=now: [h for h in now.holds() if h.number not in failed]  # noqa: E731
        reason, way, number = yield from hold_at(world, tool, hand, left, now.meets)
        if number < 0 and tool in world.held:
            break
        failed.add(number)
        if tool not in world.held:
            continue
        done = functools.partial(world.facts.holds, wish.predicate, *wish.arguments)
        if not done() and not world.facts.holds("toggled_on", tool):
            yield from toggle(True)(world, Step("toggle_on", (tool,)))
        reason = yield from wait_until(world, (wish.predicate, *wish.arguments), seconds, world.index(tool))
        if world.facts.holds("toggled_on", tool) and tool in world.held:
            yield from toggle(False)(world, Step("toggle_off", (tool,)))
        if tool in world.held:
            yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
        detail = f"what {tool} sprays does not meet {name}"
    met = world.facts.holds(wish.predicate, *wish.arguments)
    return Outcome("" if met else reason or "not_true_after", "" if met else detail, attempts=TRIES)


class _Aims:
    """Ways of pointing a spray that a hand holds at an object, upright but for its pitch."""

    def __init__(self, world: PlannedWorld, name: str, tool: str, hand: int):
        self._world, self._tool = world, tool
        found = of(world.domain.model)
        self._row, self._others = int(found.row[world.index(name)]), found.covered != world.index(tool)
        self._surfaces: Surfaces = surfaces(world)
        self._frame = matrices_on_host(world.pose(tool)[1][None])[0]
        self._to_grip = world.grip(hand) - opening_of(world, tool).centre
        self._directions: dict[int, float] = {}

    def _ahead(self, yaw: float, pitch: float) -> Vector:
        return np.cos(pitch) * ahead(yaw) - np.sin(pitch) * UP

    def holds(self) -> list[Hold]:
        """All, numbered by point and pitch; those come first for which it is turned least."""
        yaw, found = self._world.base[1], list[Hold]()
        for pitch_number, pitch in enumerate(PITCHES):
            out = self._ahead(yaw, pitch)
            level = turn_onto(self._frame[:, 2], UP)
            forward = level @ self._frame[:, 0]
            turn = about_vertical(yaw - float(np.arctan2(forward[1], forward[0])))
            tilt = turn_onto(ahead(yaw), out) @ turn @ level
            if not self._stays_in(tilt):
                continue
            for point_number, point in enumerate(self._surfaces.points[self._row]):
                number = pitch_number * len(self._surfaces.points[self._row]) + point_number
                found += [Hold(point, tilt @ self._to_grip - apart * out, tilt, number) for apart in APART]
        return found

    def _stays_in(self, tilt: np.ndarray) -> bool:
        """Whether nothing flows out of the spray where it is turned so."""
        containers = of(self._world.domain.model).containers
        row = containers.row_of(self._world.index(self._tool))
        assert row is not None
        up = (tilt @ self._frame).T @ UP
        return containers.stays_in(row, up) > contents(self._world.facts, self._tool)

    def meets(self, stance: Stance, hold: Hold) -> bool:
        """Whether the object is the first thing in the cone of the spray, held so from a stance."""
        points, normals = self._surfaces.points, self._surfaces.normals
        pitch, number = divmod(hold.number, points.shape[1])
        out = self._ahead(stance.yaw, PITCHES[pitch])
        if normals[self._row, number] @ out > FACING:
            return False
        turn = about_vertical(stance.yaw - self._world.base[1])
        nozzle = hold.point + turn @ (hold.offset - hold.tilt @ self._to_grip)
        inside, along = in_cone(points, normals, nozzle[None, None], out[None, None], self._others)
        first = np.where(inside, along, np.inf).min(axis=-1)
        return bool(first[self._row] <= REACH and first.argmin() == self._row)
