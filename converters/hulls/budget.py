"""Keeping a link's pieces to a budget: convex pieces are merged, two at a time, where that adds least volume."""

from __future__ import annotations

import dataclasses
import heapq
from collections.abc import Sequence

import numpy as np

from .convex import Hull, hull_of

NEIGHBOURS = 10
"""Each piece is tried with this many of the nearest others."""
ALL_PAIRS = 40
"""Up to this many pieces every pair is tried."""


@dataclasses.dataclass
class Merged:
    """A piece after merging: its hull and the numbers of the pieces it was made of."""

    hull: Hull
    members: tuple[int, ...]


def merge_to_budget(hulls: Sequence[Hull], limit: int) -> list[Merged]:
    """At most `limit` pieces, merged greedily by least added volume; in the order of their first members.

    The added volume of a pair is that of their common hull less their own. Only near pieces are paired (and after a
    merge the neighbours of both), so hundreds of pieces take well under a second per hundred.
    """
    if limit < 1:
        raise ValueError(f"limit is {limit}, must be at least 1")
    alive = {i: Merged(h, (i,)) for i, h in enumerate(hulls)}
    low = {i: h.vertices.min(axis=0) for i, h in enumerate(hulls)}
    high = {i: h.vertices.max(axis=0) for i, h in enumerate(hulls)}
    near = {i: set[int]() for i in alive}
    queue: list[tuple[float, int, int]] = []
    joint: dict[tuple[int, int], Hull] = {}

    def offer(i: int, j: int) -> None:
        if i == j or (min(i, j), max(i, j)) in joint:
            return
        i, j = min(i, j), max(i, j)
        a, b = alive[i].hull, alive[j].hull
        hull = hull_of(np.concatenate([a.vertices, b.vertices]))
        if hull is None:
            return
        near[i].add(j)
        near[j].add(i)
        joint[i, j] = hull
        heapq.heappush(queue, (hull.volume - a.volume - b.volume, i, j))

    def offer_near(i: int, count: int) -> None:
        others = [j for j in alive if j != i]
        gaps = np.maximum(
            np.array([low[j] for j in others]) - high[i], low[i] - np.array([high[j] for j in others])
        ).clip(0)
        middles = np.array([0.5 * (low[j] + high[j]) for j in others]) - 0.5 * (low[i] + high[i])
        rank = np.linalg.norm(gaps, axis=1) + 0.01 * np.linalg.norm(middles, axis=1)
        for k in np.argsort(rank, kind="stable")[:count]:
            offer(i, others[int(k)])

    if len(alive) > limit:
        for i in list(alive):
            offer_near(i, len(alive) if len(alive) <= ALL_PAIRS else NEIGHBOURS)
    fresh = len(hulls)
    while len(alive) > limit:
        if not queue:  # what is left is far apart: pair everything with everything
            before = len(joint)
            for i in list(alive):
                offer_near(i, len(alive))
            if len(joint) == before:
                break
            continue
        _, i, j = heapq.heappop(queue)
        hull = joint.pop((i, j), None)
        if hull is None or i not in alive or j not in alive:
            continue
        a, b = alive.pop(i), alive.pop(j)
        alive[fresh] = Merged(hull, a.members + b.members)
        low[fresh], high[fresh] = np.minimum(low[i], low[j]), np.maximum(high[i], high[j])
        near[fresh] = set()
        for k in sorted((near[i] | near[j]) & alive.keys()):
            offer(fresh, k)
        if len(alive) > 1 and not near[fresh]:
            offer_near(fresh, NEIGHBOURS)
        fresh += 1
    return sorted(alive.values(), key=lambda m: min(m.members))


def drop_contained(hulls: Sequence[Hull], slack: float) -> list[int]:
    """Numbers of the hulls that are not wholly inside another (up to `slack` metres); of equal ones the first stays."""
    order = sorted(range(len(hulls)), key=lambda i: (-hulls[i].volume, i))
    kept: list[int] = []
    for i in order:
        own = hulls[i]
        low, high = own.vertices.min(axis=0) + slack, own.vertices.max(axis=0) - slack
        for j in kept:
            other = hulls[j].vertices
            if np.any(other.min(axis=0) > low + slack) or np.any(other.max(axis=0) < high - slack):
                continue
            if hulls[j].contains(own.vertices, slack).all():
                break
        else:
            kept.append(i)
    return sorted(kept)
