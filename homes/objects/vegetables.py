"""Vegetables, herbs, nuts and the fruit that is not cut in halves."""

from __future__ import annotations

import itertools
import math
import random
from typing import Any

import numpy as np

from ..shapes import materials
from ..shapes.bricks import Solid, ball, block, cylinder, hull, lathe, rod, soft_box, tube
from .entry import Entry
from .fruit import onion, round_fruit
from .model import ObjectBuilder


def long_root(
    b: ObjectBuilder, *, skins: tuple, taper: float = 0.25, leaves: str | None = None, ends: float = 0.7
) -> None:
    """A carrot or cucumber lying along x. taper: the tip's radius, ends: the blunt end's, relative to the thickest."""
    x, y, z = b.size
    skin = materials.skin(b.pick(skins), b.rng, 0.12)
    tuft = 0.12 * x if leaves else 0.0
    h = x - tuft
    r = z / 2
    profile = [
        (taper * 0.5 * r, 0),
        (max(taper, 0.15) * r, 0.06 * h),
        (r * (0.5 + 0.5 * taper), 0.4 * h),
        (r, 0.8 * h),
        (0.95 * r, 0.93 * h),
        (ends * r * 0.8, h),
    ]
    b.add(lathe(profile, 14, split=[0.4 * h]).at(z=-x / 2).turned("y", 90).scaled(y=y / z).at(z=r), skin)
    if leaves:
        green = materials.plain(leaves, "organic")
        for k in range(6):
            a = 2 * math.pi * k / 6
            tip = (x / 2, 0.8 * r * math.cos(a), r + 0.8 * r * math.sin(a))
            b.add(rod((x / 2 - tuft - 0.004, 0, r), tip, 0.08 * r, 5).visual_only(), green)


def bent(
    b: ObjectBuilder, *, skins: tuple, curve: float = 60.0, tip: str | None = "dark_green", taper: float = 0.45
) -> None:
    """A banana, chili or bean: a bent bar lying on its side; three hulls."""
    x, _, z = b.size
    r = z / 2
    radius = x / 2 / math.sin(math.radians(curve))
    angles = np.radians(np.linspace(-curve, curve, 10))
    middle = [
        (radius * math.sin(a), radius * (math.cos(a) - (1 + math.cos(math.radians(curve))) / 2), r) for a in angles
    ]
    skin = materials.skin(b.pick(skins), b.rng, 0.08)
    b.add(swept(middle, [r * taper, *[r * t for t in (0.8, 0.95, 1, 1, 1, 1, 0.95, 0.75)], r * taper * 0.8]), skin)
    if tip:
        b.add(
            ball(r * taper * 1.9, r * taper * 1.9, r * taper * 1.9, 8)
            .visual_only()
            .at(*middle[-1][:2], r * (1 - taper * 0.95)),
            materials.plain(tip, "organic"),
        )


def swept(path: list, radii: list[float], sides: int = 10, hulls: int = 3) -> Solid:
    """A tube whose radius changes along its path."""
    solid = tube(path, 1.0, sides, hulls=0)
    mesh = solid.visuals[0]
    points = np.asarray(path, float)
    rings = mesh.vertices.reshape(len(path), sides, 3)
    scaled = points[:, None] + (rings - points[:, None]) * np.asarray(radii)[:, None, None]
    mesh.vertices = scaled.reshape(-1, 3)
    edges = np.linspace(0, len(path) - 1, hulls + 1).round().astype(int)
    pieces = []
    for a, c in itertools.pairwise(edges):
        pieces.append(scaled[a : c + 1][:, ::2].reshape(-1, 3))
    return Solid((mesh,), tuple(pieces))


SPRIG = 3
"""Number of the first parsley that is a sprig, for a piece of cheese; only the object library has such."""


def parsley(b: ObjectBuilder, **options: Any) -> None:
    """A bunch; from number `SPRIG` on a sprig of it."""
    if b.index >= SPRIG:
        x, y, z = b.size
        b.size, b.mass = (0.35 * x, 0.4 * y, 0.5 * z), 0.004
    bunch(b, **options)


SMALL = 4
"""Number of the first pumpkin of a size for drawers; only the object library has such."""


def pumpkin(b: ObjectBuilder, **options: Any) -> None:
    """Large; from number `SMALL` on small, for decoration."""
    if b.index >= SMALL:
        x, y, z = b.size
        b.size, b.mass = (0.6 * x, 0.6 * y, 0.6 * z), 0.9
    ribbed(b, **options)


