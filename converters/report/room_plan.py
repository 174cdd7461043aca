"""A plan of a scene from above: rooms coloured and named, outlines of what stands in them."""

from __future__ import annotations

import mujoco
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ig2mj.scene.manifest import Manifest

from ..base.description import RoomMaps
from ..mjcf.model_index import ModelIndex, geom_box

COLOURS = ("#cfe3f7", "#fde2c4", "#d5efd2", "#f7d3d8", "#e4d8f3", "#fbf3bf", "#cdeeea", "#e8e1d6", "#dfe6b8", "#f3d9ea")
FIXED, LOOSE, WALL = "#8a94a0", "#2f6db5", "#4a5058"
LINTEL = 1.2
"""Walls that begin higher than this, metres, are above doors and windows and not in the plan."""
INK = "#20262d"
BUILDING = ("walls", "floors", "ceilings")


def footprints(model: mujoco.MjModel, data: mujoco.MjData, manifest: Manifest, index: ModelIndex) -> dict[str, list]:
    """Object -> world boxes [2, 3] of its collision geoms, of what is neither parked nor building."""
    found: dict[str, list] = {}
    for number, entry in enumerate(manifest.objects):
        if not entry.parked:
            geoms = np.flatnonzero((index.geom_object == number) & index.solid)
            found[entry.name] = [
                geom_box(model, int(g), data.geom_xmat[g].reshape(3, 3), data.geom_xpos[g]) for g in geoms
            ]
    return found


def draw_plan(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    manifest: Manifest,
    index: ModelIndex,
    rooms: RoomMaps | None,
    *,
    width: int = 900,
) -> np.ndarray | None:
    """x to the right, y up, a scale bar of one metre. uint8 [h, w, 3]; None where there is nothing to draw."""
    boxes = footprints(model, data, manifest, index)
    everything = [b for some in boxes.values() for b in some]
    corners = [b[:, :2] for b in everything]
    if rooms is not None and (rooms.room_map > 0).any():
        corners.append(_room_extent(rooms))
    if not corners:
        return None
    low = np.min([c[0] for c in corners], axis=0) - 0.5
    high = np.max([c[1] for c in corners], axis=0) + 0.3
    scale = width / float(high[0] - low[0])
    height = int(np.clip((high[1] - low[1]) * scale, 80, 2 * width))
    scale = min(scale, height / float(high[1] - low[1]))
    image = Image.new("RGB", (width, height), "white")
    pen = ImageDraw.Draw(image)

    def at(x: float, y: float) -> tuple[float, float]:
        return (x - low[0]) * scale, height - (y - low[1]) * scale

    if rooms is not None:
        _paint_rooms(image, rooms, low, scale)
    order = sorted(manifest.objects, key=lambda o: (o.category not in BUILDING, not o.fixed))
    for entry in order:
        if entry.category in ("floors", "ceilings"):
            continue
        colour = WALL if entry.category == "walls" else FIXED if entry.fixed else LOOSE
        for box in boxes.get(entry.name, []):
            if entry.category == "walls" and box[0, 2] > LINTEL:
                continue
            (x0, y0), (x1, y1) = at(box[0, 0], box[1, 1]), at(box[1, 0], box[0, 1])
            filled = colour if entry.category == "walls" else None
            pen.rectangle((x0, y0, max(x1, x0 + 1), max(y1, y0 + 1)), outline=colour, fill=filled)
    if rooms is not None:
        _name_rooms(pen, rooms, at)
    x, y = 12, height - 14
    pen.line((x, y, x + scale, y), fill=INK, width=3)
    pen.text((x + scale + 8, y - 14), "1 m", fill=INK, font=_font(22))
    return np.asarray(image)


def _room_extent(rooms: RoomMaps) -> np.ndarray:
    rows, columns = np.nonzero(rooms.room_map > 0)
    n = rooms.room_map.shape[0]
    low = np.array([columns.min(), rows.min()]) - n / 2
    high = np.array([columns.max() + 1, rows.max() + 1]) - n / 2
    return np.stack([low, high]) * rooms.resolution


def _paint_rooms(image: Image.Image, rooms: RoomMaps, low: np.ndarray, scale: float) -> None:
    width, height = image.size
    n = rooms.room_map.shape[0]
    x = low[0] + (np.arange(width) + 0.5) / scale
    y = low[1] + (height - np.arange(height) - 0.5) / scale
    columns = np.floor(x / rooms.resolution + n / 2).astype(int)
    rows = np.floor(y / rooms.resolution + n / 2).astype(int)
    inside = ((rows >= 0) & (rows < n))[:, None] & ((columns >= 0) & (columns < n))[None]
    seen = rooms.room_map[np.clip(rows, 0, n - 1)[:, None], np.clip(columns, 0, n - 1)[None]]
    seen = np.where(inside, seen, 0)
    palette = np.array([(255, 255, 255), *(_rgb(COLOURS[i % len(COLOURS)]) for i in range(len(rooms.names)))], np.uint8)
    image.paste(Image.fromarray(palette[np.clip(seen, 0, len(rooms.names))]))


def _name_rooms(pen: ImageDraw.ImageDraw, rooms: RoomMaps, at) -> None:
    n = rooms.room_map.shape[0]
    for number, name in enumerate(rooms.names):
        rows, columns = np.nonzero(rooms.room_map == number + 1)
        if not len(rows):
            continue
        x, y = ((float(np.median(c)) + 0.5 - n / 2) * rooms.resolution for c in (columns, rows))
        pen.text(at(x, y), name, fill=INK, font=_font(24), anchor="mm", stroke_width=2, stroke_fill="white")


def _font(size: int):
    return ImageFont.load_default(size)


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)
