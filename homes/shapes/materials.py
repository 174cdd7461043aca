"""Materials: a name, a colour, perhaps a texture, and the class iGibson sorts it under (material_groups.json)."""

from __future__ import annotations

import dataclasses
import random

from PIL import Image

from . import textures
from .textures import RGB

COLOURS: dict[str, RGB] = {
    "oak": (0.76, 0.60, 0.40), "pine": (0.85, 0.71, 0.50), "walnut": (0.42, 0.28, 0.18), "cherry": (0.58, 0.32, 0.20),
    "birch": (0.88, 0.79, 0.64), "ash": (0.70, 0.64, 0.55), "ebony": (0.20, 0.16, 0.14), "teak": (0.60, 0.42, 0.24),
    "white": (0.95, 0.95, 0.94), "cream": (0.94, 0.90, 0.80), "beige": (0.82, 0.74, 0.62), "grey": (0.55, 0.56, 0.58),
    "light_grey": (0.76, 0.77, 0.78), "dark_grey": (0.25, 0.26, 0.28), "black": (0.09, 0.09, 0.10),
    "red": (0.75, 0.13, 0.12), "dark_red": (0.50, 0.09, 0.10), "orange": (0.92, 0.50, 0.12),
    "yellow": (0.95, 0.80, 0.20), "green": (0.25, 0.55, 0.25), "dark_green": (0.13, 0.33, 0.18),
    "lime": (0.60, 0.75, 0.25), "mint": (0.65, 0.85, 0.75), "blue": (0.16, 0.36, 0.68), "navy": (0.11, 0.16, 0.34),
    "sky": (0.55, 0.75, 0.90), "teal": (0.12, 0.48, 0.50), "purple": (0.42, 0.22, 0.52), "pink": (0.92, 0.60, 0.68),
    "rose": (0.80, 0.36, 0.45), "brown": (0.42, 0.27, 0.16), "tan": (0.76, 0.60, 0.42), "gold": (0.83, 0.66, 0.26),
    "silver": (0.78, 0.79, 0.81), "steel": (0.66, 0.68, 0.70), "copper": (0.72, 0.44, 0.28),
    "iron": (0.22, 0.22, 0.23), "brass": (0.72, 0.58, 0.28), "terracotta": (0.72, 0.40, 0.27),
    "cardboard": (0.70, 0.54, 0.36), "paper": (0.96, 0.95, 0.91), "leaf": (0.22, 0.48, 0.16),
    "soil": (0.23, 0.16, 0.10), "glass": (0.80, 0.90, 0.92), "porcelain": (0.97, 0.97, 0.96),
    "rubber": (0.13, 0.13, 0.13), "chrome": (0.82, 0.83, 0.85),
}  # fmt: skip

WOODS = ("oak", "pine", "walnut", "cherry", "birch", "ash", "teak")
PAINTS = ("white", "cream", "light_grey", "grey", "navy", "mint", "sky", "beige")
CLOTHS = ("blue", "red", "grey", "beige", "green", "navy", "teal", "rose", "purple", "orange", "cream", "dark_grey")
BRIGHT = ("red", "blue", "yellow", "green", "orange", "purple", "pink", "teal", "lime", "sky")


@dataclasses.dataclass(frozen=True)
class Material:
    """name: unique inside a model. tile: metres that a texture's repeat covers (box mapping). kind: iGibson's class."""

    name: str
    rgb: RGB
    alpha: float = 1.0
    texture: Image.Image | None = None
    tile: float = 0.5
    kind: str = "plastic"
    shine: float = 0.3


def colour(name: str | RGB) -> RGB:
    return COLOURS[name] if isinstance(name, str) else name


def _label(name: str | RGB) -> str:
    return name if isinstance(name, str) else "rgb_" + "_".join(f"{int(255 * c):02x}" for c in name)


def tint(name: str | RGB, rng: random.Random, spread: float = 0.08) -> RGB:
    """A colour near the named one: brightness and each channel moved by up to `spread`, relatively."""
    shade = rng.uniform(1 - spread, 1 + spread)
    r, g, b = (min(1.0, max(0.0, c * shade * rng.uniform(1 - spread / 2, 1 + spread / 2))) for c in colour(name))
    return (round(r, 4), round(g, 4), round(b, 4))


def plain(name: str | RGB, kind: str = "plastic", shine: float = 0.3) -> Material:
    """One flat colour."""
    return Material(_label(name), colour(name), kind=kind, shine=shine)


def wood(name: str | RGB, rng: random.Random, tile: float = 0.4) -> Material:
    rgb = tint(name, rng)
    return Material(f"wood_{_label(name)}", rgb, texture=textures.wood(rgb, rng), tile=tile, kind="wood", shine=0.15)


def metal(name: str | RGB, rng: random.Random | None = None) -> Material:
    """Metal; brushed where a generator is given."""
    rgb = colour(name)
    picture = textures.brushed(rgb, rng) if rng else None
    return Material(f"metal_{_label(name)}", rgb, texture=picture, tile=0.3, kind="metal", shine=0.7)


def fabric(name: str | RGB, rng: random.Random, tile: float = 0.06) -> Material:
    rgb = tint(name, rng)
    return Material(
        f"fabric_{_label(name)}", rgb, texture=textures.weave(rgb, rng), tile=tile, kind="fabric", shine=0.05
    )


def leather(name: str | RGB, rng: random.Random) -> Material:
    rgb = tint(name, rng)
    return Material(
        f"leather_{_label(name)}", rgb, texture=textures.speckle(rgb, rng, 0.12), tile=0.2, kind="leather", shine=0.3
    )


def stone(name: str | RGB, rng: random.Random, tile: float = 0.4) -> Material:
    rgb = tint(name, rng)
    return Material(
        f"stone_{_label(name)}", rgb, texture=textures.speckle(rgb, rng), tile=tile, kind="marble", shine=0.4
    )


def skin(
    name: str | RGB, rng: random.Random, depth: float = 0.15, tile: float = 0.08, kind: str = "organic"
) -> Material:
    """Fruit skin, bread crust, meat: a speckled colour."""
    rgb = tint(name, rng)
    picture = textures.speckle(rgb, rng, depth)
    return Material(f"skin_{_label(name)}", rgb, texture=picture, tile=tile, kind=kind, shine=0.2)


def picture(name: str, image: Image.Image, tile: float = 1.0, kind: str = "paper", shine: float = 0.1) -> Material:
    """An image; its flat stand-in colour is the image's mean."""
    mean = image.convert("RGB").resize((1, 1), Image.Resampling.BOX).getpixel((0, 0))
    assert isinstance(mean, tuple)
    r, g, b = (round(c / 255, 4) for c in mean[:3])
    return Material(name, (r, g, b), texture=image, tile=tile, kind=kind, shine=shine)


def glass(name: str | RGB = "glass", alpha: float = 0.35) -> Material:
    return Material(f"glass_{_label(name)}", colour(name), alpha=alpha, kind="glass", shine=0.9)


def glow(name: str | RGB = "cream") -> Material:
    """A lamp's shade or bulb."""
    return Material(f"glow_{_label(name)}", colour(name), kind="fabric", shine=0.0)