def ribbed(b: ObjectBuilder, *, skins: tuple, ribs: int = 8, stem: str = "brown", depth: float = 0.12) -> None:
    """A pumpkin or pepper: a ball with ribs and a stalk."""
    x, y, z = b.size
    top = 0.14 * z
    body = ball(x, y, z - top, 4 * ribs)
    mesh = body.visuals[0]
    angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    mesh.vertices[:, :2] *= (1 - depth / 2 * (1 + np.cos(angle * ribs)))[:, None]
    b.add(body, materials.skin(b.pick(skins), b.rng, 0.1))
    b.add(
        lathe([(0.07 * x, 0), (0.05 * x, 2 * top)], 8).visual_only().at(z=z - 2 * top), materials.plain(stem, "organic")
    )


def head(b: ObjectBuilder, *, colour: str | tuple, loose: float = 0.12) -> None:
    """A head of leaves (lettuce, cabbage, artichoke): overlapping bent plates around a ball."""
    x, y, z = b.size
    b.add(ball(0.86 * x, 0.86 * y, 0.92 * z, 14), materials.skin(colour, b.rng, 0.12))
    for layer, count in ((0, 6), (1, 4)):
        for k in range(count):
            leaf = materials.plain(materials.tint(colour, b.rng, 0.15), "organic")
            shell = ball(0.13 * x, (0.62 - 0.1 * layer) * y, (0.8 + 0.16 * layer) * z, 10)
            shell = shell.turned("y", (14 - 4 * layer) * (0.5 + 4 * loose)).at((0.36 + loose * (1 - layer) * 0.5) * x)
            b.add(shell.visual_only().turned("z", 360 * (k + 0.5 * layer) / count), leaf)


def broccoli(b: ObjectBuilder) -> None:
    x, _, z = b.size
    green = materials.skin((0.18, 0.42, 0.16), b.rng, 0.4, 0.02)
    pale = materials.plain((0.60, 0.72, 0.40), "organic")
    b.add(lathe([(0.16 * x, 0), (0.2 * x, 0.5 * z), (0.3 * x, 0.6 * z)], 10), pale)
    for k in range(7):
        a = 2 * math.pi * k / 6
        out, up, r = (0.28 * x, 0.42 * z, 0.44 * x) if k < 6 else (0, 0.58 * z, 0.5 * x)
        knob = ball(r, r, min(r, z - up), 10).at(out * math.cos(a), out * math.sin(a), up)
        b.add(knob.visual_only(), green)
    b.add(lathe([(0.4 * x, 0.45 * z), (0.5 * x, 0.65 * z), (0.3 * x, z)], 10).collision_only(), green)


def bunch(
    b: ObjectBuilder,
    *,
    stem: str | tuple = "lime",
    leaf: str | tuple = "leaf",
    leafy: float = 0.5,
    count: int = 9,
    bulb: bool = False,
) -> None:
    """Herbs, celery or spring onions lying along x: stalks with a leafy end towards +x; one or two hulls."""
    x, y, z = b.size
    split = x / 2 - leafy * x
    green, pale = materials.plain(leaf, "organic"), materials.plain(stem, "organic")
    for k in range(count):
        yy, zz = b.rng.uniform(-0.3, 0.3) * y, (0.3 + 0.4 * b.rng.random()) * z
        b.add(rod((-x / 2, 0.4 * yy, 0.5 * z), (split + 0.1 * x, yy, zz), 0.1 * z, 5).visual_only(), pale)
        if bulb and k < 5:
            b.add(
                ball(0.08 * x, 0.3 * y, 0.5 * z, 8).visual_only().at(-x / 2 + 0.04 * x, 0.5 * yy, 0.25 * z),
                materials.plain("white", "organic"),
            )
        if leafy > 0:
            spread = b.rng.uniform(0.25, 0.45) * y * (1 if k % 2 else -1)
            start, w = split + b.rng.uniform(0, 0.3) * leafy * x, 0.12 * y
            points = [
                (start, yy, zz - 0.05 * z),
                (start + 0.3 * leafy * x, yy + w, zz),
                (start + 0.3 * leafy * x, yy - w, zz + 0.04 * z),
                (start + b.rng.uniform(0.5, 0.7) * leafy * x, yy + 0.5 * spread, zz + 0.2 * z * b.rng.uniform(-1, 1)),
            ]
            b.add(hull(points).visual_only(), green)
    b.add(
        hull(
            [(-x / 2, s * 0.25 * y, h * z) for s in (-1, 1) for h in (0.2, 0.8)]
            + [(split, s * 0.5 * y, h * z) for s in (-1, 1) for h in (0, 1)]
            + [(x / 2, s * 0.4 * y, h * z) for s in (-1, 1) for h in (0.1, 0.9)]
        ).collision_only(),
        green,
    )


