"""The small home of `tiny_home` with a crate of a mass of one's choice on its floor, named "ball", and a bare table."""

from __future__ import annotations

import json
import pathlib
import re

from tiny_home import write_tiny_home

HALF = (0.15, 0.25, 0.12)
"""m: half of the crate's edges."""

ASIDE = ("knife", "apple", "can", "sponge", "box")
"""What lies on the table otherwise."""


def write_heavy_crate(folder: pathlib.Path, mass: float) -> pathlib.Path:
    """The home's folder. mass: kg, of the crate."""
    home = write_tiny_home(folder / "crate")
    size = " ".join(map(str, HALF))
    density = mass / (8 * HALF[0] * HALF[1] * HALF[2])
    text = (home / "scene.xml").read_text()
    text = _replaced(
        text,
        r'<body name="ball" pos="[^"]*"([^>]*>.*?)type="sphere" size="0.1" density="300"',
        rf'<body name="ball" pos="-1 -1 {HALF[2]}"\1type="box" size="{size}" density="{density}"',
    )
    for number, name in enumerate(ASIDE):
        text = _replaced(
            text, rf'<body name="{name}" pos="[^"]*"', f'<body name="{name}" pos="1 {0.2 * number - 1.8} 0.06"'
        )
    (home / "scene.xml").write_text(text)
    manifest = json.loads((home / "manifest.json").read_text())
    crate = next(entry for entry in manifest["objects"] if entry["name"] == "ball")
    crate["mass"], crate["bounding_box"] = mass, [2 * half for half in HALF]
    (home / "manifest.json").write_text(json.dumps(manifest))
    return home


def _replaced(text: str, pattern: str, new: str) -> str:
    found, count = re.subn(pattern, new, text, flags=re.DOTALL)
    assert count == 1, pattern
    return found
