"""Ways of a base that moves in any direction, along which what its hands hold meets nothing.

A way over the floor is gone along with headings that change on it: where there is no room to turn, the robot goes
sideways or backwards, and turns where there is. Searched are places of the way times `HEADINGS`.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.planning.moves import TOUCHES
from ig2mj.planning.world import HIGHEST, PlannedWorld, Stance

HEADINGS, APART = 16, 0.1
"""Directions that the robot may face on the way, and m between the places of the way at which it may turn, at most."""

BETWEEN = 0.05
"""m that what is held moves between the poses that are looked at on the way from one place or heading to the next: a
turn by one heading would take it past the back of a chair."""

TURN = 0.15
"""m of way that a turn by one heading counts as."""


def carried_way(
    world: PlannedWorld, points: Float[np.ndarray, "N 2"], yaw: float, higher: Sequence[float] = ()
) -> tuple[list[Stance], float] | None:
    """Stances one after another, between which the base shifts, or turns where it is, and m by which its hands are
    raised before; None: there is no such way. Where there is none on which what is held keeps clear, it is raised, or
    brought past other things closely; where there is none, either, it may brush past them between two headings.

    Args:
      points: of a way over the floor; the first is where the robot is. yaw: rad, at its end. higher: m by which hands
        may be raised, as over the backs of chairs.
    """
    clearly = [(1.0, True, up) for up in (0.0, *higher) if up + float(_held(world)[:, 2].max(initial=0.0)) < HIGHEST]
    closely = [(TOUCHES, True, 0.0), (1.0, False, 0.0), (TOUCHES, False, 0.0)]
    for share, fine, up in (*(clearly or [(1.0, True, 0.0)]), *closely):
        if (way := _carried_way(world, points, yaw, share, fine, up)) is not None:
            return way, up
    return None


def _carried_way(
    world: PlannedWorld, points: Float[np.ndarray, "N 2"], yaw: float, share: float, fine: bool, up: float
) -> list[Stance] | None:
    """`carried_way` with a share of the radii of what is held, raised by `up`, m. fine: it keeps clear between two
    headings, too."""
    places = _sampled(points)
    (here, now), last = world.base, len(places) - 1
    held = _held(world) * (1.0, 1.0, 1.0, share) + (0.0, 0.0, up, 0.0)
    obstacles = world.obstacles([n for n in world.held if n and not world.domain.fixed(n)])
    step = 2 * np.pi / HEADINGS
    goal = last, round((yaw - now) / step) % HEADINGS
    known: dict[tuple[int, int], bool] = {(0, 0): True}
    passed = dict[tuple[tuple[int, int], tuple[int, int]], bool]()
    reach = float(np.linalg.norm(held[:, :2], axis=1).max(initial=0.0))
    turning = max(1, int(np.ceil(step * reach / BETWEEN)))

    def at_pose(xy: np.ndarray, heading: float) -> np.ndarray:
        there = held[:, :3] @ about_vertical(now + step * heading).T + np.array([*xy, 0.0])
        return np.concatenate([there, held[:, 3:]], axis=1)

    def clear(state: tuple[int, int]) -> bool:
        if state not in known:
            known[state] = obstacles.clear(at_pose(places[state[0]], float(state[1])))
        return known[state]

    def passes(state: tuple[int, int], other: tuple[int, int]) -> bool:
        """Whether what is held keeps clear between two neighbouring states; where the robot is now, it may touch
        something."""
        if other == (0, 0):
            return passes(other, state)
        key = (state, other) if state < other or state == (0, 0) else (other, state)
        if key not in passed:
            state, other = key
            (a, b), side = (state[0], other[0]), (other[1] - state[1] + 1) % HEADINGS - 1
            count = turning if a == b else max(1, int(np.ceil(np.linalg.norm(places[b] - places[a]) / BETWEEN)))
            shares = np.arange(1 if state != (0, 0) else max(1, count // 2), count) / count
            poses = [at_pose(places[a] + t * (places[b] - places[a]), state[1] + t * side) for t in shares]
            passed[key] = not poses or obstacles.clear(np.concatenate(poses))
        return passed[key]

    costs, before = {(0, 0): 0.0}, dict[tuple[int, int], tuple[int, int]]()
    queue = [(0.0, (0, 0))]
    while queue:
        cost, state = heapq.heappop(queue)
        if state == goal:
            break
        if cost > costs[state]:
            continue
        at, heading = state
        turns = [((at, (heading + side) % HEADINGS), TURN) for side in (1, -1)]
        moves = [((at + side, heading), APART) for side in (1, -1) if 0 <= at + side <= last]
        for other, extra in (*moves, *turns):
            if cost + extra < costs.get(other, np.inf) and clear(other) and (not fine or passes(state, other)):
                costs[other], before[other] = cost + extra, state
                heapq.heappush(queue, (cost + extra, other))
    if goal not in costs:
        return None
    states = [goal]
    while states[-1] in before:
        states.append(before[states[-1]])
    found = [Stance((float(places[at][0]), float(places[at][1])), now + step * heading) for at, heading in states[::-1]]
    return _merged([*found[1:], Stance(found[-1].xy, yaw)], Stance((float(here[0]), float(here[1])), now))


def _held(world: PlannedWorld) -> Float[np.ndarray, "n 4"]:
    """Spheres of hands with what they hold, about the base, as if it faced along x."""
    here, now = world.base
    found = [np.zeros((0, 4))]
    for hand, name in enumerate(world.held):
        if name and not world.domain.fixed(name):
            spheres = world.spheres(*world.hand_axes(hand), holding=name, hand=hand)
            about = (spheres[:, :3] + world.grip(hand) - np.array([*here, 0.0])) @ about_vertical(now)
            found.append(np.concatenate([about, spheres[:, 3:]], axis=1))
    return np.concatenate(found)


def _sampled(points: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "M 2"]:
    """Points of a way with those between them."""
    found = [points[:1]]
    for a, b in itertools.pairwise(points):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / APART)))
        found.append(a + np.linspace(0, 1, count + 1)[1:, None] * (b - a))
    return np.concatenate(found)


def _merged(stances: list[Stance], before: Stance) -> list[Stance]:
    """Without those between which the robot goes straight on, or turns on."""
    kept: list[Stance] = []
    for stance in stances:
        if kept:
            last = kept[-2] if len(kept) > 1 else before
            one, two = np.subtract(kept[-1].xy, last.xy), np.subtract(stance.xy, kept[-1].xy)
            far = float(np.linalg.norm(one)), float(np.linalg.norm(two))
            turned, turns = kept[-1].yaw - last.yaw, stance.yaw - kept[-1].yaw
            ahead = min(far) > 1e-6 and float(one @ two) > 0.9999 * far[0] * far[1] and abs(turned) + abs(turns) < 1e-6
            if ahead:
                kept.pop()
        kept.append(stance)
    return kept
