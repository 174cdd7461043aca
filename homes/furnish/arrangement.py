"""All objects of a home and what is free between them: overlap tests on collision hulls, with every joint at 0.

Two hulls overlap unless a face normal of one of them separates them: a test that may say "overlap" for hulls that miss
each other edge to edge by little, and never the other way round.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from .placed import Hull, Placed, boxes_of

AIR = 0.0008
"""m, kept between an object and what it stands on: it settles by less than the converter's 5 mm."""
FLAT = ("carpet", "mat")
"""Categories that are walked and driven over: they need no air around them and block no way."""
WAY = "way"
"""Owner of the zones on both sides of doors and passages."""


class Arrangement:
    """The objects that stand, blocks of the building, and zones that moving parts sweep or people walk in.

    Attributes:
      objects: name -> Placed, in the order they were put.
    """

    def __init__(self, blocks: np.ndarray):
        """blocks: [n, 2, 3] boxes of walls; nothing may stand in them."""
        self.things: dict[str, Placed] = {}
        self._solid = _Groups([_Group(None, _block_hulls(np.asarray(blocks, float).reshape(-1, 2, 3)))])
        self._swept = _Groups([])
        self._ways: list[tuple[str, np.ndarray]] = []
        self._counts: dict[str, int] = {}

    def copy(self) -> Arrangement:
        """The same things, free to get others than this one."""
        other = Arrangement(np.zeros((0, 2, 3)))
        other.things, other._counts = dict(self.things), dict(self._counts)
        other._solid, other._swept = _Groups(self._solid.groups), _Groups(self._swept.groups)
        other._ways = list(self._ways)
        return other

    def rename(self, thing: Placed, name: str) -> None:
        """Gives an object that stands here another name."""
        old, thing.name = thing.name, name
        self.things = {other.name: other for other in self.things.values()}
        self._ways = [(name if owner == old else owner, zone) for owner, zone in self._ways]
        for other in self.things.values():
            other.host = name if other.host == old else other.host

    def name(self, category: str) -> str:
        """The next free name of a category: fridge_0, fridge_1, ..."""
        number = self._counts.get(category, 0)
        self._counts[category] = number + 1
        return f"{category}_{number}"

    def put(self, thing: Placed) -> Placed:
        """Adds an object where it is; ask `fits` first."""
        self.things[thing.name] = thing
        self._solid.add(_Group(thing, thing.parts()))
        swept = thing.swept()
        if swept:
            self._swept.add(_Group(thing, swept))
        return thing

    def keep_free(self, owner: str, boxes: np.ndarray) -> None:
        """Zones [n, 2, 3] where no furniture may stand: before a door, before a cupboard."""
        self._ways.append((owner, np.asarray(boxes, float).reshape(-1, 2, 3)))

    def fits(self, thing: Placed, *, ignore: Iterable[str] = (), gap: float = 0.0, ways: bool = True) -> bool:
        """Whether an object overlaps nothing that stands and nothing that moves, and its own moving parts meet
        nothing.

        Args:
          ignore: owners whose moving parts do not count (a cupboard's, for what lies in its drawer).
          gap: metres of air wanted between it and other things, box of hull against box of hull.
          ways: mind zones that are kept free, too.
        """
        return not self.obstacle(thing, ignore=ignore, gap=gap, ways=ways)

    def obstacle(self, thing: Placed, *, ignore: Iterable[str] = (), gap: float = 0.0, ways: bool = True) -> str:
        """Why an object does not fit, as the end of a sentence about it, or ''. Arguments as of `fits`."""
        mine = _Group(thing, thing.parts())
        ignored = {*ignore, thing.name, thing.host}
        if ways:
            for owner, zone in self._ways:
                if owner not in ignored and _overlaps(mine.boxes, zone).any():
                    return "stands in the way through a door or a passage" if owner == WAY else f"stands before {owner}"
        for other in self._solid.near(mine, gap):
            if mine.meets(other, 0.0 if other.low_lying else gap):
                how = "is too near to" if not mine.meets(other) else "overlaps"
                how = "stands only partly on" if other.thing is not None and other.low_lying else how
                return f"{how} {other.name or 'a wall'}"
        for other in self._swept.near(mine):
            if other.name not in ignored and mine.meets(other):
                return f"stands where {other.name} opens"
        if thing.shape.swept:
            moving = _Group(thing, thing.swept())
            for other in self._solid.near(moving):
                if moving.meets(other):
                    return f"cannot open: {other.name or 'a wall'} is in the way"
        return ""

    def free(self, zone: np.ndarray) -> bool:
        """Whether nothing but a carpet lies in a box [2, 3]."""
        requested = _Group(None, _block_hulls(zone[None]))
        near = self._solid.near(requested)
        return not any(
            _overlaps(requested.boxes, group.boxes).any()
            for group in near
            if group.thing is None or not group.low_lying
        )

    def overlapping_boxes(self) -> list[list[str]]:
        """Pairs of names whose world boxes intersect: misc/bbox_overlap.json."""
        names = list(self.things)
        boxes = np.array([self.things[n].box() for n in names]).reshape(-1, 2, 3)
        hit = np.triu(_overlaps(boxes, boxes), 1)
        return [sorted((names[i], names[j])) for i, j in np.argwhere(hit)]


