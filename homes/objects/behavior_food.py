"""Food that BEHAVIOR-1K names and iGibson does not have (`ig2mj.knowledge.further`)."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import ball, block, box, frustum, hull, prism, rod, soft_box
from ..shapes.turned import lathe
from .entry import Entry
from .fruit import round_fruit
from .meat_fish import drumstick, slab
from .model import ObjectBuilder
from .vegetables import bent, bunch, nut


def organic(b: ObjectBuilder, colours: tuple) -> materials.Material:
    """A flat colour near one of some."""
    return materials.plain(materials.tint(b.pick(colours), b.rng), "organic")


def flat_round(b: ObjectBuilder, *, colours: tuple, bulge: float = 0.0) -> None:
    """A disc: a tortilla, pizza dough; `bulge`: share of the height that its middle rises."""
    x, _, z = b.size
    r = x / 2
    b.add(lathe([(0.94 * r, 0), (r, 0.5 * z * (1 - bulge)), (0.9 * r, z * (1 - bulge)), (0.0, z)]), organic(b, colours))


def squash(b: ObjectBuilder, *, colours: tuple) -> None:
    """A butternut squash or gourd lying along x: a neck and a belly."""
    x, _, z = b.size
    r = z / 2
    profile = [
        (0.4 * r, 0), (0.9 * r, 0.1 * x), (r, 0.28 * x), (0.75 * r, 0.48 * x), (0.5 * r, 0.64 * x),
        (0.55 * r, 0.85 * x), (0.3 * r, 0.97 * x), (0.12 * r, x),
    ]  # fmt: skip
    body = lathe(profile, 14, split=[0.5 * x]).at(z=-x / 2).turned("y", 90).at(z=r)
    b.add(body, organic(b, colours))


def block_of(b: ObjectBuilder, *, colours: tuple, tops: tuple = (), lines: int = 0) -> None:
    """A soft block: tofu, a bar of chocolate, a piece of cake; `tops`: colours of a layer on it, `lines`: grooves."""
    x, y, z = b.size
    low = z if not tops else 0.8 * z
    b.add(soft_box(x, y, low, 0.12 * z), organic(b, colours))
    if tops:
        b.add(box(0.98 * x, 0.98 * y, z - low).at(z=low).visual_only(), organic(b, tops))
        b.add(box(x, y, z).collision_only(), organic(b, tops))
    dark = materials.plain((0.20, 0.11, 0.07), "organic")
    for k in range(1, lines):
        b.add(block((0.004, 0.96 * y, 0.002), ((k / lines - 0.5) * x, 0, z)).visual_only(), dark)


def avocado(b: ObjectBuilder) -> None:
    """A dark pear with a rough skin."""
    x, _, z = b.size
    r = x / 2
    profile = [
        (0.4 * r, 0),
        (0.88 * r, 0.12 * z),
        (r, 0.32 * z),
        (0.84 * r, 0.56 * z),
        (0.52 * r, 0.8 * z),
        (0.2 * r, z),
    ]
    b.add(lathe(profile, 10, split=[0.55 * z]), organic(b, ((0.16, 0.22, 0.12), (0.30, 0.40, 0.16))))


def dumpling(b: ObjectBuilder) -> None:
    """A half moon with a folded seam."""
    x, y, z = b.size
    dough = organic(b, ((0.94, 0.89, 0.78), (0.90, 0.80, 0.62)))
    arc = [(0.5 * x * math.cos(a), y * (math.sin(a) - 0.5)) for a in (k * math.pi / 8 for k in range(9))]
    b.add(prism(arc, 0.7 * z), dough)
    for k in range(1, 8):
        a = k * math.pi / 8
        at = (0.46 * x * math.cos(a), 0.92 * y * math.sin(a) - 0.5 * y, 0.55 * z)
        b.add(ball(0.16 * x, 0.16 * x, 0.45 * z, 6).visual_only().at(*at), dough)


def crisp(b: ObjectBuilder) -> None:
    """A three-cornered crisp."""
    x, y, z = b.size
    b.add(prism([(-x / 2, -y / 2), (x / 2, 0), (-x / 2, y / 2)], z), organic(b, ((0.90, 0.72, 0.34), "tan")))


def ham(b: ObjectBuilder) -> None:
    """A hock: a thick cut of a leg with the bone in it."""
    x, _, z = b.size
    r = z / 2
    meat = organic(b, ((0.72, 0.36, 0.30), (0.62, 0.32, 0.22)))
    b.add(lathe([(0.7 * r, 0), (r, 0.2 * x), (0.9 * r, 0.7 * x), (0.6 * r, 0.92 * x)], 14)
          .at(z=-x / 2).turned("y", 90).at(z=r), meat)  # fmt: skip
    b.add(rod((0.3 * x, 0, r), (x / 2, 0, r), 0.22 * r, 8), materials.plain("cream", "organic"))


def wing(b: ObjectBuilder) -> None:
    """A chicken wing: two joints at an angle."""
    x, y, z = b.size
    meat = organic(b, ((0.80, 0.55, 0.34), (0.90, 0.72, 0.58)))
    b.add(rod((-0.38 * x, -0.3 * y, z / 2), (0.05 * x, 0.25 * y, z / 2), z / 2, 10), meat)
    b.add(rod((0.05 * x, 0.25 * y, z / 2), (0.42 * x, -0.2 * y, z / 2), 0.4 * z, 10), meat)


def scoop(b: ObjectBuilder) -> None:
    """A ball of ice cream with a skirt, flat below."""
    x, _, z = b.size
    r = x / 2
    profile = [(0.7 * r, 0), (r, 0.08 * z), (0.86 * r, 0.22 * z), (0.9 * r, 0.5 * z), (0.6 * r, 0.86 * z), (0.0, z)]
    b.add(lathe(profile, 16), organic(b, ("pink", "cream", (0.42, 0.26, 0.18), "mint")))


def roll(b: ObjectBuilder) -> None:
    """A croissant-like pastry: five bulges along a bow."""
    x, y, z = b.size
    crust = organic(b, ((0.78, 0.54, 0.26), (0.70, 0.44, 0.20)))
    for k, thick in enumerate((0.45, 0.8, 1.0, 0.8, 0.45)):
        u = k / 4 - 0.5
        b.add(ball(0.3 * x, 0.62 * y * thick, z * thick, 8).at(0.72 * x * u, 0.5 * y * (0.5 - 2 * u * u)), crust)


def leek(b: ObjectBuilder) -> None:
    """A white shaft that turns green, with leaves."""
    x, y, z = b.size
    r = z / 2
    b.add(rod((-x / 2, 0, r), (0.05 * x, 0, r), 0.9 * r, 10), materials.plain("white", "organic"))
    green = organic(b, ((0.36, 0.56, 0.26), (0.26, 0.46, 0.22)))
    b.add(frustum((0.004, 0.9 * z), (0.004, z), 0.001).visual_only(), green)
    for side in (-1, 0, 1):
        tip = (x / 2, 0.4 * y * side, r * (1 + 0.3 * (side == 0)))
        b.add(rod((0.03 * x, 0, r), tip, 0.55 * r, 6).visual_only(), green)
    b.add(block((0.47 * x, 0.9 * y, 0.9 * z), (0.265 * x, 0, r)).collision_only(), green)


def boiled_egg(b: ObjectBuilder) -> None:
    """An egg, peeled or in its shell, lying along x."""
    x, _, z = b.size
    r = z / 2
    profile = [
        (0.2 * r, 0),
        (0.8 * r, 0.14 * x),
        (r, 0.42 * x),
        (0.82 * r, 0.72 * x),
        (0.4 * r, 0.94 * x),
        (0.1 * r, x),
    ]
    b.add(lathe(profile, 16).at(z=-x / 2).turned("y", 90).at(z=r), organic(b, ("white", (0.86, 0.70, 0.55))))


def bivalve(b: ObjectBuilder, *, colours: tuple) -> None:
    """Two shells, closed, lying flat: a clam, a mussel, an oyster, a scallop."""
    x, y, z = b.size
    shell = organic(b, colours)
    turns = [k * math.pi / 5 for k in range(10)]
    fan = [(0.5 * x * math.cos(a) + 0.1 * x * (math.cos(a) < 0), 0.5 * y * math.sin(a)) for a in turns]
    b.add(hull([*((u, v, 0.5 * z) for u, v in fan), *((0.5 * u, 0.5 * v, h) for u, v in fan for h in (0, z))]), shell)
    dark = materials.plain((0.22, 0.19, 0.17), "organic")
    b.add(prism([(1.01 * u, 1.01 * v) for u, v in fan], 0.05 * z).visual_only().at(z=0.475 * z), dark)


def prawn(b: ObjectBuilder) -> None:
    """A bent body with a tail, lying on its side."""
    bent(b, skins=((0.92, 0.62, 0.50), (0.80, 0.72, 0.66)), curve=70.0, tip=None, taper=0.3)


def _flesh(rgb: tuple[float, float, float]):
    return lambda rng: materials.plain(materials.tint(rgb, rng), "organic")


GREEN = (0.36, 0.58, 0.22)
CATEGORIES = [
    Entry("asparagus", bunch, (0.210, 0.045, 0.030), 0.12, 2, options={"stem": (0.44, 0.62, 0.30), "leafy": 0.12,
          "leaf": (0.34, 0.46, 0.26)}),
    Entry("green_bean", bent, (0.120, 0.026, 0.011), 0.007, 2, options={"skins": (GREEN, "lime"), "curve": 18.0}),
    Entry("pea_pod", bent, (0.090, 0.026, 0.015), 0.007, 2, options={"skins": (GREEN, "leaf"), "curve": 16.0,
          "taper": 0.3}),
    Entry("leek", leek, (0.380, 0.060, 0.036), 0.20, 2),
    Entry("hard-boiled_egg", boiled_egg, (0.058, 0.044, 0.044), 0.055, 2, uniform=True,
          flesh=_flesh((0.96, 0.78, 0.26))),
    Entry("clam", bivalve, (0.046, 0.052, 0.024), 0.03, 2,
          options={"colours": ((0.84, 0.78, 0.68), (0.70, 0.60, 0.50))}),
    Entry("mussel", bivalve, (0.070, 0.036, 0.024), 0.02, 2, options={"colours": ((0.16, 0.18, 0.26), "black")}),
    Entry("oyster", bivalve, (0.090, 0.065, 0.028), 0.08, 2, options={"colours": ((0.56, 0.53, 0.48), "grey")}),
    Entry("scallop", bivalve, (0.080, 0.086, 0.026), 0.06, 2, options={"colours": ((0.92, 0.74, 0.62), "cream")}),
    Entry("prawn", prawn, (0.080, 0.040, 0.018), 0.02, 2),
    Entry("tortilla", flat_round, (0.200, 0.200, 0.006), 0.05, 2, uniform=True, options={"colours": ((0.93, 0.86, 0.68),
          (0.88, 0.76, 0.50))}),
    Entry("pizza_dough", flat_round, (0.240, 0.240, 0.024), 0.30, 2, uniform=True, options={"colours": ((0.93, 0.88,
          0.76), (0.90, 0.84, 0.70)), "bulge": 0.25}),
    Entry("tortilla_chip", crisp, (0.062, 0.058, 0.005), 0.003, 2),
    Entry("dumpling", dumpling, (0.075, 0.036, 0.028), 0.025, 2, rest="standing"),
    Entry("chocolate_bar", block_of, (0.150, 0.070, 0.012), 0.10, 2, options={"colours": ((0.30, 0.17, 0.10), (0.42,
          0.26, 0.16)), "lines": 6}),
    Entry("tofu", block_of, (0.110, 0.080, 0.042), 0.35, 2, options={"colours": ((0.95, 0.93, 0.86), (0.90, 0.84,
          0.70))}),
    Entry("tiramisu", block_of, (0.100, 0.080, 0.060), 0.18, 2, rest="standing", options={"colours": ((0.93, 0.87,
          0.72), "cream"), "tops": ((0.34, 0.21, 0.13),)}),
    Entry("pastry", roll, (0.140, 0.080, 0.048), 0.07, 2, rest="standing"),
    Entry("scoop_of_ice_cream", scoop, (0.062, 0.062, 0.054), 0.07, 2, rest="standing", uniform=True),
    Entry("ham_hock", ham, (0.190, 0.110, 0.110), 0.90, 2),
    Entry("avocado", avocado, (0.070, 0.070, 0.105), 0.20, 2, rest="standing", uniform=True, flesh=_flesh((0.80, 0.84,
          0.46))),
    Entry("mango", round_fruit, (0.082, 0.105, 0.078), 0.30, 2, rest="standing", uniform=True, flesh=_flesh((0.96,
          0.72, 0.26)), options={"skins": ((0.88, 0.52, 0.20), (0.62, 0.64, 0.24)), "stem": None}),
    Entry("yam", nut, (0.170, 0.075, 0.066), 0.35, 2, uniform=True, flesh=_flesh((0.90, 0.58, 0.30)),
          options={"colour": (0.62, 0.36, 0.26)}),
    Entry("butternut_squash", squash, (0.260, 0.115, 0.115), 1.20, 2, uniform=True, flesh=_flesh((0.95, 0.66, 0.28)),
          options={"colours": ((0.88, 0.70, 0.42), (0.84, 0.64, 0.38))}),
    Entry("gourd", squash, (0.220, 0.130, 0.130), 0.90, 2, uniform=True, flesh=_flesh((0.92, 0.84, 0.62)),
          options={"colours": ((0.42, 0.52, 0.24), (0.86, 0.62, 0.22))}),
    Entry("porkchop", slab, (0.180, 0.110, 0.026), 0.24, 2, flesh=_flesh((0.86, 0.58, 0.52)),
          options={"colours": ((0.88, 0.60, 0.54),), "bone": False, "fat": False}),
    Entry("chicken_breast", slab, (0.170, 0.095, 0.034), 0.22, 2, flesh=_flesh((0.94, 0.84, 0.78)),
          options={"colours": ((0.93, 0.78, 0.70),), "fat": False}),
    Entry("chicken_leg", drumstick, (0.150, 0.062, 0.062), 0.16, 2, uniform=True, flesh=_flesh((0.88, 0.70, 0.58))),
    Entry("chicken_wing", wing, (0.130, 0.075, 0.034), 0.08, 2, flesh=_flesh((0.88, 0.70, 0.58))),
]  # fmt: skip
