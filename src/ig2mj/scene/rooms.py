"""`rooms.npz`: which room a point is in, and where the floor is free (iGibson's dataset format)."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import zipfile

import numpy as np

from ig2mj.errors import InputError

FORMAT_VERSION = 1


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
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as data:
            version = int(data["format_version"])
            if version != FORMAT_VERSION:
                raise InputError(file, f"has format version {version}, this ig2mj reads {FORMAT_VERSION}", fix=fix)
            rooms = Rooms(
                names=tuple(str(n) for n in data["names"]),
                types=tuple(str(t) for t in data["types"]),
                room_map=data["room_map"],
                resolution=float(data["resolution"]),
                traversable=data.get("traversable"),
                traversable_no_obj=data.get("traversable_no_obj"),
                trav_resolution=float(data["trav_resolution"]),
            )
    except KeyError as e:
        raise InputError(file, f"lacks an array: {e.args[0]}", fix=fix) from e
    except FileNotFoundError as e:
        raise InputError(file, "does not exist", fix=fix) from e
    except (OSError, ValueError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as e:
        raise InputError(file, f"cannot be read: {e}", fix=fix) from e
    shape = rooms.room_map.shape
    if len(shape) != 2 or shape[0] != shape[1] or len(rooms.names) != len(rooms.types):
        raise InputError(file, "its arrays do not fit together", fix=fix)
    if rooms.room_map.size and not 0 <= rooms.room_map.min() <= rooms.room_map.max() <= len(rooms.names):
        raise InputError(file, "room_map names rooms that do not exist", element="room_map", fix=fix)
    if not rooms.resolution > 0 or not rooms.trav_resolution > 0:
        raise InputError(file, "a resolution is not positive", element="resolution", fix=fix)
    return rooms
