"""The cooking demo's video: stove and fridge side by side, the temperatures growing below, faster than real time."""

from __future__ import annotations

import pathlib

import numpy as np

from ig2mj.showcase.cooking import LONGEST
from ig2mj.showcase.cooking_images import KitchenCameras, caption_at, font
from ig2mj.showcase.cooking_plot import FISH_COLOUR, MILK_COLOUR
from ig2mj.showcase.kitchen import Kitchen
from ig2mj.showcase.temperature_log import TemperatureLog
from ig2mj.viewer.video import VideoWriter

WIDTH, HEIGHT, STRIP = 640, 480, 160
"""Pixels; the strip with the temperatures is part of the height."""
FRAMES_PER_SECOND = 25
STRIDE = 8
"""Control steps of 1/30 s from frame to frame: 6.7 times real time; `cooking.LONGEST` becomes 7.2 s."""
COLDEST, HOTTEST = -35.0, 250.0
"""Celsius at the lower and upper edge of the strip."""


class CookingVideo:
    """Writes an mp4 file frame by frame."""

    def __init__(self, file: pathlib.Path, cameras: KitchenCameras, kitchen: Kitchen):
        self._cameras, self._kitchen = cameras, kitchen
        self._words, self._small = font(20), font(13)
        self._video = VideoWriter(file, WIDTH, HEIGHT, FRAMES_PER_SECOND)

    def see(self, log: TemperatureLog) -> None:
        """Adds a frame if one is due. Raises EngineError if ffmpeg does not take it."""
        if log.steps % STRIDE == 0:
            self._video.add(self.frame(log))

    def frame(self, log: TemperatureLog) -> np.ndarray:
        """uint8 [HEIGHT, WIDTH, 3]: the world and its past."""
        from PIL import Image, ImageDraw

        kitchen, half, tall = self._kitchen, WIDTH // 2, HEIGHT - STRIP
        picture = Image.new("RGB", (WIDTH, HEIGHT), "white")
        picture.paste(Image.fromarray(self._cameras.stove(half, tall)), (0, 0))
        picture.paste(Image.fromarray(self._cameras.milk(half, tall)), (half, 0))
        picture.paste(self._strip(log), (0, tall))
        draw = ImageDraw.Draw(picture)
        for left, name, truths in (
            (0, kitchen.fish, ("burnt", "cooked")),
            (half, kitchen.milk, ("frozen",)),
        ):
            state = next((t for t in truths if log.truths[t, name][-1]), "")
            kind = name.rpartition("_")[0] or name
            caption_at(draw, (left + 8, 6), f"{kind} {round(log.temperatures[name][-1])} °C  {state}", self._words)
        on = "on" if log.truths["toggled_on", kitchen.stove][-1] else "off"
        caption_at(draw, (8, tall - 26), f"stove {on}", self._small)
        speed = STRIDE * FRAMES_PER_SECOND * (log.times[-1] - log.times[0]) / max(log.steps, 1)
        clock = f"{log.times[-1]:.1f} s" + (f"  (x {speed:.1f})" if log.steps else "")
        caption_at(draw, (half + 8, tall - 26), clock, self._small)
        return np.asarray(picture)

    def _strip(self, log: TemperatureLog):
        """The curves so far, drawn twice as large and reduced, which smooths the lines."""
        from PIL import Image, ImageDraw

        scale, kitchen = 2, self._kitchen
        strip = Image.new("RGB", (WIDTH * scale, STRIP * scale), "white")
        draw, small = ImageDraw.Draw(strip), font(11 * scale)

        def y(celsius: float) -> float:
            return (HOTTEST - celsius) / (HOTTEST - COLDEST) * STRIP * scale

        for celsius, what, colour, lift in (
            (kitchen.burn, "burnt", FISH_COLOUR, 14),
            (kitchen.cook, "cooked", FISH_COLOUR, 14),
            (kitchen.freeze, "frozen", MILK_COLOUR, -1),
        ):
            draw.line([(0, y(celsius)), (WIDTH * scale, y(celsius))], fill=(205, 205, 205), width=scale)
            place = ((WIDTH - 4) * scale, y(celsius) - lift * scale)
            draw.text(place, f"{what} {celsius:g} °C", fill=colour, font=small, anchor="ra")
        for name, colour in ((kitchen.fish, FISH_COLOUR), (kitchen.milk, MILK_COLOUR)):
            points = [
                ((t - log.times[0]) / LONGEST * WIDTH * scale, y(v))
                for t, v in zip(log.times, log.temperatures[name], strict=True)
            ]
            if len(points) > 1:
                draw.line(points, fill=colour, width=2 * scale, joint="curve")
            x, at = points[-1]
            draw.ellipse((x - 4 * scale, at - 4 * scale, x + 4 * scale, at + 4 * scale), fill=colour)
        return strip.resize((WIDTH, STRIP), Image.Resampling.LANCZOS)

    def close(self) -> None:
        """Ends the file, once. Raises EngineError if ffmpeg could not write it."""
        self._video.close()
