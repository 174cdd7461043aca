"""Ways of a hand around obstacles: RRT-Connect over the positions of its grasp point, with its orientation as it is.

It is for what neither a straight line nor via points find. Positions are sampled by a generator with a fixed seed, so
that the same world gives the same way.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ig2mj.planning.clearance import Obstacles, straight

Vector = Float[np.ndarray, "3"]

AROUND = 0.5
"""m about start and goal in which a way is looked for."""

STRIDE, SAMPLES = 0.2, 80
"""m by which a tree grows at once, and positions that are sampled."""

SHORTCUTS = 12
"""Pairs of points of a way that are joined by a straight line where it is free."""


def search_way(
    obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"], start: Vector, goal: Vector
) -> list[Vector] | None:
    """Points of a way between two positions where the hand is clear, without the first; None: none was found."""

    def free(a: Vector, b: Vector) -> bool:
        return straight(obstacles, spheres, a, b)

    if not (free(start, start + 1e-4) and free(goal, goal + 1e-4)):
        return None
    low, high = np.minimum(start, goal) - AROUND, np.maximum(start, goal) + AROUND
    way = connect(free, start, goal, low, high)
    return None if way is None else way[1:]


def connect(
    free: Callable[[np.ndarray, np.ndarray], bool],
    start: Float[np.ndarray, "n"],
    goal: Float[np.ndarray, "n"],
    low: Float[np.ndarray, "n"],
    high: Float[np.ndarray, "n"],
    stride: float = STRIDE,
    samples: int = SAMPLES,
    seed: int = 0,
) -> list[np.ndarray] | None:
    """RRT-Connect: points of a way between two free points of a space, the start first; None: none was found.

    Args:
      free: whether a straight line is. low, high: bounds of the points that are sampled. stride: of a tree, at once.
    """
    rng = np.random.default_rng(seed)
    grown, other = _Tree([start], [-1]), _Tree([goal], [-1])
    for _ in range(samples):
        aim = rng.uniform(low, high)
        new = grown.extend(aim, free, stride)
        if new is not None:
            at = other.nearest(new)
            while (met := other.extend(new, free, stride, at)) is not None:
                at = len(other.points) - 1
                if np.linalg.norm(met - new) < 1e-6:
                    ways = grown.back(len(grown.points) - 1), other.back(at)
                    one, two = ways if np.array_equal(grown.points[0], start) else ways[::-1]
                    return _shortened([*one[::-1], *two[1:]], free, rng)
        grown, other = other, grown
    return None


@dataclasses.dataclass
class _Tree:
    points: list[Vector]
    parents: list[int]

    def nearest(self, point: Vector) -> int:
        return int(np.argmin(np.linalg.norm(np.array(self.points) - point, axis=1)))

    def extend(self, aim: Vector, free, stride: float, at: int | None = None) -> Vector | None:
        """A new point at most `stride` nearer to an aim; None: the way there is not free."""
        near = self.nearest(aim) if at is None else at
        way = aim - self.points[near]
        apart = float(np.linalg.norm(way))
        if apart < 1e-9:
            return None
        new = aim if apart <= stride else self.points[near] + stride / apart * way
        if not free(self.points[near], new):
            return None
        self.points.append(new)
        self.parents.append(near)
        return new

    def back(self, at: int) -> list[Vector]:
        """Points from one to the root."""
        found = []
        while at >= 0:
            found.append(self.points[at])
            at = self.parents[at]
        return found


def _shortened(points: list[Vector], free, rng: np.random.Generator) -> list[Vector]:
    for _ in range(SHORTCUTS):
        if len(points) < 3:
            break
        first, last = sorted(rng.choice(len(points), 2, replace=False).tolist())
        if last > first + 1 and free(points[first], points[last]):
            points = [*points[: first + 1], *points[last:]]
    return points
