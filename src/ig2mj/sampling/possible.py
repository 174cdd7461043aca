"""Where an object could be placed at all, for every cell of an area at once: the first step for large objects.

A pool fits in a garage in a few hundred of a hundred thousand cells, and testing one cell costs thousands of
comparisons. The conditions here are necessary, not sufficient. Each is a correlation of two masks (bad cells of the
level, affected cells of the object), computed by FFT.

Axes: M rows and N columns of cells for the object's origin.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from jaxtyping import Bool

from ig2mj.sampling.columns import Level
from ig2mj.sampling.drop import HEADROOM, LEVEL_BASE
from ig2mj.sampling.footprint import Footprint

SHARES = (0.0, 0.5, 1.0)
"""Parts of the object's height at which it is compared with what is above and below: top, bottom and the middle."""


def possible_origins(
    level: Level, shape: Footprint, supports: Collection[int], rows: int, cols: int, full: bool
) -> Bool[np.ndarray, "M N"]:
    """Cells of the origin, of `rows` x `cols` from the level's first one on, that nothing here rules out.

    Args:
      level: its window begins at (first row of the origin + `shape.row`, ...) and holds the object at every cell.
      supports: objects that may bear it. full: it must be fully supported (`Rest.full`).
    """
    covered = shape.covered
    found = np.ones((rows, cols), bool)
    found &= ~meets(level.blocked, covered, rows, cols)
    if not full:
        return found
    bears = np.isin(level.owner, list(supports))
    if not bears.any():
        return np.zeros((rows, cols), bool)
    found &= ~meets(~bears, shape.base, rows, cols)
    lowest = float(level.surface[bears].min()) - shape.low - LEVEL_BASE
    highest = float(level.surface[bears].max()) - shape.low + LEVEL_BASE
    for share in SHARES:
        top = shape.low + share * (shape.high - shape.low)
        reaching = covered & (np.nan_to_num(shape.topside, nan=-np.inf) >= top)
        found &= ~meets(level.ceiling < lowest + top + HEADROOM, reaching, rows, cols)
        bottom = shape.high - share * (shape.high - shape.low)
        hanging = covered & (np.nan_to_num(shape.underside, nan=np.inf) <= bottom)
        found &= ~meets(level.surface > highest + bottom, hanging, rows, cols)
    return found


def meets(
    wrong: Bool[np.ndarray, "R C"], mask: Bool[np.ndarray, "K L"], rows: int, cols: int
) -> Bool[np.ndarray, "M N"]:
    """For every cell of the origin whether a cell of the object's mask falls on one of the level that is `wrong`."""
    if not wrong.any() or not mask.any():
        return np.zeros((rows, cols), bool)
    import scipy.fft

    # Of a circular convolution over the level's cells, those that the mask does not wrap around to are taken.
    size = [scipy.fft.next_fast_len(n, real=True) for n in wrong.shape]
    one, other = (np.asarray(scipy.fft.rfft2(a.astype(float), size)) for a in (wrong, mask[::-1, ::-1]))
    count = np.asarray(scipy.fft.irfft2(one * other, size))
    first, last = np.array(mask.shape) - 1, wrong.shape
    return count[first[0] : last[0], first[1] : last[1]][:rows, :cols] > 0.5
