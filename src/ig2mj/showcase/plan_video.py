"""A video of a plan that is carried out: a camera goes along with the robot, and the image says what it does."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import UInt8

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.images import HEIGHT, WIDTH
from ig2mj.showcase.cooking_images import caption_at, font
from ig2mj.showcase.film_strip import ENDINGS, FilmStrip
from ig2mj.viewer.episode_view import EpisodeView
from ig2mj.viewer.follow_camera import FollowCamera
from ig2mj.viewer.video import VideoWriter

SPEED, FRAMES_PER_SECOND = 3.0, 15.0
"""Times real time, and 1/s, of videos."""

MARGIN = 8
"""Pixels around words."""

LAST = 1.0
"""s for which the last image stays."""


class PlanVideo:
    """Writes one world of an environment to a file; `see` is called with every state."""

    def __init__(
        self,
        file: str | os.PathLike,
        env: Environment,
        world: int = 0,
        *,
        speed: float = SPEED,
        rate: float = FRAMES_PER_SECOND,
        size: tuple[int, int] = (WIDTH, HEIGHT),
        frames: int = 0,
    ):
        """
        Args:
          file: its ending says the format: a video (.mp4, .gif, .webp), or a strip of images (.png, .jpg).
          speed: times real time. rate: frames in a second. size: pixels, width and height. frames: of a strip; 0: five.

        Raises:
          InputError: another ending. MissingDependencyError: there is no ffmpeg.
        """
        self._env, self._world, self._size = env, world, size
        strip = pathlib.Path(file).suffix.lower() in ENDINGS
        if strip:
            self._video = FilmStrip(file, **({"frames": frames} if frames else {}))
        else:
            self._video = VideoWriter(file, *size, rate)
        self._every = max(1, round(speed / rate / env.period))
        self._rate, self._strip = rate, strip
        self._view, self._camera = EpisodeView(env, world, *size), FollowCamera(env.scene.tables)
        self._letters = font(max(11, round(size[1] / 24)))
        self._count = 0
        self._last: UInt8[np.ndarray, "Y X 3"] | None = None

    def see(self, state: EnvState, words: str = "", objects: Sequence[int] = (), now: bool = False) -> None:
        """Adds a frame, where one is due.

        Args:
          words: what the robot does. objects: numbers of what it does it to. now: a frame is due in any case.
        """
        self._count += 1
        if not now and (self._count - 1) % self._every:
            return
        pixels = self._view(state, camera=lambda model, data: self._camera(model, data, objects))
        seconds = float(np.asarray(state.info["steps"])[self._world]) * self._env.period
        self._last = self._captioned(pixels, ", ".join(part for part in (words, f"{seconds:.0f}\u00a0s") if part))
        self._video.add(self._last)

    def close(self) -> None:
        """Ends the file. Raises EngineError if ffmpeg could not write it."""
        if self._last is not None and not self._strip:
            for _ in range(round(LAST * self._rate)):
                self._video.add(self._last)
        self._video.close()

    def _captioned(self, pixels: UInt8[np.ndarray, "Y X 3"], words: str) -> UInt8[np.ndarray, "Y X 3"]:
        from PIL import Image, ImageDraw

        image = Image.fromarray(pixels)
        draw = ImageDraw.Draw(image)
        text = wrapped(words, self._size[0] - 2 * MARGIN, lambda line: draw.textlength(line, self._letters))
        below = draw.multiline_textbbox((0, 0), text, self._letters, stroke_width=2)[3]
        caption_at(draw, (MARGIN, round(self._size[1] - MARGIN / 2 - below)), text, self._letters)
        return np.asarray(image)


def wrapped(text: str, width: int, length: Callable[[str], float]) -> str:
    """Text in lines, broken at its spaces. `width`: of a line, in pixels. `length`: that of a text."""
    lines: list[str] = []
    for word in text.split(" "):
        if lines and length(f"{lines[-1]} {word}") <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return "\n".join(lines)
