"""Contact sheets of sensors' readings: each as an image, in false colours where it is not one.

sensor_sheet(readings, sensors.spaces).save("sensors.png")
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Space

TILE = 256
"""Pixels, of a side."""

INK, PAPER = (25, 30, 38), (255, 255, 255)


def sensor_sheet(
    readings: Mapping[str, Array], spaces: Mapping[str, Space], world: int = 0, columns: int = 4
) -> Image.Image:
    """One RGB image with a labelled tile for each reading of one world.

    Args:
      readings, spaces: by name, as of `SensorSuite`; readings have the world axis.
    """
    rows = math.ceil(len(readings) / columns)
    sheet = Image.fromarray(np.full((rows * (TILE + 18), columns * (TILE + 4), 3), 255, np.uint8))
    pen = ImageDraw.Draw(sheet)
    for k, (name, reading) in enumerate(readings.items()):
        left, top = k % columns * (TILE + 4), k // columns * (TILE + 18)
        sheet.paste(false_colours(name, np.asarray(reading)[world], spaces[name]), (left, top + 16))
        text = f"{name}  {np.dtype(spaces[name].dtype).name}{list(spaces[name].shape)}"
        pen.text((left + 2, top + 2), text, fill=INK)
    return sheet


def false_colours(name: str, reading: np.ndarray, space: Space) -> Image.Image:
    """A square tile of one reading: images as they are, points and rays from above, numbers as bars."""
    if name == "scan":
        return _rays_from_above(1.0 - reading[:, 0])
    if reading.ndim == 2 and reading.shape[1] == 3:
        return _points_from_above(reading)
    if reading.ndim < 3:
        return _bars(reading.ravel())
    image = Image.fromarray(_pixels(name, reading, space))
    scale = TILE / max(image.size)
    size = (max(1, round(image.width * scale)), max(1, round(image.height * scale)))
    tile = _blank()
    tile.paste(image.resize(size, Image.Resampling.NEAREST), ((TILE - size[0]) // 2, (TILE - size[1]) // 2))
    return tile


def _pixels(name: str, reading: np.ndarray, space: Space) -> UInt8[np.ndarray, "Y X 3"]:
    if reading.dtype == np.uint8:
        return reading
    if np.issubdtype(reading.dtype, np.integer):
        return _hues(reading[..., 0])
    if reading.shape[-1] == 1:
        top = reading.max() if space.high > 1 else 1.0
        return np.repeat((255 * reading / max(top, 1e-9)).clip(0, 255).astype(np.uint8), 3, axis=-1)
    if space.low >= 0:
        return (255 * reading).clip(0, 255).astype(np.uint8)
    padded = np.concatenate([reading, np.zeros((*reading.shape[:2], 3 - reading.shape[-1]))], axis=-1)
    span = max(float(np.quantile(np.abs(padded), 0.99)), 1e-6)  # grey is zero
    return (127.5 + 127.5 * padded / span).clip(0, 255).astype(np.uint8)


def _hues(numbers: np.ndarray) -> UInt8[np.ndarray, "Y X 3"]:
    """A colour of its own for each number; black for 0."""
    table = np.zeros((int(numbers.max()) + 1, 3))
    for number in np.unique(numbers[numbers > 0]):
        table[number] = colorsys.hsv_to_rgb(number * 0.61803 % 1.0, 0.75, 0.95)
    return (255 * table[numbers]).astype(np.uint8)


def _blank() -> Image.Image:
    return Image.fromarray(np.full((TILE, TILE, 3), 235, np.uint8))


def _rays_from_above(nearness: np.ndarray) -> Image.Image:
    """Rays of a scan over the half turn from right to left, ahead at the top; as long as they are free."""
    tile, middle = _blank(), (TILE / 2, 0.75 * TILE)
    pen, count = ImageDraw.Draw(tile), len(nearness)
    for k, near in enumerate(nearness):
        angle, reach = np.pi * k / count, 0.7 * TILE * (1.0 - near)
        end = (middle[0] + reach * np.cos(angle), middle[1] - reach * np.sin(angle))
        pen.line([middle, end], fill=(150, 170, 190))
        if near > 0:
            pen.ellipse([end[0] - 1.5, end[1] - 1.5, end[0] + 1.5, end[1] + 1.5], fill=(190, 40, 30))
    return tile


def _points_from_above(points: np.ndarray) -> Image.Image:
    """Points (x right, y forward, z up) within their farthest, forward at the top, coloured by height."""
    tile = np.asarray(_blank()).copy()
    points = points[(points != 0).any(1)]
    if len(points):
        reach = float(np.quantile(np.abs(points[:, :2]), 0.98))
        spots = TILE / 2 + points[:, :2] / reach * (TILE / 2 - 4) * (1, -1)
        inside = ((spots >= 0) & (spots < TILE)).all(1)
        heights = (points[inside, 2] - points[:, 2].min()) / max(float(np.ptp(points[:, 2])), 1e-6)
        colours = [colorsys.hsv_to_rgb(0.66 * (1 - h), 0.9, 0.85) for h in heights]
        column, row = spots[inside].astype(int).T
        tile[row, column] = (255 * np.array(colours)).astype(np.uint8)
    return Image.fromarray(tile)


def _bars(numbers: np.ndarray) -> Image.Image:
    """Numbers side by side, from the middle up or down, by a scale that brings far ones near."""
    tile = _blank()
    pen, width = ImageDraw.Draw(tile), TILE / max(len(numbers), 1)
    heights = np.arctan(numbers.astype(float)) / (np.pi / 2) * (TILE / 2 - 8)
    for k, height in enumerate(heights):
        low, high = sorted((TILE / 2 - height, TILE / 2))
        left = k * width
        pen.rectangle([left, low, left + max(width - 1, 0.5), high], fill=(60, 110, 160))
    pen.line([0, TILE / 2, TILE, TILE / 2], fill=INK)
    return tile
