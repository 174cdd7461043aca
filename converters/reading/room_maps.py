"""`layout/*.png` -> `RoomMaps`, and `rooms.npz` (iGibson's dataset format).

All layout images are square, 0.01 m per pixel, centred on the world's origin, row = y, column = x, not flipped.
"""

from __future__ import annotations

import collections
import os
import pathlib

import numpy as np
from PIL import Image
from scipy import ndimage

from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import RoomMaps
from .images import ImageError, open_image

PIXEL = 0.01  # m, of the layout images
SEG_RESOLUTION = 0.1  # m, of the room maps (seg_map_resolution)
TRAV_RESOLUTION = 0.1  # m, of the traversability maps (trav_map_resolution)
TRAV_EROSION = 2  # cells (trav_map_erosion)
MIN_SIDE = 10  # pixels
MOST_ROOMS = 32_767  # instances: a cell of the room map is an int16


def read_room_maps(
    scene_folder: pathlib.Path, room_types: list[str], warnings: list[str] | None = None
) -> RoomMaps | None:
    """Reads the layout maps of a scene folder; None (and a warning) where there is no semantic/instance map.

    Rooms are named `<room type>_<i>`, i counting ascending instance ids within the type, after the resize.

    Raises:
      InputError: a map is broken, not square, too large, or names a room type that does not exist.
    """
    layout = scene_folder / "layout"
    semantic_file, instance_file = layout / "floor_semseg_0.png", layout / "floor_insseg_0.png"
    if not inputs.is_file(semantic_file) or not inputs.is_file(instance_file):
        if warnings is not None:
            warnings.append("layout/floor_semseg_0.png or floor_insseg_0.png is missing: the scene has no rooms")
        return None
    semantic, instance = _read_segments(semantic_file), _read_segments(instance_file)
    if semantic.shape != instance.shape:
        raise InputError(instance_file, f"its size differs from that of {semantic_file.name}")
    room_map, names, types = name_rooms(semantic, instance, room_types, semantic_file)
    free, free_no_obj = (
        traversable(_open_grey(f)) if inputs.is_file(f) else None
        for f in (layout / "floor_trav_0.png", layout / "floor_trav_no_obj_0.png")
    )
    return RoomMaps(room_map, names, types, SEG_RESOLUTION, free, free_no_obj, TRAV_RESOLUTION)


def name_rooms(
    semantic: np.ndarray, instance: np.ndarray, room_types: list[str], file: object
) -> tuple[np.ndarray, list[str], list[str]]:
    """(room map, names, types) from the resized maps [n, n]: a room's type is that of its first pixel, row by row.

    Raises:
      InputError: a room's first pixel has no type, or one beyond room_categories.txt; or there are too many rooms.
    """
    rooms, first, number = np.unique(instance, return_index=True, return_inverse=True)
    inside = rooms != 0
    if inside.sum() > MOST_ROOMS:
        raise InputError(file, f"the instance map has {inside.sum()} rooms, and the limit is {MOST_ROOMS}")
    names: list[str] = []
    types: list[str] = []
    counts = collections.Counter[str]()
    for room, at in zip(rooms[inside], first[inside], strict=True):
        value = int(semantic.flat[at])
        if not 1 <= value <= len(room_types):
            raise InputError(
                file,
                f"pixel value {value} is not a line of room_categories.txt ({len(room_types)} lines)",
                element=f"room instance {room}",
            )
        kind = room_types[value - 1]
        names.append(f"{kind}_{counts[kind]}")
        types.append(kind)
        counts[kind] += 1
    place = np.where(inside, np.cumsum(inside), 0).astype(np.int16)
    room_map = place[number].reshape(instance.shape)
    return room_map, names, types


