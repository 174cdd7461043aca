"""A home with one more loose object, and where its floor has room for it: what `drops.py` and `throws.py` share."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

import ig2mj
from ig2mj.scene.scene import Scene


def added(home: str, category: str) -> tuple[Scene, str]:
    """The home with an object of the library's category, and the object's name."""
    scene = ig2mj.load_scene(home, objects=[category])
    return scene, next(addition.name for addition in scene.additions if scene.object(addition.name).part_of is None)


def floor_cells(scene: Scene) -> tuple[Float[np.ndarray, "N 2"], Float[np.ndarray, "N"]]:
    """World x and y (m) of all cells of the map of free floor, and how much free floor (m) is around each; 0 where it
    is not free."""
    import scipy.ndimage

    rooms = scene.rooms
    assert rooms is not None and rooms.traversable is not None, f"{scene.name} has no map of its free floor"
    away = np.asarray(scipy.ndimage.distance_transform_edt(np.pad(rooms.traversable, 1)))[1:-1, 1:-1]
    cells = np.argwhere(np.ones(away.shape, bool))[:, ::-1]
    return (cells + 0.5 - np.array(away.shape)[::-1] / 2) * rooms.trav_resolution, away.ravel() * rooms.trav_resolution
