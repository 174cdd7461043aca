"""Bottles, flasks, jars, tubes, cups with something in them."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import Solid, ball, block, cylinder, decal, hull, lathe, rod, sleeve, soft_box, tube
from ..shapes.materials import Material
from ..shapes.vessels import disc, ring, turned_vessel
from .entry import Entry
from .model import ObjectBuilder
from .packages import printed
from .parts import ear


def body_material(look: str | tuple, clear: bool) -> Material:
    return materials.glass(look, 0.55) if clear else materials.plain(look, "plastic", 0.5)


def band(r: float, low: float, high: float, material: Material) -> tuple[Solid, Material]:
    """A label around a round bottle."""
    return sleeve([(r * 1.01, low), (r * 1.01, high)]), material


def bottle(
    b: ObjectBuilder,
    *,
    looks: tuple = (("green", "cream"),),
    neck: float = 0.28,
    shoulder: float = 0.62,
    clear: bool = False,
    cap: str | None = None,
) -> None:
    """A round bottle. looks: (body, label) colours; neck: radius relative to the body; shoulder: where it begins."""
    x, _, z = b.size
    r = x / 2
    look, label = b.pick(looks)
    body = body_material(look, clear)
    n = neck * r
    high = (shoulder + 0.5 * (1 - shoulder)) * z
    profile = [
        (0.92 * r, 0),
        (r, 0.03 * z),
        (r, shoulder * z),
        (0.8 * r, shoulder * z + 0.35 * (high - shoulder * z)),
        (n * 1.1, high),
        (n, z),
    ]
    b.add(lathe(profile, split=[high]), body)
    b.add(*band(r, 0.18 * z, (shoulder - 0.08) * z, materials.plain(label, "paper")))
    b.add(*band(r * 1.002, 0.3 * z, 0.36 * z, materials.plain(look, "paper")))
    top = cap or b.rng.choice(("gold", "black", "red", "white"))
    b.add(cylinder(n * 1.15, 0.09 * z, 12).visual_only().at(z=0.912 * z), materials.plain(top))


def squeeze(b: ObjectBuilder, *, looks: tuple = (("red", "white"),), pump: bool = False) -> None:
    """A flattened plastic bottle (shampoo, ketchup, lotion), with a cap or a pump."""
    x, y, z = b.size
    look, label = b.pick(looks)
    top = (0.74 if pump else 0.86) * z
    body = lathe([(0.44, 0), (0.5, 0.04), (0.5, 0.7), (0.42, 0.92), (0.22, 1.0)], 20).scaled(x, y, top)
    b.add(body, materials.plain(look, "plastic", 0.5))
    b.add(decal(0.62 * y, 0.55 * top).at(x / 2 * 1.004, 0, 0.42 * top), printed(b, label, look))
    lid = materials.plain(label if label != look else "white")
    if pump:
        b.add(lathe([(0.2 * y, top), (0.2 * y, top + 0.06 * z)], 12), lid)
        b.add(lathe([(0.06 * y, top), (0.06 * y, z - 0.03 * z)], 8).visual_only(), lid)
        b.add(soft_box(0.55 * x + 0.02, 0.24 * y, 0.035 * z).at(0.2 * x, 0, z - 0.035 * z), lid)
    else:
        b.add(lathe([(0.26 * min(x, y), top - 0.005), (0.22 * min(x, y), z)], 14), lid)


def jug_bottle(b: ObjectBuilder, *, looks: tuple = (("orange", "blue"),)) -> None:
    """A detergent bottle with a grip at the side and a big cap."""
    x, y, z = b.size
    look, label = b.pick(looks)
    plastic = materials.plain(look, "plastic", 0.5)
    body = 0.7 * z
    b.add(soft_box(x, y, body, 0.16 * x), plastic)
    b.add(
        hull(
            [(sx * 0.45 * x, sy * 0.46 * y, body * 0.96) for sx in (-1, 1) for sy in (-1, 1)]
            + [(sx * 0.22 * x, 0.1 * y + sy * 0.18 * y, 0.86 * z) for sx in (-1, 1) for sy in (-1, 1)]
        ),
        plastic,
    )
    b.add(
        tube(
            [(0, -0.4 * y, 0.66 * z), (0, -0.42 * y, 0.8 * z), (0, -0.2 * y, 0.86 * z), (0, 0.02 * y, 0.84 * z)],
            0.12 * x,
            8,
            hulls=0,
        ),
        plastic,
    )
    b.add(lathe([(0.24 * x, 0.86 * z), (0.2 * x, z)], 14).at(0, 0.1 * y), materials.plain(label))
    b.add(decal(0.8 * y, 0.7 * body).at(x / 2 + 0.0005, 0, 0.45 * body), printed(b, label, look))


def tube_bottle(b: ObjectBuilder, *, looks: tuple = (("white", "blue"), ("red", "white"), ("mint", "green"))) -> None:
    """A squeeze tube lying on its back: flat end, round shoulder, cap."""
    x, y, z = b.size
    look, accent = b.pick(looks)
    cap = 0.15 * x
    skin = materials.plain(look, "plastic", 0.5)
    flat = [(-x / 2, s * y / 2, h) for s in (-1, 1) for h in (0.44 * z, 0.56 * z)]
    r = z / 2
    round_ = [(x / 2 - cap, r * 1.3 * math.cos(a), r + r * math.sin(a)) for a in (k * math.pi / 4 for k in range(8))]
    b.add(hull(flat + round_), skin)
    b.add(cylinder(0.7 * r, cap, 12).turned("y", 90).at(x / 2 - cap, 0, r), materials.plain(accent))
    b.add(
        hull(
            [
                (-0.3 * x + 0.05 * x * k, s * y * 0.46, 0.5 * z + h * (0.10 + 0.14 * k) * z * 0.85)
                for k in range(4)
                for s in (-0.6, 0.6)
                for h in (0, 1.12)
            ]
        ).visual_only(),
        materials.plain(accent),
    )


def perfume(b: ObjectBuilder) -> None:
    """A cut glass flask with a stopper."""
    x, y, z = b.size
    look = materials.glass(b.pick(("pink", "gold", "sky", "purple")), 0.6)
    body = 0.68 * z
    if b.pick((True, False)):
        b.add(soft_box(x, y, body, 0.12 * min(x, y), 1), look)
    else:
        b.add(lathe([(0.3, 0), (0.5, 0.35), (0.42, 0.8), (0.15, 1)], 14).scaled(x, y, body), look)
    gold = materials.metal(b.pick(("gold", "silver", "black")))
    b.add(cylinder(0.13 * y, 0.1 * z, 12).at(z=body), gold)
    b.add(soft_box(0.34 * min(x, y), 0.34 * min(x, y), 0.22 * z).at(z=body + 0.1 * z), gold)


def atomizer(b: ObjectBuilder) -> None:
    """A spray bottle with a trigger head."""
    x, y, z = b.size
    look = materials.plain(b.pick(("sky", "white", "pink", "mint")), "plastic", 0.5)
    body = 0.62 * z
    b.add(lathe([(0.48, 0), (0.5, 0.05), (0.5, 0.6), (0.2, 1.0)], 16).scaled(0.7 * x, y, body).at(-0.1 * x), look)
    head = materials.plain(b.pick(("red", "blue", "white")))
    b.add(cylinder(0.16 * y, 0.16 * z, 12).at(-0.1 * x, 0, body), head)
    b.add(
        hull(
            [
                (px * x, s * 0.18 * y, pz * z)
                for px, pz in ((-0.3, 0.84), (-0.3, 1.0), (0.3, 0.88), (0.3, 1.0))
                for s in (-1, 1)
            ]
        ),
        head,
    )
    b.add(block((0.2 * x, 0.14 * y, 0.05 * z), (0.4 * x, 0, 0.95 * z)), head)
    b.add(rod((0.1 * x, 0, 0.86 * z), (0.22 * x, 0, 0.66 * z), 0.06 * y, 6).visual_only(), head)
    b.point("toggle_button", (0.16 * x, 0, 0.76 * z))


def carafe(b: ObjectBuilder) -> None:
    """A hollow glass carafe with an open neck."""
    x, _, z = b.size
    r = x / 2
    glass = materials.glass("glass", 0.35)
    profile = [
        (0.9 * r, 0),
        (r, 0.15 * z),
        (0.85 * r, 0.45 * z),
        (0.4 * r, 0.72 * z),
        (0.42 * r, 0.85 * z),
        (0.6 * r, z),
    ]
    glass_wall = turned_vessel(profile, 0.004, 6).visual_only()
    b.add(glass_wall + disc(0.95 * r, 0, 0.006) + ring(1.0 * r, 0.5 * r, 0, z, 0.006, 7), glass)


def cruet(b: ObjectBuilder) -> None:
    """A small oil bottle with a spout, a stopper and an ear."""
    x, y, z = b.size
    r = y / 2
    look = materials.glass(b.pick(("gold", "lime", "glass")), 0.6)
    b.add(
        lathe(
            [(0.85 * r, 0), (r, 0.2 * z), (0.7 * r, 0.5 * z), (0.3 * r, 0.7 * z), (0.35 * r, 0.86 * z)], split=[0.5 * z]
        ).at(-0.1 * x),
        look,
    )
    b.add(ear(0.18 * z, 0.004).at(0.2 * x, 0, 0.5 * z), look)
    b.add(ball(0.6 * r, 0.6 * r, 0.14 * z, 10).at(-0.1 * x, 0, 0.86 * z), materials.plain("tan", "wood"))


def pitcher(b: ObjectBuilder) -> None:
    """A small open jug with a lip and an ear."""
    x, y, z = b.size
    r = y / 2
    look = materials.plain(b.pick(("porcelain", "sky", "cream")), "ceramic", 0.7)
    b.add(
        turned_vessel([(0.75 * r, 0), (r, 0.35 * z), (0.8 * r, 0.75 * z), (0.95 * r, z)], 0.004, 6).at(-0.1 * x), look
    )
    b.add(ear(0.26 * z, 0.005).at(r - 0.12 * x, 0, 0.5 * z), look)
    lip = [(-0.1 * x - 0.85 * r, s * 0.35 * r, z - h) for s in (-1, 1) for h in (0, 0.12 * z)] + [(-x / 2, 0, z)]
    b.add(hull(lip).visual_only(), look)


def bar_soap(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(soft_box(x, y, z, 0.42 * z, 3), materials.plain(b.pick(("cream", "mint", "pink", "sky")), "organic", 0.5))
    b.add(
        decal(0.5 * y, 0.4 * x, "z").at(z=z + 0.0003),
        materials.picture("stamp", textures.stripes((0.9, 0.9, 0.85), (0.8, 0.8, 0.75), 3)),
    )


def lipstick(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(cylinder(r, 0.5 * z, 12), materials.plain("black", shine=0.8))
    b.add(cylinder(0.85 * r, 0.25 * z, 12).at(z=0.5 * z), materials.metal("gold"))
    b.add(
        lathe([(0.6 * r, 0.75 * z), (0.6 * r, 0.92 * z), (0.2 * r, z)], 10),
        materials.plain(b.pick(("red", "rose", "dark_red"))),
    )


CATEGORIES = [
    Entry("wine_bottle", bottle, (0.076, 0.076, 0.300), 1.25, 4,
          rest="standing", options={"looks": (("dark_green", "cream"), ("black", "white"), ("green", "gold"))}),
    Entry("beer", bottle, (0.062, 0.062, 0.230), 0.55, 4,
          rest="standing", options={"looks": (("brown", "gold"), ("dark_green", "white")), "neck": 0.4,
                                                                  "cap": "silver"}),
    Entry("water", bottle, (0.066, 0.066, 0.220), 0.53, 3,
          rest="standing", options={"looks": (("sky", "blue"), ("glass", "white")), "neck": 0.42,
                                                                  "shoulder": 0.75, "clear": True, "cap": "blue"}),
    Entry("olive_oil", bottle, (0.072, 0.072, 0.280), 0.95, 3,
          rest="standing", options={"looks": (((0.55, 0.56, 0.16), "gold"), ("dark_green", "cream")),
                                                                      "cap": "dark_green"}),
    Entry("vinegar", bottle, (0.066, 0.066, 0.260), 0.75, 3,
          rest="standing", options={"looks": (("dark_red", "cream"), ("gold", "white")), "clear": True}),
    Entry("catsup", squeeze, (0.055, 0.085, 0.200), 0.55, 3, rest="standing",
          options={"looks": (("red", "white"), ("red", "green"))}),
    Entry("mayonnaise", squeeze, (0.060, 0.085, 0.190), 0.45, 3,
          rest="standing", options={"looks": (("cream", "blue"), ("white", "yellow"))}),
    Entry("shampoo", squeeze, (0.050, 0.080, 0.210), 0.42, 4,
          rest="standing", options={"looks": (("sky", "white"), ("green", "cream"), ("purple", "pink"))}),
    Entry("conditioner", squeeze, (0.050, 0.080, 0.200), 0.42, 2,
          rest="standing", options={"looks": (("cream", "gold"), ("pink", "white"))}),
    Entry("lotion", squeeze, (0.055, 0.075, 0.190), 0.36, 3,
          rest="standing", options={"looks": (("white", "blue"), ("pink", "white")), "pump": True}),
    Entry("sunscreen", squeeze, (0.042, 0.065, 0.165), 0.24, 2,
          rest="standing", options={"looks": (("orange", "white"), ("yellow", "blue"))}),
    Entry("detergent", jug_bottle, (0.100, 0.170, 0.270), 1.9, 4,
          rest="standing",
          options={"looks": (("orange", "blue"), ("blue", "white"), ("green", "white"), ("white", "red"))}),
    Entry("toothpaste", tube_bottle, (0.175, 0.055, 0.036), 0.13, 3),
    Entry("perfume", perfume, (0.034, 0.056, 0.100), 0.20, 3, rest="standing"),
    Entry("cologne", perfume, (0.036, 0.060, 0.110), 0.22, 3, rest="standing"),
    Entry("atomizer", atomizer, (0.105, 0.080, 0.240), 0.45, 3, rest="standing"),
    Entry("carafe", carafe, (0.110, 0.110, 0.240), 0.60, 3, rest="upright", uniform=True),
    Entry("cruet", cruet, (0.085, 0.065, 0.150), 0.30, 3, rest="standing"),
    Entry("cream_pitcher", pitcher, (0.110, 0.075, 0.085), 0.22, 3, rest="upright", uniform=True),
    Entry("soap", bar_soap, (0.090, 0.058, 0.028), 0.10, 4),
    Entry("lipstick", lipstick, (0.020, 0.020, 0.080), 0.020, 3, uniform=True, rest="standing"),
]  # fmt: skip
