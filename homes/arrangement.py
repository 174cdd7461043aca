"""All things of a home and what is free between them: overlap tests on collision hulls, with every joint at 0.

Two hulls overlap unless a face normal of one of them separates them: a test that may say "overlap" for hulls that miss
each other edge to edge by little, and never the other way round.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .things import Hull, Thing, boxes_of

AIR = 0.0008
"""m, kept between a thing and what it stands on: it settles by less than the converter's 5 mm."""


class Arrangement:
    """The things that stand, blocks of the building, and zones that moving parts sweep or people walk in.

    Attributes:
      things: name -> Thing, in the order they were put.
    """

    def __init__(self, blocks: np.ndarray):
        """blocks: [n, 2, 3] boxes of walls; nothing may stand in them."""
        self.things: dict[str, Thing] = {}
        self._solid = [_Group(None, _block_hulls(np.asarray(blocks, float).reshape(-1, 2, 3)))]
        self._swept: list[_Group] = []
        self._ways: list[tuple[str, np.ndarray]] = []
        self._counts: dict[str, int] = {}

    def name(self, category: str) -> str:
        """The next free name of a category: fridge_0, fridge_1, ..."""
        number = self._counts.get(category, 0)
        self._counts[category] = number + 1
        return f"{category}_{number}"

    def put(self, thing: Thing) -> Thing:
        """Adds a thing where it is; ask `fits` first."""
        self.things[thing.name] = thing
        self._solid.append(_Group(thing, thing.parts()))
        swept = thing.swept()
        if swept:
            self._swept.append(_Group(thing, swept))
        return thing

    def keep_free(self, owner: str, boxes: np.ndarray) -> None:
        """Zones [n, 2, 3] where no furniture may stand: before a door, before a cupboard."""
        self._ways.append((owner, np.asarray(boxes, float).reshape(-1, 2, 3)))

    def fits(self, thing: Thing, *, ignore: Iterable[str] = (), gap: float = 0.0, ways: bool = True) -> bool:
        """Whether a thing overlaps nothing that stands and nothing that moves, and its own moving parts meet nothing
        that is fixed.

        Args:
          ignore: owners whose moving parts do not count (a cupboard's, for what lies in its drawer).
          gap: metres of air wanted between it and other things, box of hull against box of hull.
          ways: mind zones that are kept free, too.
        """
        mine = _Group(thing, thing.parts())
        if any(mine.meets(other, gap if other.thing else 0.0) for other in self._solid):
            return False
        ignored = {*ignore, thing.name, thing.host}
        for other in self._swept:
            if other.name not in ignored and mine.meets(other):
                return False
        if ways and any(owner not in ignored and _overlaps(mine.boxes, zone).any() for owner, zone in self._ways):
            return False
        if not thing.shape.swept:
            return True
        moving = _Group(thing, thing.swept())
        return not any(moving.meets(o) for o in self._solid if o.thing is None or o.thing.fixed)

    def free(self, zone: np.ndarray) -> bool:
        """Whether nothing stands in a box [2, 3]."""
        return not any(_overlaps(zone[None], group.boxes).any() for group in self._solid)

    def overlapping_boxes(self) -> list[list[str]]:
        """Pairs of names whose world boxes intersect: misc/bbox_overlap.json."""
        names = list(self.things)
        boxes = np.array([self.things[n].box() for n in names]).reshape(-1, 2, 3)
        hit = np.triu(_overlaps(boxes, boxes), 1)
        return [sorted((names[i], names[j])) for i, j in np.argwhere(hit)]


class _Group:
    """Hulls of one thing (None: the building), with the boxes around them and around all."""

    def __init__(self, thing: Thing | None, hulls: list[Hull]):
        self.thing, self.hulls = thing, hulls
        self.boxes = boxes_of(hulls)
        self.low = self.boxes[:, 0].min(0) if hulls else np.zeros(3)
        self.high = self.boxes[:, 1].max(0) if hulls else np.zeros(3)

    @property
    def name(self) -> str | None:
        return self.thing.name if self.thing else None

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
