"""Round fruit and vegetables that are cut in halves, and their half categories."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

from ..shapes import materials
from ..shapes.bricks import ball, hull, lathe, rod
from ..shapes.materials import Material
from .entry import Entry, Family
from .halves import cut_half
from .model import ObjectBuilder

Flesh = Callable[[random.Random], Material]


def flesh(rgb: tuple[float, float, float]) -> Flesh:
    """The material of a cut face."""
    return lambda rng: materials.skin(rgb, rng, 0.08)


def round_fruit(b: ObjectBuilder, *, skins: tuple = ("red",), stem: str | None = "brown", depth: float = 0.12) -> None:
    """A ball with a dimple's stem or a leaf star. stem: colour of a stalk, "star" for green leaves, None."""
    x, y, z = b.size
    top = 0.06 * z if stem else 0.0
    b.add(ball(x, y, z - top), materials.skin(b.pick(skins), b.rng, depth))
    if stem == "star":
        for k in range(5):
            a = 2 * math.pi * k / 5
            tip = (0.3 * x * math.cos(a), 0.3 * y * math.sin(a), z - 2.2 * top)
            b.add(rod((0, 0, z - top * 0.9), tip, 0.03 * x, 4).visual_only(), materials.plain("leaf", "organic"))
    elif stem:
        b.add(rod((0, 0, z - 2 * top), (0.03 * x, 0, z), 0.025 * x, 5).visual_only(), materials.plain(stem, "organic"))


