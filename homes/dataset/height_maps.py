"""misc/heights_per_link.json and its maps: where on, in and under a piece of furniture something can be put.

In iGibson's dataset a map has one pixel per centimetre of the link's own frame at scale 1; pixel (row, column) stands
for the point x = column / 100 - 2, y = row / 100 - 2, and is 255 where there is room above the map's height, else 0.
"""

from __future__ import annotations

import dataclasses
import io
import json
import pathlib

import numpy as np
from PIL import Image
from scipy import ndimage
from scipy.spatial import ConvexHull

from ..objects.model import HouseholdObject, LinkBuilder

SIDE, PIXELS_PER_METRE = 400, 100
FLAT = 0.002  # m: tops this close to each other are one height
HEADROOM = 0.03  # m of air that a spot has above it, at least
LEGROOM = 0.10  # m of air under a piece of furniture where something can be put under it
NARROWEST = 5  # pixels: narrower strips are left out
SMALLEST_EDGE = 0.06  # m: tops with a shorter edge carry nothing

Heights = dict[str, dict[str, list[tuple[float, np.ndarray]]]]
"""Predicate -> link -> (height in the link's frame, map [400, 400] of bool), the lowest first."""


@dataclasses.dataclass(frozen=True)
class _Columns:
    """Which heights the hulls fill over points on a grid: hull h over point p from low[h, p] to high[h, p], m, object's
    frame; low is +inf and high -inf where the hull is not there."""

    low: np.ndarray
    high: np.ndarray
    links: np.ndarray


def height_maps(model: HouseholdObject) -> Heights:
    """Where objects can be put, all joints at 0.

    inside: under another part of the same object, or surrounded by it on all four sides (a basin, an open drawer).
    onTop: on any other level top. under: on the floor beneath the base link.
    """
    found: Heights = {"inside": {}, "onTop": {}, "under": {}}
    low, high = model.bounds()
    for number, link in enumerate(model.links):
        heights = _flat_tops(link)
        if not heights and number > 0:
            continue
        spots, shape, corner = _grid(low[:2] - link.origin[:2], high[:2] - link.origin[:2])
        columns = _columns(model, spots + link.origin[:2])
        for z in heights:
            for predicate, free in _free(columns, number, z + float(link.origin[2]), shape).items():
                _add(found, predicate, link.name, z, free.reshape(shape), corner)
        if number == 0:
            above = columns.low.min(0)
            free = np.isfinite(above) & (above > float(low[2]) + LEGROOM)
            _add(found, "under", link.name, float(low[2]), free.reshape(shape), corner)
    return {predicate: links for predicate, links in found.items() if links}


def write_height_maps(model: HouseholdObject, misc: pathlib.Path) -> None:
    """Writes heights_per_link.json and height_maps_per_link/<predicate>/<link>/<i>.png, if there are any."""
    found = height_maps(model)
    if not found:
        return
    heights = {
        p: {link: [round(z, 6) + 0.0 for z, _ in maps] for link, maps in links.items()} for p, links in found.items()
    }
    text = json.dumps(heights, indent=1) + "\n"
    (misc / "heights_per_link.json").write_text(text, encoding="utf-8", newline="\n")
    for predicate, links in found.items():
        for link, maps in links.items():
            folder = misc / "height_maps_per_link" / predicate / link
            folder.mkdir(parents=True, exist_ok=True)
            for k, (_, free) in enumerate(maps):
                buffer = io.BytesIO()
                Image.fromarray(free.astype(np.uint8) * 255).save(buffer, "PNG", optimize=True)
                (folder / f"{k}.png").write_bytes(buffer.getvalue())


def _flat_tops(link: LinkBuilder) -> list[float]:
    """Heights, in the link's frame, of its hulls' level tops, the lowest first."""
    heights: list[float] = []
    for points in link.hulls:
        top = points[points[:, 2] > points[:, 2].max() - FLAT]
        if len(top) >= 3 and np.ptp(top[:, :2], axis=0).min() >= SMALLEST_EDGE:
            heights.append(float(points[:, 2].max()))
    heights.sort()
    return [z for k, z in enumerate(heights) if k == 0 or z - heights[k - 1] > FLAT]


def _grid(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, tuple[int, int], tuple[int, int]]:
    """Points [n, 2] of the pixels within a box of the link's frame, how many (rows, columns), and the first pixel."""
    first = np.clip(np.ceil((low + SIDE / PIXELS_PER_METRE / 2) * PIXELS_PER_METRE), 0, SIDE).astype(int)
    last = np.clip(np.floor((high + SIDE / PIXELS_PER_METRE / 2) * PIXELS_PER_METRE) + 1, 0, SIDE).astype(int)
    column, row = (np.arange(first[k], last[k]) for k in (0, 1))
    x, y = np.meshgrid(column / PIXELS_PER_METRE - 2, row / PIXELS_PER_METRE - 2)
    return np.stack([x.ravel(), y.ravel()], 1), x.shape, (int(first[1]), int(first[0]))


def _columns(model: HouseholdObject, spots: np.ndarray) -> _Columns:
    lows, highs, links = [], [], []
    for number, link in enumerate(model.links):
        for points in link.hulls:
            planes = ConvexHull(points + link.origin).equations
            slope = planes[:, 2]
            rest = spots @ planes[:, :2].T + planes[:, 3]
            up, down, upright = slope > 1e-9, slope < -1e-9, np.abs(slope) <= 1e-9
            high = np.min(-rest[:, up] / slope[up], axis=1)
            low = np.max(-rest[:, down] / slope[down], axis=1)
            there = (high > low) & np.all(rest[:, upright] <= 0, axis=1)
            lows.append(np.where(there, low, np.inf))
            highs.append(np.where(there, high, -np.inf))
            links.append(number)
    return _Columns(np.array(lows), np.array(highs), np.array(links))


def _free(columns: _Columns, link: int, z: float, shape: tuple[int, int]) -> dict[str, np.ndarray]:
    """Points that are free at a height of a link's tops: "inside" and "onTop" it."""
    carried = np.any((np.abs(columns.high - z) < FLAT) & (columns.links == link)[:, None], axis=0)
    blocked = np.any((columns.low < z + HEADROOM) & (columns.high > z + FLAT), axis=0)
    covered = np.any(columns.low >= z + HEADROOM, axis=0, where=np.isfinite(columns.low))
    walls = np.any((columns.low < z + HEADROOM) & (columns.high > z + HEADROOM), axis=0).reshape(shape)
    around = np.ones(shape, bool)
    for axis in (0, 1):
        around &= np.maximum.accumulate(walls, axis)
        around &= np.flip(np.maximum.accumulate(np.flip(walls, axis), axis), axis)
    enclosed = covered | around.ravel()
    return {"inside": carried & ~blocked & enclosed, "onTop": carried & ~blocked & ~enclosed}


def _add(found: Heights, predicate: str, link: str, z: float, free: np.ndarray, corner: tuple[int, int]) -> None:
    free = ndimage.binary_opening(free, np.ones((NARROWEST, NARROWEST)))
    if not free.any():
        return
    whole = np.zeros((SIDE, SIDE), bool)
    row, column = corner
    whole[row : row + free.shape[0], column : column + free.shape[1]] = free
    found[predicate].setdefault(link, []).append((z, whole))