def heap(b: ObjectBuilder, *, colours: tuple, grain: float = 0.35, count: int = 12) -> None:
    """A small heap of pieces or a bunch of berries; collides as one hull."""
    x, y, z = b.size
    size = grain * min(x, y, 2 * z)
    local = random.Random(b.rng.random())
    looks = [materials.plain(materials.tint(c, b.rng, 0.1), "organic") for c in colours]
    for k in range(count):
        a = 2.4 * k
        spread = math.sqrt((k + 0.5) / count)
        up = max(0.0, (1 - spread**2)) * (z - size)
        px, py = 0.5 * (x - size) * spread * math.cos(a), 0.5 * (y - size) * spread * math.sin(a)
        piece = ball(size * local.uniform(0.85, 1.1), size, size, 8)
        b.add(piece.visual_only().at(px, py, up), looks[k % len(looks)])
    b.add(lathe([(0.46, 0), (0.5, 0.35), (0.2, 1.0)], 8).collision_only().scaled(x, y, z), looks[0])


def cherry(b: ObjectBuilder) -> None:
    """A pair of cherries on one stalk."""
    x, y, z = b.size
    d = 0.55 * y
    skin = materials.plain(materials.tint("dark_red", b.rng), "organic", 0.6)
    for s in (-1, 1):
        b.add(ball(d, d, d, 12).at(-0.1 * x, s * (y - d) / 2, 0), skin)
        b.add(
            rod((-0.1 * x, s * (y - d) / 2, d * 0.9), (x / 2, 0, 0.9 * z), 0.015 * y, 5).visual_only(),
            materials.plain("leaf", "organic"),
        )


def nut(b: ObjectBuilder, *, colour: str | tuple) -> None:
    x, y, z = b.size
    b.add(ball(x, y, z, 10), materials.skin(colour, b.rng, 0.3, 0.02))


def corn(b: ObjectBuilder) -> None:
    """A cob in its opened husk."""
    x, y, z = b.size
    kernels = materials.skin((0.95, 0.80, 0.25), b.rng, 0.5, 0.012)
    r = z / 2
    cob = lathe([(0.6 * r, 0), (0.95 * r, 0.25 * x), (r, 0.5 * x), (0.8 * r, 0.8 * x), (0.3 * r, x)], 14)
    b.add(cob.at(z=-x / 2).turned("y", 90).at(z=r), kernels)
    for k in (-1, 1):
        husk = [
            (-x / 2, 0, r),
            (-0.1 * x, k * y / 2, 0.1 * z),
            (0.1 * x, k * 0.4 * y, 0.9 * z),
            (0.1 * x, k * 0.45 * y, r),
        ]
        b.add(hull(husk).visual_only(), materials.plain("lime", "organic"))


def ginger(b: ObjectBuilder) -> None:
    """A knobbly root."""
    x, y, z = b.size
    skin = materials.skin((0.78, 0.64, 0.42), b.rng, 0.25)
    for dx, dy, sx, sy in (
        (-0.2, 0.0, 0.6, 0.5),
        (0.2, 0.15, 0.55, 0.45),
        (0.05, -0.25, 0.3, 0.5),
        (0.36, -0.1, 0.28, 0.35),
    ):
        b.add(ball(sx * x, sy * y, z * 0.98, 10).at(dx * x, dy * y), skin)


def stick_spice(b: ObjectBuilder) -> None:
    """Three rolled sticks of cinnamon, tied."""
    x, y, z = b.size
    bark = materials.skin((0.50, 0.28, 0.14), b.rng, 0.3, 0.03, "wood")
    r = y / 6
    for k in range(3):
        b.add(cylinder(r, x, 10).at(z=-x / 2).turned("y", 90).at(0, (k - 1) * 2 * r, r), bark)
    b.add(block((0.06 * x, y, 0.002), (0, 0, 2 * r)).visual_only(), materials.plain("tan", "fabric"))
    del z


def garlic_clove(b: ObjectBuilder) -> None:
    """Cloves (the spice): a nail-shaped bud."""
    x, _, z = b.size
    r = z / 2
    brown = materials.plain((0.30, 0.16, 0.09), "organic")
    b.add(
        lathe([(0.35 * r, 0), (0.45 * r, 0.7 * x), (0.9 * r, 0.78 * x), (r, 0.9 * x), (0.5 * r, x)], 8)
        .at(z=-x / 2)
        .turned("y", 90)
        .at(z=r),
        brown,
    )


