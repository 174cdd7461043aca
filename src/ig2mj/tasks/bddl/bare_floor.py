"""`on_carpets`: what of a home's furniture stands on carpets, so that nothing below it is on the floor."""

from __future__ import annotations

import functools

import numpy as np

from ig2mj.errors import Ig2mjError
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import load_scene

FLAT = 0.05
"""m between the top of what lies under a piece of furniture and the lowest point of that."""

COVERED = 0.5
"""Share of a piece of furniture's area below which something lies, from which on the floor below it is covered."""


@functools.cache
def on_carpets(home: str) -> frozenset[str]:
    """Fixed objects of a home below which another fixed one lies on the floor; none where the home is not known."""
    try:
        scene = load_scene(home)
    except Ig2mjError:
        return frozenset()
    query, tables = SceneQuery(scene), scene.tables
    flat = [o for o, entry in enumerate(scene.manifest.objects) if entry.fixed and entry.in_household]
    boxes = {o: query.box(o) for o in flat if (tables.piece_object == o).any()}
    found = set[str]()
    for o, (low, high) in boxes.items():
        for other, (other_low, other_high) in boxes.items():
            shared = np.clip(np.minimum(high, other_high)[:2] - np.maximum(low, other_low)[:2], 0, None)
            below = other != o and abs(other_high[2] - low[2]) < FLAT
            if below and np.prod(shared) > COVERED * np.prod((high - low)[:2]):
                found.add(tables.object_names[o])
    return frozenset(found)
