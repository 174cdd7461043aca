"""Do the openings of a link stay open? A point test over the inside of everything that can hold something.

Space is cut into cubes. A cube that no piece touches, and that meets a piece in at least four of the six axis
directions, is inside: of a drawer (five), a closed cabinet (six), a shelf without a back (four). Connected cubes are
one inside. It is still open after a change of pieces if few of its cubes' middles have been filled.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.ndimage

from .convex import Hull

CUBES = 48
"""Along the longest side."""
DIRECTIONS = 4
"""A cube between pieces in so many of the six directions is inside."""
SMALLEST = 27
"""An inside of fewer cubes holds nothing."""
MOST_FILLED = 0.15
"""Share of an inside's cubes that may be filled before it counts as closed."""


class Openings:
    """The insides of what some pieces enclose.

    Attributes:
      count: how many insides there are.
    """

    def __init__(self, hulls: Sequence[Hull]):
        low = np.min([h.vertices.min(axis=0) for h in hulls], axis=0)
        high = np.max([h.vertices.max(axis=0) for h in hulls], axis=0)
        self._edge = float((high - low).max()) / CUBES
        self._origin = low - 0.5 * self._edge
        self._shape = tuple(int(n) for n in np.ceil((high - low) / self._edge).astype(int) + 2)
        touched = self._cubes_in(hulls, touching=True)
        labels = np.zeros(self._shape, np.int32)
        scipy.ndimage.label(~touched & (_walls_around(touched) >= DIRECTIONS), output=labels)
        sizes = np.bincount(labels.ravel())
        sizes[0] = 0
        self._labels = np.where(sizes[labels] >= SMALLEST, labels, 0)
        self._sizes = np.where(sizes >= SMALLEST, sizes, 0)
        self.count = int(np.count_nonzero(self._sizes))

    def stay_open(self, hulls: Sequence[Hull]) -> bool:
        """Whether no inside is closed by these pieces."""
        if not self.count:
            return True
        filled = np.bincount(self._labels[self._cubes_in(hulls, touching=False)], minlength=len(self._sizes))
        return bool(np.all(filled[1:] <= MOST_FILLED * self._sizes[1:]))

    def _cubes_in(self, hulls: Sequence[Hull], *, touching: bool) -> np.ndarray:
        """Which cubes have their middle in a piece; with `touching`, all that a piece may reach into. [x, y, z]."""
        cubes = np.zeros(self._shape, bool)
        for hull in hulls:
            low = np.floor((hull.vertices.min(axis=0) - self._origin) / self._edge - 0.5).astype(int)
            high = np.ceil((hull.vertices.max(axis=0) - self._origin) / self._edge + 0.5).astype(int) + 1
            window = tuple(slice(max(a, 0), min(b, n)) for a, b, n in zip(low, high, self._shape, strict=True))
            axes = [self._origin[k] + self._edge * np.arange(w.start, w.stop) for k, w in enumerate(window)]
            middles = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            planes = np.unique(np.round(hull.planes, 9), axis=0)
            reach = 0.5 * self._edge * np.abs(planes[:, :3]).sum(axis=1) if touching else 0.0
            inside = np.all(middles @ planes[:, :3].T + planes[:, 3] <= reach, axis=-1)
            cubes[window] |= inside
        return cubes


def _walls_around(touched: np.ndarray) -> np.ndarray:
    """In how many of the six axis directions each cube meets a touched one. int [x, y, z]."""
    around = np.zeros(touched.shape, int)
    for axis in range(3):
        for way in (1, -1):
            turned = np.flip(touched, axis) if way < 0 else touched
            met = np.maximum.accumulate(turned, axis=axis)
            around += np.flip(met, axis) if way < 0 else met
    return around
