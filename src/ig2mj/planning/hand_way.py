"""`HandWay`: a way of a hand from one pose to another: the straight line, via points, then RRT-Connect.

A state is x, y, z of the grasp point (m) and the share of the turn from the first orientation to the last.
"""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import quat_conjugate, quat_multiply, quat_to_rotation_vector
from ig2mj.planning.hand_collision import HandCollision, Pairs
from ig2mj.planning.rrt_connect import is_installed, rrt_connect

STEP, TURN_STEP = 0.02, 0.1
"""m and rad between the states at which a way is checked."""

NEAR_END = 0.05
"""m from start and goal within which what is touched there does not count."""

LIFTS = (0.1, 0.25, 0.45)
"""m above start and goal at which a hand goes across."""

AROUND, TURN_LENGTH = 0.6, 0.2
"""m about start and goal in which RRT-Connect looks; m of way that count as much as a radian of turning."""

State = Float[np.ndarray, "4"]


class HandWay:
    """See the module's text.

    Attributes:
      blocking: geoms of other things that the hand would stand in at the goal, but for those that it touches at the
        start.
    """

    def __init__(
        self,
        collision: HandCollision,
        start: Float[np.ndarray, "3"],
        first: Float[np.ndarray, "4"],
        goal: Float[np.ndarray, "3"],
        last: Float[np.ndarray, "4"],
    ):
        """`start`, `goal`: of the grasp point, m; `first`, `last`: orientations there, w-x-y-z; world frame."""
        self._collision, self._first = collision, first
        self._turn = quat_to_rotation_vector(quat_multiply(last, quat_conjugate(first)))
        self._angle = float(np.linalg.norm(self._turn))
        self._start, self._goal = np.array([*start, 0.0]), np.array([*goal, 1.0])
        self._touched = collision.near(start, first)
        self.blocking = {other for _, other in collision.near(goal, last, self._touched)}

    def turned(self, share: Float[np.ndarray, "N"]) -> Float[np.ndarray, "N 4"]:
        """Orientations, w-x-y-z, at shares of the turn."""
        half = np.asarray(share, float)[:, None] * self._angle / 2
        axis = self._turn / max(self._angle, 1e-9)
        return quat_multiply(np.concatenate([np.cos(half), np.sin(half) * axis], axis=1), self._first)

    def _ignored(self, point: Float[np.ndarray, "3"]) -> Pairs:
        near = min(np.linalg.norm(point - self._start[:3]), np.linalg.norm(point - self._goal[:3])) < NEAR_END
        return self._touched if near else frozenset()

    def is_free(self, state: State) -> bool:
        """Whether the hand is clear there."""
        quat = self.turned(state[3:])[0]
        return self._collision.clear(state[:3], quat, self._ignored(state[:3]))

    def is_clear(self, one: State, other: State) -> bool:
        """Whether the hand is clear along a line."""
        far = float(np.linalg.norm((other - one)[:3])) / STEP
        count = int(np.ceil(max(far, abs(other[3] - one[3]) * self._angle / TURN_STEP))) + 1
        return all(self.is_free(one + share * (other - one)) for share in np.linspace(0.0, 1.0, count))

    def find(self, checks: int, seed: int) -> tuple[Float[np.ndarray, "N 4"] | None, str]:
        """States of a way, the start first, and the method that found it; None: none was found."""
        if self.is_clear(self._start, self._goal):
            return np.stack([self._start, self._goal]), "straight"
        for way in self._vias():
            points = [self._start, *way, self._goal]
            if all(self.is_clear(a, b) for a, b in itertools.pairwise(points)):
                return np.stack(points), "via"
        if not is_installed():
            return None, ""
        scale = np.array([1.0, 1.0, 1.0, max(TURN_LENGTH * self._angle, 1e-3)])
        low = np.array([*(np.minimum(self._start, self._goal)[:3] - AROUND), 0.0])
        high = np.array([*(np.maximum(self._start, self._goal)[:3] + AROUND), 1.0])
        found = rrt_connect(
            lambda state: self.is_free(state / scale),
            *(x * scale for x in (self._start, self._goal, low, high)),
            resolution=STEP,
            checks=checks,
            seed=seed,
        )
        return (None, "") if found is None else (found / scale, "rrt_connect")

    def _vias(self) -> list[list[State]]:
        """Points on the way: up and across, or across first; the hand turns while it goes across."""
        start, goal = self._start, self._goal
        ways = []
        for lift in LIFTS:
            top = max(start[2], goal[2]) + lift
            ways.append([np.array([*start[:2], top, 0.0]), np.array([*goal[:2], top, 1.0])])
        ways.append([np.array([*start[:2], goal[2], 0.0])])
        ways.append([np.array([*goal[:2], start[2], 1.0])])
        return ways
