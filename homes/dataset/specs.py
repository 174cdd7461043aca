"""metadata/avg_category_specs.json: mean size, mass and bounding-box density of every category."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ..objects.entry import Entry

Spec = dict[str, object]


def category_spec(entry: Entry, sizes: Iterable[Iterable[float]]) -> Spec:
    """The spec of one category from the bounding boxes of its whole models.

    `density` is the density of the bounding box, mass / (x y z), as iGibson's loader uses it.
    """
    mean = np.array(list(sizes), float).mean(0)
    density = entry.mass / float(mean.prod())
    return {
        "size": [round(float(v), 6) for v in mean],
        "mass": entry.mass,
        "density": round(density, 4),
        "enable_ag": int(entry.enable_ag),
    }
