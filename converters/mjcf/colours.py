"""Flat colours for objects whose own look cannot be read: encrypted or missing visuals."""

from __future__ import annotations

import colorsys
import hashlib

from ..base.description import ROBOT_CATEGORY

Rgba = tuple[float, float, float, float]

#: Word in a category's name -> colour; the first that matches wins. Distinguishable household colours.
_BY_WORD: tuple[tuple[tuple[str, ...], Rgba], ...] = (
    ((ROBOT_CATEGORY,), (0.70, 0.70, 0.70, 1.0)),
    (("walls",), (0.93, 0.91, 0.87, 1.0)),
    (("floors",), (0.72, 0.62, 0.50, 1.0)),
    (("ceilings",), (0.96, 0.96, 0.95, 1.0)),
    (("window", "glass", "mirror"), (0.70, 0.83, 0.90, 0.55)),
    (("plant", "grass", "lettuce", "broccoli", "tree"), (0.30, 0.52, 0.28, 1.0)),
    (("fridge", "dishwasher", "washer", "dryer", "freezer"), (0.86, 0.87, 0.88, 1.0)),
    (("oven", "stove", "burner", "microwave", "range_hood", "grill"), (0.33, 0.34, 0.36, 1.0)),
    (("sink", "toilet", "bathtub", "shower"), (0.94, 0.95, 0.96, 1.0)),
    (("tv", "monitor", "laptop", "tablet", "phone"), (0.12, 0.12, 0.13, 1.0)),
    (("sofa", "armchair", "chaise", "couch"), (0.46, 0.52, 0.58, 1.0)),
    (("bed", "pillow", "sheet", "towel", "quilt"), (0.85, 0.82, 0.76, 1.0)),
    (("carpet", "rug", "curtain"), (0.58, 0.40, 0.36, 1.0)),
    (("door",), (0.62, 0.48, 0.34, 1.0)),
    (("cabinet", "shelf", "wardrobe", "dresser", "counter"), (0.68, 0.54, 0.40, 1.0)),
    (("table", "desk", "stand", "bench", "stool", "chair"), (0.58, 0.43, 0.29, 1.0)),
    (("lamp", "light", "chandelier", "candle"), (0.95, 0.88, 0.65, 1.0)),
    (("knife", "pan", "pot", "kettle", "fork", "spoon", "faucet"), (0.68, 0.70, 0.73, 1.0)),
    (("plate", "bowl", "cup", "mug"), (0.90, 0.92, 0.95, 1.0)),
)


def category_colour(category: str) -> Rgba:
    """A category's colour: a household one if the name matches, else a muted hue that depends on the name only."""
    words = category.lower().removeprefix("half_")
    for names, colour in _BY_WORD:
        if any(name in words for name in names):
            return colour
    digest = hashlib.sha256(words.encode()).digest()
    r, g, b = colorsys.hls_to_rgb(digest[0] / 255, 0.45 + digest[1] / 1275, 0.35 + digest[2] / 850)
    return (round(r, 3), round(g, 3), round(b, 3), 1.0)