def grape(b: ObjectBuilder) -> None:
    """A bunch of grapes lying along x with its stalk."""
    x, y, z = b.size
    skin = materials.plain(
        materials.tint(b.pick(("purple", (0.62, 0.74, 0.32), (0.45, 0.12, 0.25))), b.rng), "organic", 0.5
    )
    size = 0.26 * y
    for k in range(18):
        u = (k + 0.5) / 18
        wide = 0.36 * math.sin(math.pi * min(1, 0.15 + 0.9 * u)) * (y - size)
        a = 2.4 * k
        place = ((u - 0.5) * (0.8 * x - size), wide * math.cos(a), (z - size) / 2 * (1 + math.sin(a) * 0.9))
        b.add(ball(size, size, size, 8).visual_only().at(*place), skin)
    b.add(
        tube([(0.38 * x, 0, z / 2), (0.45 * x, 0, 0.55 * z), (x / 2, 0.05 * y, 0.65 * z)], 0.04 * y, 5, hulls=0),
        materials.plain("brown", "organic"),
    )
    b.add(
        hull(
            [(-0.4 * x, s * 0.2 * y, h * z) for s in (-1, 1) for h in (0.2, 0.8)]
            + [(dx * x, s * 0.5 * y, h * z) for dx in (-0.1, 0.2) for s in (-1, 1) for h in (0.1, 0.9)]
            + [(0.4 * x, s * 0.2 * y, h * z) for s in (-1, 1) for h in (0, 1)]
        ).collision_only(),
        skin,
    )


