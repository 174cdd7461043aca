"""Where objects can be put on or in a model: level tops of its hulls, and how much air is above them."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from ..furnish.placed import shape

SMALLEST = 0.06
"""m: shorter edges carry nothing."""
FLAT = 0.002
"""m: points this far below a hull's highest belong to its top face."""


@dataclasses.dataclass(frozen=True)
class Surface:
    """A level rectangle of a model, in its base frame with joints at 0.

    Attributes:
      link: number of the link it belongs to. rect: x0, y0, x1, y1. z: its height.
      room: metres of air above its middle up to the same object's next hull; inf: nothing above, it is "on top".
    """

    link: int
    rect: tuple[float, float, float, float]
    z: float
    room: float

    @property
    def inside(self) -> bool:
        return self.room < 2.0

    @property
    def area(self) -> float:
        x0, y0, x1, y1 = self.rect
        return (x1 - x0) * (y1 - y0)


@functools.cache
def surfaces(category: str, index: int, seed: int = 0) -> tuple[Surface, ...]:
    """All surfaces of a model, the largest first; those inside (shelves, drawers, bowls) and those on top."""
    form = shape(category, index, seed)
    boxes = np.array([[h.min(0), h.max(0)] for h in form.hulls])
    found = []
    for k, points in enumerate(form.hulls):
        top = points[points[:, 2] > points[:, 2].max() - FLAT]
        if len(top) < 3:
            continue
        x0, y0 = top[:, :2].min(0)
        x1, y1 = top[:, :2].max(0)
        if min(x1 - x0, y1 - y0) < SMALLEST:
            continue
        z = float(points[:, 2].max())
        middle = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
        over = (
            np.all((boxes[:, 0, :2] < middle) & (boxes[:, 1, :2] > middle), axis=1)
            & (boxes[:, 0, 2] > z - FLAT)
            & (np.arange(len(boxes)) != k)
        )
        room = float(boxes[over, 0, 2].min() - z) if over.any() else np.inf
        if room < 0.03:
            continue
        found.append(Surface(form.links[k], (float(x0), float(y0), float(x1), float(y1)), z, room))
    found.sort(key=lambda s: (-round(s.area, 6), s.z, s.rect))
    return tuple(found)


def tops(category: str, index: int, seed: int = 0) -> list[Surface]:
    """Surfaces with nothing of the same object above."""
    return [s for s in surfaces(category, index, seed) if not s.inside]


def insides(category: str, index: int, seed: int = 0) -> list[Surface]:
    """Surfaces under something of the same object: shelves, drawer floors, cavities."""
    return [s for s in surfaces(category, index, seed) if s.inside]
