"""Jars, tins, cups, tubs and pouches with something in them."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import ball, box, cylinder, decal, hull, lathe, sleeve, soft_box, tube
from ..shapes.vessels import turned_vessel
from .bottles import band
from .entry import Entry
from .model import ObjectBuilder
from .packages import printed


def jar(b: ObjectBuilder, *, fills: tuple = ("red", "tan", "orange", "lime"), hinged: bool = True) -> None:
    """A hollow glass jar: 6 walls, a floor, and a lid hinged at its rear rim."""
    x, _, z = b.size
    r = x / 2
    glass = materials.glass("glass", 0.35)
    top = 0.86 * z
    b.add(turned_vessel([(0.95 * r, 0), (r, 0.06 * z), (r, 0.9 * top), (0.92 * r, top)], 0.004, 6, floor=0.006), glass)
    lid = b.hinge("lid", (-r, 0, top), (0, -1, 0), 2.0, hinged)
    look = b.pick(
        (
            materials.metal("gold"),
            materials.plain("red", "metal"),
            materials.wood("pine", b.rng),
            materials.metal("silver"),
        )
    )
    lid.add(cylinder(0.97 * r, z - top - 0.004).at(z=top + 0.002), look)


def filled_jar(
    b: ObjectBuilder, *, fills: tuple = ("red",), lids: tuple = ("gold", "red", "white"), label: bool = True
) -> None:
    """A full, closed jar (jam, sauce, sugar): solid."""
    x, _, z = b.size
    r = x / 2
    fill = b.pick(fills)
    top = 0.84 * z
    b.add(
        lathe([(0.92 * r, 0), (r, 0.05 * z), (r, 0.88 * top), (0.84 * r, top)]),
        materials.plain(materials.tint(fill, b.rng), "glass", 0.8),
    )
    b.add(lathe([(0.92 * r, top), (0.92 * r, z)]), materials.plain(b.pick(lids), "metal", 0.6))
    if label:
        b.add(*band(r, 0.25 * z, 0.6 * z, materials.plain("cream", "paper")))
        b.add(*band(r * 1.003, 0.38 * z, 0.46 * z, materials.plain(b.pick(lids), "paper")))


def shaker(b: ObjectBuilder, *, looks: tuple = (("white", "silver"),)) -> None:
    """A salt shaker or spice pot: body and domed cap with holes to be seen."""
    x, _, z = b.size
    r = x / 2
    look, top = b.pick(looks)
    b.add(lathe([(0.95 * r, 0), (r, 0.1 * z), (0.75 * r, 0.7 * z)], 14), materials.plain(look, "ceramic", 0.6))
    b.add(lathe([(0.78 * r, 0.7 * z), (0.74 * r, 0.88 * z), (0.3 * r, z)], 14), materials.metal(top))
    for k in range(5):
        a = 2 * math.pi * k / 5
        b.add(
            cylinder(0.05 * r, 0.02 * z, 6).visual_only().at(0.25 * r * math.cos(a), 0.25 * r * math.sin(a), 0.985 * z),
            materials.plain("black"),
        )


def mill(b: ObjectBuilder) -> None:
    """A turned pepper mill."""
    x, _, z = b.size
    r = x / 2
    wood = materials.wood(b.pick(("walnut", "cherry", "oak")), b.rng)
    b.add(lathe([(r, 0), (r, 0.12 * z), (0.6 * r, 0.3 * z), (0.75 * r, 0.6 * z), (0.9 * r, 0.7 * z)], 16), wood)
    b.add(lathe([(0.9 * r, 0.71 * z), (0.95 * r, 0.82 * z), (0.5 * r, 0.93 * z)], 16), wood)
    b.add(ball(0.5 * r, 0.5 * r, 0.07 * z, 10).visual_only().at(z=0.93 * z), materials.metal("gold"))


def drink(b: ObjectBuilder) -> None:
    """A martini glass, filled."""
    x, _, z = b.size
    r = x / 2
    glass = materials.glass("glass", 0.4)
    b.add(
        lathe(
            [(0.62 * r, 0), (0.6 * r, 0.004), (0.07 * r, 0.03 * z), (0.06 * r, 0.55 * z), (0.1 * r, 0.57 * z)],
            split=[0.03 * z],
        ),
        glass,
    )
    b.add(lathe([(0.05 * r, 0.56 * z), (r, z)], split=[]), glass)
    b.add(
        lathe([(0.05 * r, 0.575 * z), (0.86 * r, 0.94 * z)]).visual_only(),
        materials.glass(b.pick(("lime", "pink", "gold")), 0.7),
    )
    b.add(ball(0.2 * r, 0.2 * r, 0.2 * r, 8).visual_only().at(0.3 * r, 0, 0.9 * z), materials.plain("leaf", "organic"))


def paper_cup(b: ObjectBuilder) -> None:
    """A take-away coffee cup with lid and sleeve."""
    x, _, z = b.size
    r = x / 2
    b.add(lathe([(0.68 * r, 0), (0.95 * r, 0.92 * z)]), materials.plain("white", "paper"))
    b.add(
        sleeve([(0.78 * r, 0.25 * z), (0.9 * r, 0.65 * z)]).scaled(1.02, 1.02),
        materials.plain(b.pick(("cardboard", "dark_green", "red")), "paper"),
    )
    b.add(lathe([(r, 0.92 * z), (r, 0.95 * z), (0.85 * r, z)]), materials.plain("white"))


def pouch(b: ObjectBuilder, *, looks: tuple = (("brown", "gold"), ("dark_green", "cream"), ("black", "red"))) -> None:
    """A standing bag with a folded top (coffee, flour)."""
    x, y, z = b.size
    look, accent = b.pick(looks)
    points = [(sx * x / 2, sy * y / 2, h) for sx in (-1, 1) for sy in (-1, 1) for h in (0, 0.62 * z)]
    points += [(sx * 0.08 * x, sy * y / 2, 0.88 * z) for sx in (-1, 1) for sy in (-1, 1)]
    foil = materials.plain(look, "paper", 0.3)
    b.add(hull(points), foil)
    b.add(soft_box(0.2 * x, y, 0.12 * z).at(z=0.88 * z), foil)
    for side, s in (("x", 1), ("-x", -1)):
        b.add(decal(0.8 * y, 0.52 * z, side).at(s * (x / 2 + 0.0005), 0, 0.32 * z), printed(b, accent, look))


def cup_tub(b: ObjectBuilder, *, looks: tuple = (("white", "pink"), ("white", "blue"), ("cream", "orange"))) -> None:
    """A plastic pot with a foil lid (yogurt, cream)."""
    x, _, z = b.size
    r = x / 2
    look, accent = b.pick(looks)
    b.add(lathe([(0.78 * r, 0), (0.95 * r, 0.92 * z), (r, 0.93 * z), (r, z)]), materials.plain(look))
    b.add(cylinder(r * 0.99, 0.001).visual_only().at(z=z), materials.metal("silver"))
    b.add(sleeve([(0.82 * r, 0.2 * z), (0.92 * r, 0.72 * z)]).scaled(1.02, 1.02), materials.plain(accent, "paper"))


def paint_tin(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(lathe([(r, 0), (r, 0.94 * z), (0.96 * r, z)]), materials.metal("silver", b.rng))
    b.add(*band(r, 0.15 * z, 0.8 * z, materials.plain(b.pick(("blue", "yellow", "green", "white")), "paper")))
    arch = [
        (1.015 * r * math.sin(a), r * math.cos(a), 0.78 * z - 0.32 * z * math.sin(a))
        for a in (k * math.pi / 8 for k in range(9))
    ]
    b.add(tube(arch, 0.0025, 5, hulls=0), materials.metal("steel"))


def pills(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(lathe([(0.9 * r, 0), (0.9 * r, 0.76 * z)]), materials.glass(b.pick(("orange", "white", "sky")), 0.85))
    b.add(lathe([(r, 0.76 * z), (r, z)]), materials.plain("white"))
    b.add(*band(0.9 * r, 0.12 * z, 0.62 * z, materials.plain("paper", "paper")))


FOUR_PACK = 3
"""Number of the first pack of four small cans, which goes into a bucket; only the object library has such."""

FOUR_PACK_SIZE = (0.096, 0.096, 0.092)
"""m."""


def case_of_cans(b: ObjectBuilder) -> None:
    """A cardboard tray with a block of cans under film: twelve, from number `FOUR_PACK` on four."""
    columns, rows = 3, 4
    if b.index >= FOUR_PACK:
        b.size, b.mass, columns, rows = FOUR_PACK_SIZE, 0.65, 2, 2
    x, y, z = b.size
    b.add(box(x, y, 0.35 * z), materials.plain("cardboard", "cardboard"))
    red = materials.plain(b.pick(("red", "blue", "green")), "metal", 0.6)
    for i in range(columns):
        for j in range(rows):
            px, py = (i - (columns - 1) / 2) * x / columns, (j - (rows - 1) / 2) * y / rows
            r = min(x / (2.1 * columns), y / (2.1 * rows))
            b.add(lathe([(r, 0.3 * z), (r, 0.94 * z), (0.8 * r, z)], 12).visual_only().at(px, py), red)
            b.add(cylinder(0.78 * r, 0.001, 12).visual_only().at(px, py, z), materials.metal("silver"))
    b.add(box(0.96 * x, 0.96 * y, 0.65 * z).collision_only().at(z=0.35 * z), red)


def can(
    b: ObjectBuilder, *, looks: tuple = (("red", "white"), ("blue", "silver"), ("green", "lime"), ("orange", "cream"))
) -> None:
    """A drink can."""
    x, _, z = b.size
    r = x / 2
    look, accent = b.pick(looks)
    silver = materials.metal("silver")
    profile = [(0.78 * r, 0), (r, 0.08 * z), (r, 0.88 * z), (0.8 * r, 0.97 * z), (0.82 * r, z)]
    b.add(lathe(profile), materials.plain(look, "metal", 0.7))
    b.add(*band(r * 0.996, 0.35 * z, 0.62 * z, materials.plain(accent, "metal", 0.7)))
    b.add(cylinder(0.8 * r, 0.001).visual_only().at(z=z), silver)
    b.add(soft_box(0.5 * r, 0.3 * r, 0.002).visual_only().at(0.15 * r, 0, z + 0.001), silver)


CATEGORIES = [
    Entry("pop", can, (0.066, 0.066, 0.122), 0.37, 4, rest="standing"),
    Entry("pop_case", case_of_cans, (0.200, 0.268, 0.125), 4.5, FOUR_PACK, extra=1, vary=0.03, rest="standing"),
    Entry("jar", jar, (0.095, 0.095, 0.150), 0.42, 6, rest="upright"),
    Entry("jam", filled_jar, (0.072, 0.072, 0.092), 0.45, 3, rest="standing",
          options={"fills": ("dark_red", "orange", "purple")}),
    Entry("spaghetti_sauce", filled_jar, (0.088, 0.088, 0.165), 0.90, 3,
          rest="standing", options={"fills": ((0.68, 0.16, 0.08), (0.75, 0.30, 0.16))}),
    Entry("sugar_jar", filled_jar, (0.100, 0.100, 0.130), 0.85, 3,
          rest="standing", options={"fills": ("white",), "lids": ("silver", "pine", "sky")}),
    Entry("powder_bottle", filled_jar, (0.060, 0.060, 0.150), 0.25, 2,
          rest="standing", options={"fills": ("white",), "lids": ("sky", "pink")}),
    Entry("protein_powder", filled_jar, (0.150, 0.150, 0.210), 1.20, 2,
          rest="standing", options={"fills": ("black", "navy"), "lids": ("red", "black")}),
    Entry("salt", shaker, (0.045, 0.045, 0.090), 0.15, 3,
          rest="standing", options={"looks": (("white", "silver"), ("sky", "silver"), ("glass", "chrome"))}),
    Entry("pepper_grinder", mill, (0.055, 0.055, 0.190), 0.25, 3, rest="standing"),
    Entry("martini", drink, (0.105, 0.105, 0.160), 0.30, 2, rest="upright", uniform=True),
    Entry("coffee_cup", paper_cup, (0.088, 0.088, 0.115), 0.30, 3, uniform=True, rest="standing"),
    Entry("coffee_pouch", pouch, (0.065, 0.095, 0.190), 0.27, 3, rest="standing"),
    Entry("flour", pouch, (0.075, 0.115, 0.180), 1.00, 3, rest="standing",
          options={"looks": (("paper", "blue"), ("paper", "red"))}),
    Entry("yogurt", cup_tub, (0.072, 0.072, 0.082), 0.17, 4, uniform=True, rest="standing"),
    Entry("cream", cup_tub, (0.078, 0.078, 0.100), 0.26, 3, uniform=True,
          rest="standing", options={"looks": (("white", "sky"), ("cream", "red"))}),
    Entry("paint", paint_tin, (0.165, 0.165, 0.190), 4.0, 3, uniform=True, rest="standing"),
    Entry("medicine", pills, (0.042, 0.042, 0.085), 0.06, 3, uniform=True),
]  # fmt: skip
