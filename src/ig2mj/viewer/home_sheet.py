"""Contact sheets of homes: each one from above, and looks into its rooms."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from ig2mj.looks import visual_of
from ig2mj.scene.scene import Scene
from ig2mj.viewer.offscreen import render
from ig2mj.viewer.overview import home_overview
from ig2mj.viewer.room_views import room_view

TILE = (400, 300)  # pixels
FURTHER = 1.12
"""Than the overview that a window opens with: a plan longer than wide fills a tile's height."""
INK, PAPER = (25, 30, 38), (255, 255, 255)


def from_above(scenes: Sequence[Scene], columns: int = 4) -> Image.Image:
    """One RGB image with a labelled tile per home, seen from above and a little from the south."""
    tiles = []
    for scene in scenes:
        data = scene.start_data()
        view = home_overview(scene, data)
        view = dataclasses.replace(view, distance=FURTHER * view.distance)
        objects = sum(not entry.parked for entry in scene.manifest.objects) - 3  # walls, floors, ceilings
        text = f"{scene.name}: {len(scene.manifest.rooms.instances)} rooms, {objects} objects"
        tiles.append(_tile(scene, data, view, text))
    return _sheet(tiles, columns)


def rooms_inside(scenes: Sequence[Scene], columns: int = 4) -> Image.Image:
    """One RGB image with a labelled tile per room of the homes, from the eye height of a person in it."""
    tiles = []
    for scene in scenes:
        data = scene.start_data()
        rooms = scene.rooms.names if scene.rooms is not None else ()
        tiles += [_tile(scene, data, room_view(scene, room), f"{scene.name}: {room}") for room in rooms]
    return _sheet(tiles, columns)


def _tile(scene: Scene, data: mujoco.MjData, view, text: str) -> Image.Image:
    width, height = TILE
    visual = visual_of(scene)
    seen = visual.data(scene.model, data)
    drawn = Image.fromarray(render(visual.model, seen, view, width=2 * width, height=2 * height))
    image = drawn.resize(TILE, Image.Resampling.LANCZOS)
    pen = ImageDraw.Draw(image)
    pen.rectangle([0, height - 15, pen.textlength(text) + 8, height], fill=PAPER)
    pen.text((4, height - 13), text, fill=INK)
    return image


def _sheet(tiles: list[Image.Image], columns: int) -> Image.Image:
    width, height = TILE
    rows = max(math.ceil(len(tiles) / columns), 1)
    columns = max(math.ceil(len(tiles) / rows), 1)  # as few empty places as these rows allow
    sheet = Image.fromarray(np.full((rows * height, columns * width, 3), 255, np.uint8))
    for k, tile in enumerate(tiles):
        sheet.paste(tile, (k % columns * width, k // columns * height))
    return sheet
