"""Keeping a link's pieces to a budget: convex pieces are merged, two at a time, where that adds least volume, and only
as far as the volume's error and the openings allow."""

from __future__ import annotations

import dataclasses
import heapq
from collections.abc import Sequence

import numpy as np

from .convex import Hull, hull_of, union_volume
from .openings import Openings

NEIGHBOURS = 10
"""Each piece is tried with this many of the nearest others."""
ALL_PAIRS = 40
"""Up to this many pieces every pair is tried."""


@dataclasses.dataclass
class Merged:
    """A piece after merging: its hull and the numbers of the pieces it was made of."""

    hull: Hull
    members: tuple[int, ...]


class Merging:
    """Which pieces are merged, one pair after the other, by least added volume.

    The added volume of a pair is that of their common hull less their own. Only near pieces are paired (and after a
    merge the neighbours of both), so hundreds of pieces take well under a second per hundred. A linear map multiplies
    all volumes by one factor, so the order is the same for a model of any size.

    Args:
      least: so far the merging goes, if there are more pieces.
    """

    def __init__(self, hulls: Sequence[Hull], least: int):
        if least < 1:
            raise ValueError(f"limit is {least}, must be at least 1")
        self._count = len(hulls)
        self._pieces = {i: Merged(h, (i,)) for i, h in enumerate(hulls)}
        self._alive = set(self._pieces)
        self._low = {i: h.vertices.min(axis=0) for i, h in enumerate(hulls)}
        self._high = {i: h.vertices.max(axis=0) for i, h in enumerate(hulls)}
        self._near = {i: set[int]() for i in self._pieces}
        self._queue: list[tuple[float, int, int]] = []
        self._joint: dict[tuple[int, int], Hull] = {}
        self._steps: list[tuple[int, int, int]] = []
        if self._count > least:
            for i in list(self._pieces):
                self._offer_near(i, self._count if self._count <= ALL_PAIRS else NEIGHBOURS)
            self._merge(least)

    @property
    def fewest(self) -> int:
        """The smallest number of pieces that was reached."""
        return self._count - len(self._steps)

    def at(self, count: int) -> list[Merged]:
        """The pieces when there are `count` of them (or as near as it gets), in the order of their first members."""
        alive = set(range(self._count))
        for i, j, joined in self._steps[: max(self._count - count, 0)]:
            alive -= {i, j}
            alive.add(joined)
        return sorted((self._pieces[i] for i in alive), key=lambda m: min(m.members))

    def _merge(self, least: int) -> None:
        fresh = self._count
        while len(self._alive) > least:
            if not self._queue:  # what is left is far apart: pair everything with everything
                before = len(self._joint)
                for i in sorted(self._alive):
                    self._offer_near(i, len(self._alive))
                if len(self._joint) == before:
                    break
                continue
            _, i, j = heapq.heappop(self._queue)
            hull = self._joint.pop((i, j), None)
            if hull is None or i not in self._alive or j not in self._alive:
                continue
            self._alive -= {i, j}
            self._pieces[fresh] = Merged(hull, self._pieces[i].members + self._pieces[j].members)
            self._low[fresh] = np.minimum(self._low[i], self._low[j])
            self._high[fresh] = np.maximum(self._high[i], self._high[j])
            self._near[fresh] = set()
            self._alive.add(fresh)
            self._steps.append((i, j, fresh))
            for k in sorted((self._near[i] | self._near[j]) & self._alive):
                self._offer(fresh, k)
            if len(self._alive) > 1 and not self._near[fresh]:
                self._offer_near(fresh, NEIGHBOURS)
            fresh += 1

    def _offer(self, i: int, j: int) -> None:
        i, j = min(i, j), max(i, j)
        if i == j or (i, j) in self._joint:
            return
        a, b = self._pieces[i].hull, self._pieces[j].hull
        hull = hull_of(np.concatenate([a.vertices, b.vertices]))
        if hull is None:
            return
        self._near[i].add(j)
        self._near[j].add(i)
        self._joint[i, j] = hull
        heapq.heappush(self._queue, (hull.volume - a.volume - b.volume, i, j))

    def _offer_near(self, i: int, count: int) -> None:
        others = [j for j in sorted(self._alive) if j != i]
        low, high = np.array([self._low[j] for j in others]), np.array([self._high[j] for j in others])
        gaps = np.maximum(low - self._high[i], self._low[i] - high).clip(0)
        middles = 0.5 * (low + high) - 0.5 * (self._low[i] + self._high[i])
        rank = np.linalg.norm(gaps, axis=1) + 0.01 * np.linalg.norm(middles, axis=1)
        for k in np.argsort(rank, kind="stable")[:count]:
            self._offer(i, others[int(k)])


@dataclasses.dataclass
class Budgeted:
    """Pieces that keep to a budget.

    Attributes:
      pieces: the pieces.
      volume_error: of their union against that of the pieces before, relative.
      open: every inside is still open.
      needed: so many pieces would keep error and openings within the limits; `len(pieces)` where they do.
    """

    pieces: list[Merged]
    volume_error: float
    open: bool
    needed: int


def keep_to_budget(
    hulls: Sequence[Hull],
    others: Sequence[Hull],
    few: int,
    most: int,
    max_volume_error: float,
    reference: float | None = None,
) -> Budgeted:
    """As few pieces, from `few` to `most`, as keep the volume's error small and the openings open.

    Where even `most` do not, that many.

    Args:
      others: pieces of the same link that are never merged (primitives of the source).
      reference: m3 that the error is relative to; default that of the union.
    """
    few, most = min(few, most), min(most, len(hulls))
    if len(hulls) <= few:
        return Budgeted([Merged(h, (i,)) for i, h in enumerate(hulls)], 0.0, True, len(hulls))
    merging = Merging(hulls, few)
    before = union_volume([*hulls, *others])
    openings = Openings([*hulls, *others])
    tried: dict[int, Budgeted] = {}

    def at(count: int) -> Budgeted:
        if count not in tried:
            pieces = merging.at(count)
            now = [*(p.hull for p in pieces), *others]
            tried[count] = Budgeted(
                pieces, (union_volume(now) - before) / (reference or before), openings.stay_open(now), count
            )
        return tried[count]

    def good(count: int) -> bool:
        return at(count).volume_error <= max_volume_error and at(count).open

    low, high = max(few, merging.fewest), len(hulls)  # with all of them nothing is lost
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if good(middle) else (middle + 1, high)
    return at(low) if low <= most else dataclasses.replace(at(max(most, merging.fewest)), needed=low)


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
