"""materials/: the classes that material_groups.json files name, one instance each, for iGibson's texture randomiser.

iGibson's materials.json is class -> instance -> {diffuse, metallic, roughness, normal}, relative paths or
null; material_friction.json is class -> friction of a link that wears it.
"""

from __future__ import annotations

import io
import json
import pathlib
import random

from PIL import Image

from ..shapes import textures
from ..shapes.materials import colour

#: Class -> colour of its instance; what is not wood or cloth is a speckle.
CLASSES = {
    "cardboard": "cardboard",
    "ceramic": "porcelain",
    "fabric": "beige",
    "glass": "glass",
    "leather": "brown",
    "marble": "grey",
    "metal": "steel",
    "mirror": "silver",
    "organic": "leaf",
    "paper": "paper",
    "picture": "cream",
    "plastic": "light_grey",
    "rubber": "rubber",
    "screen": "black",
    "tile": "white",
    "wood": "oak",
}
FRICTION = 0.5  # iGibson's default where it knows nothing


def write_material_library(root: pathlib.Path, seed: int = 0) -> None:
    """Writes `materials/` below a dataset root; same seed, same bytes."""
    folder = root / "materials"
    library = {}
    for name, tone in CLASSES.items():
        picture = f"{name}/plain/diffuse.png"
        (folder / name / "plain").mkdir(parents=True, exist_ok=True)
        buffer = io.BytesIO()
        _texture(name, tone, random.Random(f"{seed}/{name}")).save(buffer, "PNG", optimize=True)
        (folder / picture).write_bytes(buffer.getvalue())
        library[name] = {"plain": {"diffuse": picture, "metallic": None, "roughness": None, "normal": None}}
    for file, content in (("materials.json", library), ("material_friction.json", dict.fromkeys(CLASSES, FRICTION))):
        (folder / file).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8", newline="\n")


def _texture(name: str, tone: str, rng: random.Random) -> Image.Image:
    rgb = colour(tone)
    if name == "wood":
        return textures.wood(rgb, rng)
    if name in ("fabric", "leather"):
        return textures.weave(rgb, rng)
    if name in ("metal", "mirror"):
        return textures.brushed(rgb, rng)
    return textures.speckle(rgb, rng, 0.1)
