"""`rooms.npz`: which room a point is in, and where the floor is free (iGibson's dataset format)."""

from __future__ import annotations

import dataclasses
import os
import pathlib

import numpy as np

from ig2mj.errors import InputError
from ig2mj.files.npz import read_npz

FORMAT_VERSION = 1

MOST_ROOMS = 32_767
"""Room instances of a home: a cell of the map is an int16."""

_OPTIONAL = ("traversable", "traversable_no_obj")
_ARRAYS = {
    "format_version": ("iu", 0), "names": ("U", 1), "types": ("U", 1), "room_map": ("iu", 2), "resolution": ("fiu", 0),
    "trav_resolution": ("fiu", 0), **{name: ("biu", 2) for name in _OPTIONAL},
}  # fmt: skip
"""Kinds of dtypes, and numbers of axes."""


@dataclasses.dataclass(frozen=True)
class Rooms:
    """Maps of one home.

    Attributes:
      names: room instances ("kitchen_0"); types: their room types.
      room_map: [n, n] int16, index + 1 into names, 0 none; row is y, column is x, centre is the world's origin.
      resolution: metres per cell of room_map.
      traversable, traversable_no_obj: [m, m] bool at trav_resolution, or None.
    """

    names: tuple[str, ...]
    types: tuple[str, ...]
    room_map: np.ndarray
    resolution: float
    traversable: np.ndarray | None = None
    traversable_no_obj: np.ndarray | None = None
    trav_resolution: float = 0.1

    def room_at(self, xy: np.ndarray | tuple[float, float]) -> str | None:
        """Name of the room that the world point xy [2] (m) is in, or None."""
        index = int(self.index_at(np.asarray(xy, dtype=float)))
        return self.names[index] if index >= 0 else None

    def index_at(self, xy: np.ndarray) -> np.ndarray:
        """Index into names of the room at each world point xy [..., 2] (m); -1 where there is none.

        A point's cell is found by truncation, as in iGibson.
        """
        n = self.room_map.shape[0]
        cell = np.asarray(xy, dtype=float) / self.resolution + n / 2
        inside = np.all((cell > -1) & (cell < n), axis=-1)  # truncation puts (-1, 0) into cell 0; NaN is outside
        col, row = np.moveaxis(np.where(inside[..., None], cell, 0.0).astype(int), -1, 0)
        return np.where(inside, self.room_map[row, col].astype(int) - 1, -1)

    def centre(self, name: str) -> np.ndarray:
        """World point [2] (m): the mean of a room's cells."""
        rows, cols = np.nonzero(self.room_map == 1 + self.names.index(name))
        half = self.room_map.shape[0] / 2
        return (np.array([cols.mean(), rows.mean()]) + 0.5 - half) * self.resolution


def load_rooms(path: str | os.PathLike) -> Rooms:
    """Reads rooms.npz, or the folder that holds it (keys: see `ig2mj_converters.reading.room_maps.write_rooms`).

    Raises:
      InputError: the file is missing, no npz archive, or its arrays do not fit together.
    """
    file = pathlib.Path(path)
    if file.is_dir():
        file = file / "rooms.npz"
    fix = "convert the scene again"
    arrays = read_npz(file, fix=fix)
    for name, (kinds, axes) in _ARRAYS.items():
        if name not in arrays:
            if name in _OPTIONAL:
                continue
            raise InputError(file, f"lacks an array: {name}", fix=fix)
        if arrays[name].dtype.kind not in kinds or arrays[name].ndim != axes:
            raise InputError(file, f"is {arrays[name].ndim}-dimensional {arrays[name].dtype}", element=name, fix=fix)
    version = int(arrays["format_version"])
    if version != FORMAT_VERSION:
        raise InputError(file, f"has format version {version}, this ig2mj reads {FORMAT_VERSION}", fix=fix)
    free = {name: arrays[name].astype(bool) for name in _OPTIONAL if name in arrays}
    for name, array in (("room_map", arrays["room_map"]), *free.items()):
        if array.shape[0] != array.shape[1] or not array.size:
            raise InputError(file, f"has shape {array.shape}, and a map is square", element=name, fix=fix)
    names, types, room_map = (arrays[name] for name in ("names", "types", "room_map"))
    if len(names) != len(types) or len(set(names.tolist())) < len(names):
        raise InputError(file, "names and types do not fit together", element="names", fix=fix)
    if len(names) > MOST_ROOMS:
        raise InputError(file, f"has {len(names)} rooms, and the limit is {MOST_ROOMS}", element="names", fix=fix)
    if not 0 <= int(room_map.min()) <= int(room_map.max()) <= len(names):
        raise InputError(file, "room_map names rooms that do not exist", element="room_map", fix=fix)
    for name in ("resolution", "trav_resolution"):
        if not 1e-4 <= float(arrays[name]) <= 1e4:
            raise InputError(file, f"is {float(arrays[name]):g} m, and must be in [1e-4, 1e4]", element=name, fix=fix)
    return Rooms(
        names=tuple(str(n) for n in names),
        types=tuple(str(t) for t in types),
        room_map=room_map.astype(np.int16),
        resolution=float(arrays["resolution"]),
        traversable=free.get("traversable"),
        traversable_no_obj=free.get("traversable_no_obj"),
        trav_resolution=float(arrays["trav_resolution"]),
    )
