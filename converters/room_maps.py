"""`layout/*.png` -> `RoomMaps`, and `rooms.npz` (dataset_format.md 2.5)."""

from __future__ import annotations

import os
import pathlib

from .description import RoomMaps


def read_room_maps(
    scene_folder: pathlib.Path, room_types: list[str], warnings: list[str] | None = None
) -> RoomMaps | None:
    """Reads the layout maps of a scene folder; None (and a warning) where there is no semantic/instance map.

    Raises:
      InputError: a map is broken, not square, too large, or names a room type that does not exist.
    """
    raise NotImplementedError


def write_rooms(maps: RoomMaps, path: str | os.PathLike) -> None:
    """Writes `rooms.npz`, equal maps giving equal bytes; `ig2mj.scene.rooms` reads it."""
    raise NotImplementedError
