"""A jug over a glass over the floor, made by hand, with substances in use."""

from __future__ import annotations

import numpy as np
from hand_world import HandWorld, Item

from ig2mj.scene.manifest import InsideEntry

WALL = 0.004


def tub(x: float, y: float, z: float) -> tuple:
    """Boxes of a box without a lid: the half sizes of its room, whose middle is the origin."""
    return (
        ((0, 0, -z - WALL), (x + 2 * WALL, y + 2 * WALL, WALL)),
        ((x + WALL, 0, 0), (WALL, y, z)),
        ((-x - WALL, 0, 0), (WALL, y, z)),
        ((0, y + WALL, 0), (x + 2 * WALL, WALL, z)),
        ((0, -y - WALL, 0), (x + 2 * WALL, WALL, z)),
    )


def inside(x: float, y: float, z: float) -> InsideEntry:
    """Of a `tub`."""
    corners = [
        (float(a * x), float(b * y), float(c * z)) for c in (-1, 1) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return InsideEntry(litres=8000.0 * x * y * z, vertices=corners, rim=corners[4:])


def container(name: str, size: tuple[float, float, float], pos=(0, 0, 0), **more) -> Item:
    """An object that is a `tub`."""
    return Item(name, tub(*size), pos=pos, inside=inside(*size), **more)


JUG, GLASS = (0.05, 0.05, 0.1), (0.04, 0.04, 0.05)
"""Half sizes: 2 litres and 0.64 litres."""

FLOOR = Item("floor", (((0, 0, -0.05), (3, 3, 0.05)),), category="floors", fixed=True, floor=True)
SPONGE = Item(
    "sponge",
    (((0, 0, 0), (0.05, 0.05, 0.02)),),
    {"cleaningTool": {}, "soakable": {"wetness_soaked": 1.0}},
    pos=(2, 2, 0.02),
)
SINK = container(
    "sink",
    (0.15, 0.15, 0.06),
    (2, 0, 0.8),
    abilities={"waterSource": {}, "toggleable": {}, "waterSink": {}},
    links={"water_source": (0, 0, 0.4)},
    fixed=True,
)
SUBSTANCES = ("water", "olive_oil", "liquid_soap", "mud", "salt")


def world(*more: Item, substances=SUBSTANCES) -> HandWorld:
    """A jug 0.5 m over the floor, a glass on the floor, a sponge and a sink."""
    jug = container("jug", JUG, (0, 0, 0.5))
    glass = container("glass", GLASS, (0.15, 0, GLASS[2] + 2 * WALL))
    return HandWorld(FLOOR, jug, glass, SPONGE, SINK, *more, substances=substances)


def tilted(degrees: float) -> tuple[float, float, float, float]:
    """Turned about y: towards +x."""
    half = np.deg2rad(degrees) / 2
    return float(np.cos(half)), 0.0, float(np.sin(half)), 0.0
