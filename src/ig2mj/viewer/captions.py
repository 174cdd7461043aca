"""Captions on images of videos."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from jaxtyping import UInt8

INK, PAPER = (28, 30, 34), (255, 255, 255)
"""rgb of letters and of the field behind them."""

OPACITY, SHARE = 0.78, 0.036
"""Of the field; height of letters as a share of the image's."""


def caption(image: UInt8[np.ndarray, "Y X 3"], words: str) -> UInt8[np.ndarray, "Y X 3"]:
    """The image with words on a light field in its lower left corner; as it is where there are none."""
    if not words:
        return image
    from PIL import Image, ImageDraw

    height = image.shape[0]
    letters = _letters(max(11, round(SHARE * height)))
    plain = Image.fromarray(image)
    left, _, right, _ = ImageDraw.Draw(plain).textbbox((0, 0), words, font=letters)
    pad = round(0.35 * letters.size)
    width, tall = round(right - left) + 2 * pad, round(letters.size * 1.15) + 2 * pad
    x, y = round(0.025 * height), height - tall - round(0.025 * height)
    field = Image.new("RGBA", plain.size, (0, 0, 0, 0))
    draw = ImageDraw.Draw(field)
    draw.rounded_rectangle((x, y, x + width, y + tall), radius=pad, fill=(*PAPER, round(255 * OPACITY)))
    draw.text((x + pad - left, y + pad), words, font=letters, fill=(*INK, 255))
    return np.asarray(Image.alpha_composite(plain.convert("RGBA"), field).convert("RGB"))


@functools.cache
def _letters(size: int) -> Any:
    from PIL import ImageFont

    return ImageFont.load_default(size)