def pear(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    profile = [
        (0.35 * r, 0),
        (0.85 * r, 0.12 * z),
        (r, 0.3 * z),
        (0.85 * r, 0.48 * z),
        (0.5 * r, 0.66 * z),
        (0.42 * r, 0.8 * z),
        (0.25 * r, 0.92 * z),
    ]
    b.add(lathe(profile, split=[0.55 * z]), materials.skin(b.pick(("lime", "yellow", (0.70, 0.62, 0.30))), b.rng))
    b.add(rod((0, 0, 0.9 * z), (0.05 * r, 0, z), 0.05 * r, 5).visual_only(), materials.plain("brown", "organic"))


def lemon(b: ObjectBuilder, *, skins: tuple = ("yellow",)) -> None:
    """A lemon lying along y, so that the cut at x = 0 shows its length."""
    x, y, z = b.size
    r, h = z / 2, y
    profile = [
        (0.12 * r, 0),
        (0.22 * r, 0.07 * h),
        (0.75 * r, 0.2 * h),
        (r, 0.45 * h),
        (0.95 * r, 0.6 * h),
        (0.7 * r, 0.8 * h),
        (0.25 * r, 0.94 * h),
        (0.1 * r, h),
    ]
    b.add(
        lathe(profile, 16).at(z=-h / 2).turned("x", 90).scaled(x=x / z).at(z=r),
        materials.skin(b.pick(skins), b.rng, 0.1),
    )


def strawberry(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(
        lathe([(0.15 * r, 0), (0.65 * r, 0.25 * z), (r, 0.65 * z), (0.85 * r, 0.85 * z), (0.2 * r, 0.92 * z)], 14),
        materials.skin("red", b.rng, 0.3, 0.02),
    )
    for k in range(5):
        a = 2 * math.pi * k / 5
        b.add(
            rod((0, 0, 0.93 * z), (0.8 * r * math.cos(a), 0.8 * r * math.sin(a), 0.88 * z), 0.1 * r, 4).visual_only(),
            materials.plain("leaf", "organic"),
        )


def mushroom(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    colour = b.pick(((0.93, 0.88, 0.80), (0.66, 0.48, 0.34)))
    b.add(
        lathe([(0.42 * r, 0), (0.34 * r, 0.3 * z), (0.36 * r, 0.55 * z)], 14),
        materials.skin((0.94, 0.91, 0.85), b.rng, 0.06),
    )
    b.add(
        lathe([(0.9 * r, 0.45 * z), (r, 0.55 * z), (0.85 * r, 0.8 * z), (0.4 * r, 0.97 * z), (0.0, z)], 16),
        materials.skin(colour, b.rng, 0.1),
    )


def pineapple(b: ObjectBuilder) -> None:
    """A rough barrel with a tuft of leaves."""
    x, _, z = b.size
    r, h = x / 2, 0.62 * z
    skin = materials.skin((0.74, 0.53, 0.20), b.rng, 0.5, 0.03)
    b.add(lathe([(0.6 * r, 0), (0.95 * r, 0.25 * h), (r, 0.5 * h), (0.9 * r, 0.8 * h), (0.45 * r, h)], 16), skin)
    leaf = materials.plain("leaf", "organic")
    for ring_, (count, out, up) in enumerate(((7, 0.8, 0.75), (6, 0.5, 0.92), (4, 0.2, 1.0))):
        for k in range(count):
            a = 2 * math.pi * (k + 0.5 * ring_) / count
            c, s = math.cos(a), math.sin(a)
            w = 0.13 * r
            points = [
                (-s * w, c * w, 0.97 * h),
                (s * w, -c * w, 0.97 * h),
                (0.12 * r * c, 0.12 * r * s, h * 0.95),
                (out * r * c, out * r * s, up * z),
            ]
            b.add(hull(points).visual_only(), leaf)
    b.add(lathe([(0.35 * r, h), (0.6 * r, 0.85 * z), (0.2 * r, z)], 8).collision_only(), leaf)


def onion(b: ObjectBuilder, *, skins: tuple = ((0.80, 0.55, 0.24),)) -> None:
    x, _, z = b.size
    r = x / 2
    profile = [(0.12 * r, 0), (0.7 * r, 0.12 * z), (r, 0.4 * z), (0.8 * r, 0.62 * z), (0.25 * r, 0.8 * z), (0.1 * r, z)]
    b.add(lathe(profile, 16), materials.skin(b.pick(skins), b.rng, 0.12))


def half_of(b: ObjectBuilder, *, whole: Family, inside: Flesh, options: dict | None = None) -> None:
    """A half category (half_apple): the whole built at twice the depth, cut, and laid into this builder."""
    x, y, z = b.size
    maker = ObjectBuilder(b.category, "whole", (2 * x, y, z), b.rng, b.index)
    whole(maker, **(options or {}))
    half, _ = cut_half(maker.finish(), 1.0, inside(b.rng), b.category, "half")
    b.base.visuals, b.base.hulls = half.base.visuals, half.base.hulls


Line = tuple[str, Family, tuple[float, float, float], float, tuple[float, float, float], dict]
_SLICEABLE: list[Line] = [
    ("apple", round_fruit, (0.076, 0.076, 0.074), 0.19, (0.96, 0.92, 0.76), {"skins": ("red", "lime", "dark_red",
                  "yellow")}),
    ("apricot", round_fruit, (0.046, 0.046, 0.046), 0.045, (0.95, 0.66, 0.30), {"skins": ((0.94, 0.66, 0.32),)}),
    ("chestnut", round_fruit, (0.032, 0.032, 0.026), 0.014, (0.93, 0.86, 0.66), {"skins": ((0.36, 0.18, 0.10),),
                  "stem": None}),
    ("coconut", round_fruit, (0.115, 0.115, 0.12), 0.68, (0.97, 0.96, 0.93), {"skins": ((0.36, 0.25, 0.16),),
                  "stem": None,
                                                                            "depth": 0.35}),
    ("kiwi", round_fruit, (0.048, 0.064, 0.046), 0.075, (0.55, 0.72, 0.24), {"skins": ((0.45, 0.36, 0.22),),
                  "stem": None}),
    ("lemon", lemon, (0.058, 0.085, 0.056), 0.11, (0.97, 0.91, 0.55), {"skins": ("yellow",)}),
    ("mushroom", mushroom, (0.050, 0.050, 0.045), 0.018, (0.95, 0.92, 0.86), {}),
    ("orange", round_fruit, (0.076, 0.076, 0.075), 0.18, (0.97, 0.68, 0.28), {"skins": ("orange",), "stem": None}),
    ("peach", round_fruit, (0.072, 0.072, 0.070), 0.15, (0.97, 0.82, 0.50), {"skins": ((0.93, 0.58, 0.38), (0.90,
                  0.45, 0.35))}),
    ("pear", pear, (0.074, 0.074, 0.110), 0.18, (0.96, 0.93, 0.80), {}),
    ("pineapple", pineapple, (0.120, 0.120, 0.290), 1.10, (0.95, 0.84, 0.38), {}),
    ("plum", round_fruit, (0.050, 0.050, 0.050), 0.066, (0.88, 0.66, 0.30), {"skins": ((0.32, 0.12, 0.28), "purple")}),
    ("pomegranate", round_fruit, (0.092, 0.092, 0.090), 0.28, (0.70, 0.12, 0.18), {"skins": ((0.70, 0.18, 0.20),)}),
    ("pomelo", round_fruit, (0.150, 0.150, 0.145), 1.00, (0.96, 0.80, 0.70), {"skins": ((0.84, 0.82, 0.42),),
                  "stem": None}),
    ("strawberry", strawberry, (0.034, 0.034, 0.042), 0.018, (0.93, 0.52, 0.48), {}),
    ("tomato", round_fruit, (0.072, 0.072, 0.058), 0.125, (0.86, 0.32, 0.24), {"skins": ("red", (0.82, 0.25, 0.12)),
                  "stem": "star"}),
    ("vidalia_onion", onion, (0.088, 0.088, 0.080), 0.22, (0.95, 0.93, 0.86), {}),
]  # fmt: skip

CATEGORIES = [
    Entry(
        *(name, build, size, mass, 4),
        extra=4 if name == "apple" else 0,
        rest="standing",
        uniform=True,
        wide=True,
        flesh=flesh(rgb),
        options=options,
    )
    for name, build, size, mass, rgb, options in _SLICEABLE
] + [
    Entry(f"half_{name}", half_of, (size[0] / 2, size[1], size[2]), mass / 2, 2, uniform=True,
          options={"whole": build, "inside": flesh(rgb), "options": options})
    for name, build, size, mass, rgb, options in _SLICEABLE
]  # fmt: skip
