"""Ways of a base that moves in any direction, along which what its hands hold meets nothing.

A way over the floor is gone along with headings that change on it: where there is no room to turn, the robot goes
sideways or backwards, and turns where there is. Searched are places of the way times `HEADINGS`.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.moves import TOUCHES
from ig2mj.planning.world import HIGHEST, PlannedWorld, Stance

HEADINGS, APART = 16, 0.1
"""Directions that the robot may face on the way, and m between the places of the way at which it may turn, at most."""

BETWEEN = 0.05
"""m that what is held moves between the poses that are looked at on the way from one place or heading to the next: a
turn by one heading would take it past the back of a chair."""

TURN = 0.15
"""m of way that a turn by one heading counts as."""

DIGITS = 6
"""Decimals of m to which lengths of ways are compared."""


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
    room = _Room(obstacles, held, places, now, fine)
    step = 2 * np.pi / HEADINGS
    goal = last, round((yaw - now) / step) % HEADINGS
    if goal != (0, 0) and not room.clear(goal):
        return None

    def left(state: tuple[int, int]) -> float:
        """m that a way is at least as long as from a state, turns included."""
        turns = (goal[1] - state[1]) % HEADINGS
        return APART * (last - state[0]) + TURN * min(turns, HEADINGS - turns)

    costs, before = {(0, 0): 0.0}, dict[tuple[int, int], tuple[int, int]]()
    queue = [(left((0, 0)), 0, 0.0, 0)]
    while queue:
        _, behind, cost, heading = heapq.heappop(queue)  # of ways that promise as much, the one that turns last
        at = -behind
        state = at, heading
        if state == goal:
            break
        if cost > costs[state]:
            continue
        turns = [((at, (heading + side) % HEADINGS), TURN) for side in (1, -1)]
        moves = [((at + side, heading), APART) for side in (1, -1) if 0 <= at + side <= last]
        for other, extra in (*moves, *turns):
            whole = round(cost + extra, DIGITS)
            if whole < costs.get(other, np.inf) and room.clear(other) and room.passes(state, other):
                costs[other], before[other] = whole, state
                heapq.heappush(queue, (round(whole + left(other), DIGITS), -other[0], whole, other[1]))
    if goal not in costs:
        return None
    states = [goal]
    while states[-1] in before:
        states.append(before[states[-1]])
    found = [Stance((float(places[at][0]), float(places[at][1])), now + step * heading) for at, heading in states[::-1]]
    return _merged([*found[1:], Stance(found[-1].xy, yaw)], Stance((float(here[0]), float(here[1])), now))


class _Room:
    """Where what is held keeps clear: at places of a way in each heading, and between neighbouring ones. All places are
    looked at together, in a heading when it is first asked for.

    A state is the number of the place, and of the heading.
    """

    def __init__(
        self,
        obstacles: Obstacles,
        held: Float[np.ndarray, "n 4"],
        places: Float[np.ndarray, "M 2"],
        now: float,
        fine: bool,
    ):
        """
        Args:
          held: spheres about the base, as if it faced along x. now: rad, of heading 0. fine: what is held keeps clear
            between two headings, too.
        """
        reach = float(np.linalg.norm(held[:, :2], axis=1).max(initial=0.0))
        self._held, self._now, self._fine = held, now, fine
        self._places = np.column_stack([places, np.zeros(len(places))])
        wide, height = float(held[:, 3].max(initial=0.0)), held[:, 2]
        low, high = self._places.min(0) - reach - wide, self._places.max(0) + reach + wide
        low[2], high[2] = height.min(initial=np.inf) - wide, height.max(initial=-np.inf) + wide
        self._obstacles = obstacles.within(low, high)
        self._step = 2 * np.pi / HEADINGS
        self._turning = max(1, int(np.ceil(self._step * reach / BETWEEN)))
        self._at = dict[int, np.ndarray]()
        self._turns = dict[int, np.ndarray]()
        self._moves = dict[int, np.ndarray]()

    def clear(self, state: tuple[int, int]) -> bool:
        """Whether what is held keeps clear; where the robot is now, it may touch something."""
        place, heading = state
        if heading not in self._at:
            self._at[heading] = self._clear_at(float(heading), self._places)
            if heading == 0:
                self._at[heading][0] = True
        return bool(self._at[heading][place])

    def passes(self, state: tuple[int, int], other: tuple[int, int]) -> bool:
        """Whether what is held keeps clear between two neighbouring states; where the robot is now, it may touch
        something."""
        if not self._fine:
            return True
        if other == (0, 0):
            state, other = other, state
        place, heading = state
        side = (other[1] - heading + 1) % HEADINGS - 1
        if state == (0, 0):
            ahead = self._places[other[0]] - self._places[0]
            count = self._turning if side else _count(ahead)
            shares = np.arange(max(1, count // 2), count) / count
            return all(self._clear_at(float(t) * side, self._places[:1] + t * ahead)[0] for t in shares)
        if side:
            return bool(self._turns_from(heading if side > 0 else other[1])[place])
        return bool(self._moves_in(heading)[min(place, other[0])])

    def _turns_from(self, heading: int) -> Bool[np.ndarray, "M"]:
        """At which places there is room between a heading and the next one."""
        if heading not in self._turns:
            found = np.ones(len(self._places), bool)
            for t in np.arange(1, self._turning) / self._turning:
                rows = np.flatnonzero(found)
                found[rows] = self._clear_at(heading + float(t), self._places[rows])
            self._turns[heading] = found
        return self._turns[heading]

    def _moves_in(self, heading: int) -> Bool[np.ndarray, "n"]:
        """Between which places and the next ones there is room in a heading."""
        if heading not in self._moves:
            ahead = np.diff(self._places, axis=0)
            counts = np.array([_count(way) for way in ahead], int)
            found = np.ones(len(ahead), bool)
            for k in range(1, int(counts.max(initial=1))):
                rows = np.flatnonzero(found & (counts > k))
                share = (k / counts[rows])[:, None]
                found[rows] = self._clear_at(float(heading), self._places[rows] + share * ahead[rows])
            self._moves[heading] = found
        return self._moves[heading]

    def _clear_at(self, heading: float, points: Float[np.ndarray, "m 3"]) -> Bool[np.ndarray, "m"]:
        turned = self._held[:, :3] @ about_vertical(self._now + self._step * heading).T
        return self._obstacles.clear_at(np.column_stack([turned, self._held[:, 3]]), points)


def _count(ahead: Float[np.ndarray, "3"]) -> int:
    """Parts that a move is looked at in."""
    return max(1, int(np.ceil(np.linalg.norm(ahead) / BETWEEN)))


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