class _Groups:
    """Groups that are found by where they are."""

    def __init__(self, groups: Iterable[_Group]):
        self.groups = list(groups)
        self._low, self._high = np.zeros((0, 3)), np.zeros((0, 3))

    def add(self, group: _Group) -> None:
        self.groups.append(group)

    def near(self, group: _Group, gap: float = 0.0) -> Iterator[_Group]:
        """Those whose box comes within `gap` of a group's."""
        if len(self._low) < len(self.groups):
            self._low = np.array([g.low for g in self.groups])
            self._high = np.array([g.high for g in self.groups])
        hit = np.all((self._low < group.high + gap) & (self._high > group.low - gap), axis=1)
        return (self.groups[k] for k in np.flatnonzero(hit))


class _Group:
    """Hulls of one object (None: the building), with the boxes around them and around all."""

    def __init__(self, thing: Placed | None, hulls: list[Hull]):
        self.thing, self.hulls = thing, hulls
        self.boxes = boxes_of(hulls)
        self.low = self.boxes[:, 0].min(0) if hulls else np.zeros(3)
        self.high = self.boxes[:, 1].max(0) if hulls else np.zeros(3)

    @property
    def name(self) -> str | None:
        return self.thing.name if self.thing else None

    @property
    def low_lying(self) -> bool:
        """The building, or what one walks on: nothing keeps a distance from it."""
        return self.thing is None or self.thing.category in FLAT

    def meets(self, other: _Group, gap: float = 0.0) -> bool:
        if np.any(self.low - gap >= other.high) or np.any(self.high + gap <= other.low):
            return False
        hit = _overlaps(self.boxes + np.array([[-gap], [gap]]), other.boxes)
        if gap > 0:
            return bool(hit.any())
        return any(not _apart(*self.hulls[i], *other.hulls[j]) for i, j in np.argwhere(hit))


def _block_hulls(boxes: np.ndarray) -> list[Hull]:
    picks = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    return [(np.where(picks == 1, box[1], box[0]), normals) for box in boxes]


def _overlaps(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[n, m] which boxes of a [n, 2, 3] and b [m, 2, 3] overlap by more than rounding."""
    touch = 1e-6
    return np.all((a[:, None, 0] < b[None, :, 1] - touch) & (a[:, None, 1] > b[None, :, 0] + touch), axis=2)


def _apart(a: np.ndarray, normals_a: np.ndarray, b: np.ndarray, normals_b: np.ndarray) -> bool:
    """Whether a face normal of either hull separates the two point sets."""
    axes = np.concatenate([normals_a, normals_b])
    pa, pb = a @ axes.T, b @ axes.T
    gap = np.maximum(pb.min(0) - pa.max(0), pa.min(0) - pb.max(0))
    return bool(gap.max() >= -1e-5)
