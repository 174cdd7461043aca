"""Images of the cooking demo: the stove from the front, and the milk behind the fridge's doors, drawn as glass."""

from __future__ import annotations

import contextlib
import pathlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ig2mj.scene.geom_groups import HIDDEN_GROUP
from ig2mj.showcase.kitchen import Kitchen
from ig2mj.showcase.temperature_log import Moment
from ig2mj.simulation import Simulation
from ig2mj.viewer.offscreen import FreeView, default_backend

if TYPE_CHECKING:
    from PIL import Image, ImageDraw, ImageFont

GLASS = 0.15
"""Opacity of the fridge's doors in these images."""


class KitchenCameras:
    """Draws the two views of a world as it is."""

    def __init__(self, world: Simulation, kitchen: Kitchen):
        self._world, model, view = world, world.scene.model, world.view
        tables, fridge = world.scene.tables, world.scene.object_index(kitchen.fridge)
        doors = (tables.body_object == fridge) & (np.arange(model.nbody) != tables.object_root[fridge])
        self._doors = np.flatnonzero(doors[model.geom_bodyid] & (model.geom_group == 0))
        fish, milk = (np.array(view.object_com[0, world.scene.object_index(n)]) for n in (kitchen.fish, kitchen.milk))
        ahead = float(np.degrees(np.arctan2(kitchen.approach[1], kitchen.approach[0])))
        self._stove = FreeView(_point(0.55 * fish + 0.45 * kitchen.button), 0.9, ahead - 15, -35)
        self._milk = FreeView(_point(milk), 1.15, ahead, -12)

    def stove(self, width: int, height: int) -> np.ndarray:
        """uint8 [height, width, 3]: the stove, the pan with the fish, the hand."""
        return self._world.render(self._stove, width=width, height=height)

    def milk(self, width: int, height: int) -> np.ndarray:
        """uint8 [height, width, 3]: the fridge as if its closed doors were of glass, or not there without OpenGL."""
        with self._glass():
            return self._world.render(self._milk, width=width, height=height)

    @contextlib.contextmanager
    def _glass(self) -> Iterator[None]:
        model = self._world.model
        colour, group = model.geom_rgba[self._doors], model.geom_group[self._doors]  # copies
        model.geom_rgba[self._doors, 3] = GLASS
        if default_backend() == "warp":  # knows no transparency
            model.geom_group[self._doors] = HIDDEN_GROUP
        try:
            yield
        finally:
            model.geom_rgba[self._doors], model.geom_group[self._doors] = colour, group


class MomentSheet:
    """Four images on one sheet: the start, and the fish cooked, burnt, the milk frozen."""

    SIZE = (640, 480)

    def __init__(self, cameras: KitchenCameras, kitchen: Kitchen):
        self._cameras, self._kitchen = cameras, kitchen
        self._tiles: list[Image.Image] = []

    def see(self, caption: str, changed: list[Moment] | None = None) -> None:
        """Takes an image at the start (`changed` None), or where something changed that belongs on the sheet."""
        kitchen = self._kitchen
        for moment in changed or []:
            if moment.value and moment.object in (kitchen.fish, kitchen.milk):
                self._take(f"{moment}, {caption}", moment.object == kitchen.milk)
        if changed is None:
            self._take(caption, False)

    def _take(self, caption: str, milk: bool) -> None:
        from PIL import Image, ImageDraw

        image = Image.fromarray((self._cameras.milk if milk else self._cameras.stove)(*self.SIZE))
        caption_at(ImageDraw.Draw(image), (12, 10), caption, font(24))
        self._tiles.append(image)

    def write(self, file: pathlib.Path) -> None:
        """Two images a row."""
        from PIL import Image

        width, height = self.SIZE
        sheet = Image.new("RGB", (2 * width, (len(self._tiles) + 1) // 2 * height), "white")
        for k, tile in enumerate(self._tiles):
            sheet.paste(tile, (k % 2 * width, k // 2 * height))
        sheet.save(file)


def font(size: int) -> ImageFont.FreeTypeFont:
    """The font that comes with matplotlib."""
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(str(pathlib.Path(matplotlib.get_data_path()) / "fonts/ttf/DejaVuSans.ttf"), size)


def caption_at(draw: ImageDraw.ImageDraw, at: tuple[int, int], text: str, face: ImageFont.FreeTypeFont) -> None:
    """Dark letters with a light rim, legible on any image."""
    draw.text(at, text, fill=(25, 25, 25), font=face, stroke_width=2, stroke_fill=(255, 255, 255))


def _point(xyz: np.ndarray) -> tuple[float, float, float]:
    x, y, z = xyz.tolist()
    return x, y, z