def traversable(image: np.ndarray, erosion: int = TRAV_EROSION) -> np.ndarray:
    """Grey image [p, p] -> [n, n] bool at `TRAV_RESOLUTION`: resized bilinearly, eroded, wholly white cells only, of
    these the largest 8-connected component (as iGibson's traversability graph)."""
    small = _resize_bilinear(image, int(image.shape[0] * PIXEL / TRAV_RESOLUTION))
    if erosion > 0:
        small = ndimage.minimum_filter(small, size=erosion, mode="constant", cval=255)
    free = small >= 255
    labels = np.zeros(free.shape, dtype=np.int32)
    if int(ndimage.label(free, structure=np.ones((3, 3)), output=labels)) > 1:  # pyright: ignore[reportArgumentType]
        free = labels == 1 + int(np.argmax(np.bincount(labels.ravel())[1:]))
    return free


def write_rooms(maps: RoomMaps, path: str | os.PathLike) -> None:
    """Writes `rooms.npz`, equal maps giving equal bytes; `ig2mj.scene.rooms` reads it.

    Keys: `format_version` (1); `names`, `types` [r] text; `room_map` [n, n] int16 (index + 1 into names, 0 none; row
    is y, column is x); `resolution` (m per cell); `trav_resolution`; where known `traversable` and
    `traversable_no_obj` [m, m] bool.
    """
    arrays: dict[str, np.ndarray] = {
        "format_version": np.array(1),
        "names": np.array(maps.names, dtype=np.str_),
        "types": np.array(maps.types, dtype=np.str_),
        "room_map": maps.room_map.astype(np.int16),
        "resolution": np.array(maps.resolution),
        "trav_resolution": np.array(maps.trav_resolution),
    }
    for key in ("traversable", "traversable_no_obj"):
        if (value := getattr(maps, key)) is not None:
            arrays[key] = value.astype(bool)
    with pathlib.Path(path).open("wb") as out:
        np.savez_compressed(out, allow_pickle=False, **arrays)


def room_at(maps: RoomMaps, x: float, y: float) -> str | None:
    """Room of a world point (m), by iGibson's truncating rule; None outside."""
    n = maps.room_map.shape[0]
    row, col = int(y / maps.resolution + n / 2), int(x / maps.resolution + n / 2)
    if not (0 <= row < n and 0 <= col < n):
        return None
    index = int(maps.room_map[row, col])
    return maps.names[index - 1] if index else None


def _read_segments(file: pathlib.Path) -> np.ndarray:
    """Ids [n, n] at `SEG_RESOLUTION`, resized to the nearest pixel as Pillow does it."""
    image = _open(file)
    side = int(image.size[0] * PIXEL / SEG_RESOLUTION)
    if image.mode in ("RGB", "RGBA", "LA"):
        raise InputError(file, f"is a colour image ({image.mode}), not one of ids", fix="save it as 8-bit grey")
    return np.array(image.resize((side, side), Image.Resampling.NEAREST)).astype(np.int64)


def _open_grey(file: pathlib.Path) -> np.ndarray:
    return np.array(_open(file).convert("L"))


def _open(file: pathlib.Path) -> Image.Image:
    try:
        with open_image(inputs.content(file)) as image:
            if image.size[0] != image.size[1]:
                raise InputError(file, f"is not square but {image.size[0]} x {image.size[1]} pixels")
            if image.size[0] < MIN_SIDE:
                raise InputError(file, f"has {image.size[0]} pixels a side, fewer than {MIN_SIDE}")
            image.load()
            return image.copy()
    except (ImageError, OSError) as e:
        raise InputError(file, f"is not an image that can be read: {e}") from e


def _resize_bilinear(image: np.ndarray, side: int) -> np.ndarray:
    """[p, p] uint8 -> [side, side], between the four nearest pixels as OpenCV's INTER_LINEAR (Pillow would average)."""
    at = (np.arange(side) + 0.5) * (image.shape[0] / side) - 0.5
    low = np.clip(np.floor(at).astype(int), 0, image.shape[0] - 1)
    high = np.clip(low + 1, 0, image.shape[0] - 1)
    part = np.clip(at - low, 0.0, 1.0)
    rows = image[low] * (1 - part)[:, None] + image[high] * part[:, None]
    values = rows[:, low] * (1 - part) + rows[:, high] * part
    return np.rint(values).astype(np.uint8)
