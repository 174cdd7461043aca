"""Driving to a stance, with what the hands hold.

What is held turns with the robot. Where there is no room to turn with it, the robot turns farther off and comes the
last part of the way straight ahead, and it backs off straight before it turns again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Generator, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.planning.bodies import RUSH
from ig2mj.planning.carrying import carried_way
from ig2mj.planning.free_floor import NEAR_START, FreeFloor
from ig2mj.planning.long_things import stood_up
from ig2mj.planning.moves import TOUCHES, UP, Program, go_home, strayed, vector3
from ig2mj.planning.occupancy import RESOLUTION
from ig2mj.planning.phases import Base, Phase
from ig2mj.planning.stances import clear_with_held
from ig2mj.planning.world import PlannedWorld, Stance, Vector

BACK = np.arange(0.0, 1.25, 0.1)
"""m before a stance at which there may be room to turn."""

NEAR = 1.0
"""m from the middle of an object at which a base without hands is near it."""

BACKS_OFF, RUN_UP = 0.3, 0.6
"""m that a base goes straight back where something has stopped it; on wheels, to take an edge of a carpet."""

BACK_STEPS, FAR_BACK_STEPS = 40, 100
"""Agent steps that this takes at most, and going back by a metre with what an arm holds."""

SLIGHT = 0.02
"""m of stretching and stooping that do not count."""

FORWARDS = np.array([1.0, 0.0, 0.0])

STEP, TURN_STEP = 0.1, 0.12
"""m and rad between stances at which what is held is checked."""

FARTHER, STOPS = 0.04, 0.06
"""m by which a base on wheels goes on where its arm does not reach what it was to reach from there, and from the end of
such a way at which it stops."""

PASSED = 0.08
"""m from a point on the way at which a base drives on to the next one."""

SHORT = 0.06
"""m before its end at which a base on wheels that goes straight back may stop."""

OFF_TO_TURN = (0.0, 0.1, 0.2, 0.3, 0.45, 0.6)
"""m behind a stance at which a base on wheels may turn with what it holds."""


ASIDE = 0.05
"""m to the side of a base on wheels up to which it goes to a point without turning much."""

QUICK = 0.12
"""m in an agent step of a base whose hands are empty."""

TURN_STEPS = 120
"""Agent steps of a turn at the end of a way, at most: with something in the hand a base turns slowly."""

HIGHER = (0.15, 0.3)
"""m by which hands raise what they carry where it would meet something, as the back of a chair, on its way."""

AT_LEAST, SLOWEST = 100, 0.02
"""Agent steps that a stretch of the way may take at least, and m in an agent step of the slowest base: its limit."""


def go(world: PlannedWorld, stance: Stance) -> Generator[Program, str, str]:
    """Drives to a stance; returns the reason why it did not get there. A base that something has stopped backs
    off, and tries again, once."""
    reason = yield from _go(world, stance, stands_up=True)
    if reason != "timeout":
        return reason
    here, yaw = world.base
    x, y = here - (BACKS_OFF if world.body.climbs else RUN_UP) * np.array([np.cos(yaw), np.sin(yaw)])
    yield [shift(Stance((float(x), float(y)), yaw), within=BACK_STEPS)]
    return (yield from _go(world, stance))


def _go(world: PlannedWorld, stance: Stance, stands_up: bool = False) -> Generator[Program, str, str]:
    """See `go`. stands_up: where there is no way with what the hands hold, long things are turned upright."""
    here, yaw = world.base
    apart = float(np.linalg.norm(here - stance.xy))
    turned = abs((yaw - stance.yaw + np.pi) % (2 * np.pi) - np.pi)
    rises, stoops = abs(stance.rise) > SLIGHT, abs(world.stance.rise) > SLIGHT
    if apart < 0.04 and turned < 0.1:
        return (yield [stretch(stance.rise)]) if rises or stoops else ""
    for hand, name in enumerate(world.held):
        carries = bool(name) and not world.domain.fixed(name) and world.held.count(name) == 1
        if (not name or carries) and strayed(world, hand):
            yield go_home(world, hand)
            if carries and name not in world.held:
                return "slipped"
    if stoops:
        yield [stretch(0.0)]
    last = [stretch(stance.rise)] if rises else []
    standing = world.floor()
    if not any(n and not world.domain.fixed(n) for n in world.held):
        way, before = world.floor(reaching=True).way(here, stance.xy), list[Phase]()
        if way is None:
            way, before = standing.way(here, stance.xy), tuck(world)
        speed = RUSH if world.crosses else QUICK
        return "no_path" if way is None else (yield [*before, *drive(way, stance.yaw, speed), *last])
    if tucked := tuck(world):
        yield tucked
    aside = abs(float(np.array([-np.sin(yaw), np.cos(yaw)]) @ np.subtract(stance.xy, here)))
    straight = world.body.sideways or aside < ASIDE
    if (
        apart < 0.3
        and turned < 0.3
        and straight
        and clear_with_held(world, _between(Stance((here[0], here[1]), yaw), stance))
    ):
        return (yield [shift(stance), *last])
    turning = world.floor(holding=True)
    start = _backed(world, Stance((float(here[0]), float(here[1])), yaw), standing, turning)
    end = _backed(world, stance, standing, turning)
    way = None if start is None or end is None else turning.way(start.xy, end.xy)
    if way is None and world.body.sideways and (carried := _carried(world, standing, stance)):
        return (yield [*_keeping(world, carried), *last])
    if way is None and stands_up and world.body.opening is None and (yield from _stood_up(world)):
        return (yield from _go(world, stance))
    if way is None and not world.body.sideways and (swung := _swung(world, standing, stance)):
        return (yield [*_keeping(world, swung), *last])
    if way is None:  # what is held may touch something where the way turns
        way = world.floor(holding=True, ahead=True).way(here, stance.xy)
        way = standing.way(here, stance.xy) if way is None else way
        program = drive(way, stance.yaw, RUSH if world.crosses else None) if way is not None else []
        return "no_path" if way is None else (yield [*_keeping(world, program), *last])
    assert start is not None and end is not None
    program = [] if start.xy == (here[0], here[1]) else [shift(start)]
    program += drive(way, stance.yaw, RUSH if world.crosses else None)
    return (yield [*_keeping(world, [*program, *([] if end.xy == stance.xy else [shift(stance)])]), *last])


def _stood_up(world: PlannedWorld) -> Generator[Program, str, bool]:
    """Turns long things that hands hold upright; returns whether there was one."""
    turned = False
    for hand, name in enumerate(world.held):
        if name and world.held.count(name) == 1 and not world.domain.fixed(name) and (turns := stood_up(world, hand)):
            yield turns
            turned = True
    return turned


def _carried(world: PlannedWorld, standing: FreeFloor, stance: Stance) -> Program:
    """The program of a base that goes sideways and backwards where there is no room to turn with what is held; empty:
    there is no such way."""
    points = standing.way(world.base[0], stance.xy)
    grips = {h: world.grip(h) for h, n in enumerate(world.held) if n and not world.domain.fixed(n)}
    alone = all(world.held.count(world.held[h]) == 1 for h in grips)  # two hands raise nothing one after the other
    higher = [up for up in HIGHER if all(world.reaches(h, world.stance, g + up * UP) for h, g in grips.items())]
    found = None if points is None else carried_way(world, points, stance.yaw, higher if alone else ())
    if found is None:
        return []
    stances, up = found
    raises = [
        Phase(hand=h, pos=vector3(g + up * UP), tolerance=0.04, limit=25, after="")
        for h, g in grips.items()
        if up > 0.0
    ]
    program, before = list[Phase](raises), world.base[0]
    for there in stances:
        limit = AT_LEAST + int(np.linalg.norm(np.subtract(there.xy, before)) / SLOWEST)
        program.append(dataclasses.replace(shift(there), tolerance=0.05, turn_tolerance=0.12, limit=limit))
        before = there.xy
    return [*program, shift(stance)]


def _swung(world: PlannedWorld, standing: FreeFloor, stance: Stance) -> Program:
    """The program of a base on wheels that has nowhere room for a whole turn with what is held: it backs off as little
    as that takes to turn to its way, and comes to the stance from behind, as far off as it takes to turn there; it
    turns by the side with room, the shorter one first. Where it has none, what is held may be close to other things;
    and where there is none at the end, it turns there as it is. Empty: it cannot turn to its way, or there is none."""
    (here, yaw), ahead = world.base, world.floor(holding=True, ahead=True)
    now, last = Stance((float(here[0]), float(here[1])), yaw), list[Phase]()
    for share in (1.0, TOUCHES):
        for off in OFF_TO_TURN:
            start = _behind(world, standing, now, off, share)
            for before in OFF_TO_TURN if start is not None else ():
                end = _behind(world, standing, stance, before, share)
                if start is None or end is None:
                    continue
                way = ahead.way(start.xy, end.xy)
                way = standing.way(start.xy, end.xy) if way is None else way
                if way is None:
                    return []
                turns = _turn(world, start, _heading(way, yaw), share)
                if turns is None:
                    break
                begins = [*([shift(start)] if off > 0.0 else []), *turns, *drive(way, None)]
                arrived = dataclasses.replace(end, yaw=_heading(way[::-1], yaw + np.pi) - np.pi)
                ends = _turn(world, arrived, stance.yaw, share)
                if ends is not None:
                    return [*begins, *ends, *([shift(stance)] if before > 0.0 else [])]
                if not last and before == 0.0:
                    last = [*begins, _turns_to(stance.yaw)]
    return last


def _heading(way: Float[np.ndarray, "N 2"], yaw: float) -> float:
    """Direction in which a way begins, rad, without points that a base passes at once; `yaw`: it is no longer."""
    far = way[np.linalg.norm(way - way[0], axis=1) > PASSED]
    return float(np.arctan2(*(far[0] - way[0])[::-1])) if len(far) else yaw


def _behind(world: PlannedWorld, standing: FreeFloor, stance: Stance, off: float, share: float) -> Stance | None:
    """A stance straight behind another, m, where the robot can stand and come from with what it holds; None: it
    cannot. `share`: of `clear_with_held`."""
    x, y = np.array(stance.xy) - off * np.array([np.cos(stance.yaw), np.sin(stance.yaw)])
    there = dataclasses.replace(stance, xy=(float(x), float(y)))
    if off == 0.0:
        return there
    free = standing.nearest(there.xy, RESOLUTION) is not None
    return there if free and clear_with_held(world, _between(there, stance)[:-1], share) else None


def _turn(world: PlannedWorld, stance: Stance, yaw: float, share: float) -> Program | None:
    """Phases that turn a base where it stands, so that what is held meets nothing: by the shorter side or the longer
    one; None: by both it would."""
    shorter = float((yaw - stance.yaw + np.pi) % (2 * np.pi) - np.pi)
    for by in (shorter, shorter - np.copysign(2 * np.pi, shorter)):
        yaws = stance.yaw + np.linspace(0.0, by, max(2, int(np.ceil(abs(by) / TURN_STEP)) + 1))[1:]
        if clear_with_held(world, [dataclasses.replace(stance, yaw=float(y)) for y in yaws], share):
            parts = stance.yaw + by * np.array([1.0] if by == shorter else [1 / 3, 2 / 3, 1.0])
            return [_turns_to(float(y)) for y in parts]
    return None


def _turns_to(yaw: float) -> Phase:
    """A base turns where it stands, rad."""
    return Phase(Base.TURN, yaw=yaw, turn_tolerance=0.06, limit=TURN_STEPS)


def _keeping(world: PlannedWorld, program: Program) -> Program:
    """The same, which ends where a hand loses what it holds: two hands are looked at in turns."""
    held = [world.index(n) for n in dict.fromkeys(world.held) if n and not world.domain.fixed(n)]
    if not held:  # it was lost while the hands got ready
        return program
    return [dataclasses.replace(p, keeps=held[k % len(held)]) for k, p in enumerate(program)]


def stretch(rise: float) -> Phase:
    """The body stretches or stoops, m."""
    return Phase(rise=rise, limit=20, after="")


def nearer(
    world: PlannedWorld, hand: int, quat: Sequence[float] | np.ndarray, point: Vector
) -> Generator[Program, str, bool]:
    """A base on wheels goes a little on where it has stopped short of where its arm reaches a point, m, with the hand
    turned to `quat`; returns whether it did. It does not where it has no room to."""
    held = world.held[hand]
    follows = world.follows(hand, quat, world.obstacles([held] if held else []))
    (here, yaw) = world.base
    front = np.array([np.cos(yaw), np.sin(yaw)])
    if follows is None or follows.reaches(point) or front @ (point[:2] - here) <= 0.0:
        return False
    if world.floor().nearest((here + FARTHER * front).tolist(), RESOLUTION) is None:
        return False
    x, y = (float(v) for v in here + (FARTHER + STOPS) * front)
    keeps = world.index(held) if held else -1
    yield [dataclasses.replace(shift(Stance((x, y), yaw), keeps, within=BACK_STEPS), tolerance=STOPS)]
    return True


def tuck(world: PlannedWorld) -> Program:
    """Fingers of empty hands that float point up, so that the robot fits where they would stick out."""
    if world.body.tucked is None:
        return []
    return [
        Phase(hand=hand, pos=vector3(world.body.tucked[hand]), quat=world.body.turned(hand, UP, FORWARDS), in_body=True,
              tolerance=0.05, turn_tolerance=0.3, limit=15, after="")
        for hand, name in enumerate(world.held) if not name
    ]  # fmt: skip


def drive_near(world: PlannedWorld, name: str) -> Generator[Program, str, tuple[str, str]]:
    """Drives a base without hands to near an object, and faces it; returns reason and detail of a failure."""
    here, _ = world.base
    point = world.com(name)[:2]
    floor = world.floor()
    cells = floor.within(point, NEAR)
    if not len(cells):
        return "no_base", f"there is no free floor within {NEAR:g} m of {name}"
    middles = floor.occupancy.middles(cells)
    cost = floor.distances(here, NEAR_START)[tuple(cells.T)] + np.linalg.norm(middles - point, axis=1)
    best = int(np.argmin(cost))
    goal = (float(middles[best][0]), float(middles[best][1]))
    way = floor.way(here, goal) if np.isfinite(cost[best]) else None
    if way is None:
        return "no_path", f"no path leads to {name} (open the doors in between)"
    ahead = point - middles[best]
    reason = yield drive(way, float(np.arctan2(ahead[1], ahead[0])))
    return reason, ""


def _backed(world: PlannedWorld, stance: Stance, standing: FreeFloor, turning: FreeFloor) -> Stance | None:
    """The nearest stance straight behind one where there is room to turn, with free floor up to there."""
    back = -np.array([np.cos(stance.yaw), np.sin(stance.yaw)])
    for apart in BACK:
        x, y = np.array(stance.xy) + apart * back
        there = Stance((float(x), float(y)), stance.yaw)
        if apart > 0 and standing.nearest(there.xy, RESOLUTION) is None:
            return None
        short = there.xy if world.body.sideways or apart == 0.0 else np.array(there.xy) - SHORT * back
        if turning.nearest(there.xy, RESOLUTION) is None or turning.nearest(short, RESOLUTION) is None:
            continue
        return there if apart == 0 or clear_with_held(world, _between(there, stance)) else None
    return None


def _between(start: Stance, end: Stance) -> list[Stance]:
    count = max(2, int(np.linalg.norm(np.subtract(end.xy, start.xy)) / STEP) + 1)
    points = np.linspace(start.xy, end.xy, count)
    return [Stance((float(x), float(y)), end.yaw) for x, y in points]


def drive(points: np.ndarray, yaw: float | None, speed: float | None = None) -> Program:
    """The program that follows a way, and at its end turns; `speed`: m in an agent step, None: `phases.SPEED`."""
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1)
    program = [
        Phase(
            Base.DRIVE, xy=(float(x), float(y)), tolerance=PASSED, limit=AT_LEAST + int(length / SLOWEST), speed=speed
        )
        for (x, y), length in zip(points[1:], apart, strict=True)
    ]
    if program:
        program[-1] = dataclasses.replace(program[-1], tolerance=0.025)
    if yaw is not None:
        program.append(_turns_to(float(yaw)))
    return program


def shift(stance: Stance, keeps: int = -1, within: int | None = None) -> Phase:
    """Goes straight to a stance without turning to its way.

    Args:
      keeps: `Phase.keeps`. within: agent steps after which the program goes on in any case; None: it has to get there.
    """
    phase = Phase(Base.SHIFT, xy=stance.xy, yaw=stance.yaw, keeps=keeps, tolerance=0.025, turn_tolerance=0.06)
    return phase if within is None else dataclasses.replace(phase, limit=within, after="")