def crumb(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(soft_box(x, y, z, 0.4 * z, 1), materials.skin("tan", b.rng, 0.3, 0.01))


def rosehip(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(ball(0.85 * x, y, z, 10).at(-0.07 * x), materials.skin("red", b.rng, 0.1))
    b.add(
        lathe([(0.1 * y, 0), (0.3 * y, 0.15 * x)], 6).visual_only().turned("y", 90).at(0.33 * x, 0, z / 2),
        materials.plain("brown", "organic"),
    )


GREEN = (0.30, 0.52, 0.22)
CATEGORIES = [
    Entry("banana", bent, (0.185, 0.070, 0.038), 0.12, 4,
          options={"skins": ("yellow", (0.85, 0.78, 0.30)), "curve": 50.0}),
    Entry("chili", bent, (0.110, 0.030, 0.018), 0.015, 3,
          options={"skins": ("red", "green"), "curve": 25.0, "taper": 0.3}),
    Entry("bean", bent, (0.120, 0.022, 0.010), 0.006, 3, options={"skins": (GREEN, "lime"), "curve": 20.0}),
    Entry("pea", bent, (0.085, 0.022, 0.013), 0.006, 3,
          options={"skins": ("lime", GREEN), "curve": 15.0, "taper": 0.3}),
    Entry("carrot", long_root, (0.200, 0.030, 0.030), 0.075, 4, options={"skins": ("orange",), "leaves": "leaf"}),
    Entry("radish", long_root, (0.075, 0.030, 0.030), 0.020, 3,
          options={"skins": ("rose", "red"), "taper": 0.08, "leaves": "leaf"}),
    Entry("cucumber", long_root, (0.240, 0.046, 0.046), 0.30, 3,
          options={"skins": ((0.16, 0.36, 0.14),), "taper": 0.75, "ends": 0.9}),
    Entry("zucchini", long_root, (0.200, 0.048, 0.048), 0.25, 3,
          options={"skins": ((0.22, 0.42, 0.18),), "taper": 0.85, "ends": 0.6}),
    Entry("eggplant", long_root, (0.210, 0.085, 0.085), 0.40, 3,
          options={"skins": ((0.22, 0.10, 0.26),), "taper": 0.5, "leaves": "leaf"}),
    Entry("turnip", onion, (0.085, 0.085, 0.085), 0.18, 3, uniform=True,
          options={"skins": ((0.86, 0.66, 0.72), (0.9, 0.88, 0.84))}),
    Entry("beet", onion, (0.075, 0.075, 0.085), 0.15, 3, uniform=True, options={"skins": ((0.42, 0.08, 0.18),)}),
    Entry("potato", nut, (0.100, 0.066, 0.056), 0.19, 4, options={"colour": (0.78, 0.64, 0.42)}),
    Entry("lime", round_fruit, (0.050, 0.058, 0.050), 0.07, 3, options={"skins": ((0.42, 0.65, 0.20),), "stem": None}),
    Entry("cantaloup", round_fruit, (0.150, 0.150, 0.145), 1.3, 3, uniform=True,
          options={"skins": ((0.78, 0.70, 0.48),), "stem": None, "depth": 0.4}),
    Entry("watermelon", round_fruit, (0.260, 0.340, 0.250), 7.0, 3, uniform=True, two_hands=True,
          options={"skins": ((0.18, 0.40, 0.18), (0.30, 0.50, 0.24)), "stem": None, "depth": 0.5}),
    Entry("pumpkin", pumpkin, (0.260, 0.260, 0.220), 4.0, SMALL, extra=1, rest="standing", uniform=True,
          options={"skins": ("orange", (0.85, 0.42, 0.12))}),
    Entry("bell_pepper", ribbed, (0.080, 0.080, 0.100), 0.16, 4, rest="standing", uniform=True,
          options={"skins": ("red", "yellow", "green", "orange"), "ribs": 4, "stem": "leaf"}),
    Entry("head_cabbage", head, (0.175, 0.175, 0.160), 1.0, 3, rest="standing", uniform=True,
          options={"colour": (0.66, 0.78, 0.50), "loose": 0.02}),
    Entry("lettuce", head, (0.160, 0.160, 0.140), 0.42, 3, rest="standing", uniform=True,
          options={"colour": (0.48, 0.70, 0.28)}),
    Entry("artichoke", head, (0.095, 0.095, 0.100), 0.25, 3, rest="standing", uniform=True,
          options={"colour": (0.40, 0.52, 0.28), "loose": 0.05}),
    Entry("broccoli", broccoli, (0.130, 0.130, 0.140), 0.32, 4, rest="standing", uniform=True),
    Entry("celery", bunch, (0.330, 0.080, 0.060), 0.45, 3,
          options={"leafy": 0.25, "stem": (0.66, 0.80, 0.46), "count": 8}),
    Entry("green_onion", bunch, (0.300, 0.045, 0.022), 0.08, 3, options={"leafy": 0.5, "stem": "white", "bulb": True}),
    Entry("parsley", parsley, (0.200, 0.110, 0.035), 0.04, SPRIG, extra=1, options={"leafy": 0.55, "count": 14}),
    Entry("basil", bunch, (0.160, 0.100, 0.040), 0.03, 3,
          options={"leafy": 0.6, "count": 12, "leaf": (0.24, 0.54, 0.20)}),
    Entry("chives", bunch, (0.220, 0.030, 0.015), 0.02, 2, options={"leafy": 0.0, "count": 14, "stem": "leaf"}),
    Entry("spinach", bunch, (0.190, 0.130, 0.045), 0.10, 3,
          options={"leafy": 0.65, "count": 16, "leaf": (0.14, 0.38, 0.14)}),
    Entry("green_onion_chopped", heap, (0.080, 0.080, 0.020), 0.02, 2,
          options={"colours": ("lime", "leaf", "white"), "grain": 0.24, "count": 34}),
    Entry("raspberry", heap, (0.022, 0.022, 0.024), 0.005, 3,
          options={"colours": ((0.78, 0.15, 0.25),), "grain": 0.36, "count": 16}),
    Entry("gooseberry", round_fruit, (0.018, 0.018, 0.018), 0.004, 2, options={"skins": ((0.62, 0.72, 0.36),)}),
    Entry("olive", round_fruit, (0.018, 0.024, 0.018), 0.005, 3,
          options={"skins": ((0.42, 0.46, 0.18), "black"), "stem": None}),
    Entry("cherry", cherry, (0.055, 0.050, 0.030), 0.016, 3),
    Entry("grape", grape, (0.170, 0.100, 0.070), 0.35, 4),
    Entry("almond", nut, (0.024, 0.013, 0.008), 0.0012, 2, options={"colour": (0.66, 0.44, 0.26)}),
    Entry("pistachio", nut, (0.020, 0.012, 0.011), 0.0011, 2, options={"colour": (0.80, 0.72, 0.54)}),
    Entry("walnut", nut, (0.040, 0.034, 0.033), 0.011, 2, options={"colour": (0.64, 0.48, 0.32)}),
    Entry("sweet_corn", corn, (0.200, 0.062, 0.050), 0.26, 3),
    Entry("ginger", ginger, (0.100, 0.070, 0.032), 0.10, 3),
    Entry("cinnamon", stick_spice, (0.085, 0.030, 0.010), 0.012, 2, vary=0.04),
    Entry("clove", garlic_clove, (0.015, 0.005, 0.005), 0.0002, 2),
    Entry("rosehip", rosehip, (0.022, 0.016, 0.016), 0.003, 2),
    Entry("crumb", crumb, (0.008, 0.007, 0.005), 0.0002, 2),
]  # fmt: skip
