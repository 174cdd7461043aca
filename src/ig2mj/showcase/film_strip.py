"""A video strip: a few frames of a video side by side in one image, for a page."""

from __future__ import annotations

import os
import pathlib

import numpy as np
from jaxtyping import UInt8

FRAMES, GAP = 5, 6
"""Frames of a strip, and pixels of white between two."""

ENDINGS = (".png", ".jpg")


class FilmStrip:
    """Takes frames as `viewer.video.VideoWriter` does; written when it is closed."""

    def __init__(self, file: str | os.PathLike, frames: int = FRAMES):
        """`frames`: how many of all that are added are shown, evenly spaced, the first and the last among them."""
        self._file, self._count, self._added = pathlib.Path(file), frames, list[UInt8[np.ndarray, "Y X 3"]]()

    def add(self, frame: UInt8[np.ndarray, "Y X 3"]) -> None:
        """Adds a frame."""
        self._added.append(np.array(frame))

    def close(self) -> None:
        """Writes the image; without a frame there is none. Raises OSError."""
        from PIL import Image

        if not self._added:
            return
        chosen = [self._added[k] for k in np.linspace(0, len(self._added) - 1, self._count).round().astype(int)]
        gap = np.full((chosen[0].shape[0], GAP, 3), 255, np.uint8)
        parts = [part for frame in chosen for part in (frame, gap)][:-1]
        Image.fromarray(np.concatenate(parts, axis=1)).save(self._file)
        self._added.clear()
