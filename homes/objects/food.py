"""Bread, cakes, sweets, meat, fish, and dishes served in something."""

from __future__ import annotations

import math

import numpy as np
from scipy.interpolate import CubicSpline

from ..shapes import materials
from ..shapes.bricks import Solid, ball, block, box, cylinder, decal, hull, lathe, prism, rod, soft_box, tube
from ..shapes.vessels import tray, turned_vessel
from .entry import Entry
from .model import ObjectBuilder
from .packages import printed

CRUST = (0.78, 0.54, 0.28)


def torus(radius: float, thick: float, height: float, pieces: int = 6) -> Solid:
    """A ring lying on z = 0 (mean radius, tube diameter, height), collides as `pieces` wedges."""
    path = [(radius * math.cos(a), radius * math.sin(a), 0) for a in np.arange(18) * math.pi / 9]
    ring = tube(path, thick / 2, 8, hulls=pieces, closed=True)
    return ring.scaled(z=height / thick).at(z=height / 2)


def bagel(b: ObjectBuilder) -> None:
    x, _, z = b.size
    thick = 0.36 * x
    b.add(torus((x - thick) / 2, thick, z), materials.skin(b.pick((CRUST, (0.62, 0.38, 0.18))), b.rng, 0.15))


def pretzel(b: ObjectBuilder) -> None:
    """A looped rope of dough with salt."""
    x, y, z = b.size
    dough = materials.skin((0.58, 0.32, 0.13), b.rng, 0.15)
    knots = np.array([(-0.28, -0.46), (0.0, -0.12), (0.2, 0.14), (0.44, 0.34), (0.5, 0.0), (0.34, -0.38), (0, -0.5)])
    left = knots[-2::-1] * [-1, 1]
    flat = CubicSpline(np.arange(13), np.concatenate([knots, left]))(np.linspace(0, 12, 34))
    rope = 0.36 * z
    lift = np.where(np.arange(34) < 8, 0.22 * z, 0.0) * np.sin(np.linspace(0, math.pi * 34 / 8, 34)).clip(0)
    path = np.c_[flat[:, 1] / 0.96 * (y - 2 * rope) * x / y, flat[:, 0] * (y - 2 * rope), rope + lift]
    b.add(tube(path, rope, 7, hulls=8), dough)


def loaf(b: ObjectBuilder) -> None:
    """A baguette along x with cuts across its crust."""
    x, y, z = b.size
    crust = materials.skin(CRUST, b.rng, 0.2)
    profile = [(0.25, 0), (0.43, 0.06), (0.5, 0.2), (0.5, 0.8), (0.43, 0.94), (0.25, 1)]
    b.add(lathe(profile, 14, split=[0.35, 0.65]).at(z=-0.5).turned("y", 90).scaled(x, y, z).at(z=z / 2), crust)
    for k in range(5):
        cut = block((0.09 * x, 0.12 * y, 0.004)).visual_only().turned("z", 35)
        b.add(cut.at((k - 2) * 0.16 * x, 0, 0.985 * z), materials.plain((0.92, 0.80, 0.58), "organic"))


def muffin(b: ObjectBuilder, *, tops: tuple, icing: bool = False) -> None:
    """A fluted paper cup with a domed top."""
    x, _, z = b.size
    r = x / 2
    paper = materials.plain(b.pick(("cream", "pink", "sky")), "paper")
    b.add(lathe([(0.68 * r, 0), (0.9 * r, 0.5 * z)], 24), paper)
    top = materials.skin(b.pick(tops), b.rng, 0.2)
    if icing:
        b.add(
            lathe(
                [
                    (0.95 * r, 0.48 * z),
                    (r, 0.58 * z),
                    (0.75 * r, 0.66 * z),
                    (0.8 * r, 0.72 * z),
                    (0.45 * r, 0.82 * z),
                    (0.48 * r, 0.88 * z),
                    (0.05 * r, z),
                ],
                16,
            ),
            top,
        )
        b.add(ball(0.2 * r, 0.2 * r, 0.2 * r, 8).visual_only().at(0, 0, 0.94 * z), materials.plain("red", "organic"))
    else:
        b.add(lathe([(0.9 * r, 0.46 * z), (r, 0.58 * z), (0.85 * r, 0.82 * z), (0.4 * r, 0.97 * z), (0, z)], 16), top)


def disc_cake(b: ObjectBuilder, *, colours: tuple, dots: str | None = None) -> None:
    """A cookie: a thick disc with chips."""
    x, y, z = b.size
    b.add(
        lathe([(0.46, 0), (0.5, 0.4), (0.47, 0.8), (0.3, 1)], 18).scaled(x, y, z),
        materials.skin(b.pick(colours), b.rng, 0.2),
    )
    if dots:
        for k in range(9):
            a = 2.4 * k
            r = 0.4 * math.sqrt((k + 0.3) / 9)
            b.add(
                ball(0.1 * x, 0.1 * x, 0.3 * z, 6).visual_only().at(r * x * math.cos(a), r * y * math.sin(a), 0.8 * z),
                materials.plain(dots, "organic"),
            )


def gingerbread(b: ObjectBuilder) -> None:
    """A gingerbread man lying on his back: head, arms, legs, buttons."""
    x, y, z = b.size
    dough = materials.skin((0.60, 0.36, 0.16), b.rng, 0.12)
    white, red = materials.plain("white", "organic"), materials.plain("red", "organic")
    b.add(cylinder(0.17 * x, z, 14).at(0.5 * x - 0.17 * x), dough)
    body = [(-0.1 * x, -0.16 * y), (0.25 * x, -0.14 * y), (0.25 * x, 0.14 * y), (-0.1 * x, 0.16 * y)]
    b.add(prism(body, z), dough)
    b.add(soft_box(0.15 * x, y, z, 0.3 * z).at(0.12 * x), dough)
    for s in (-1, 1):
        b.add(soft_box(0.45 * x, 0.24 * y, z, 0.3 * z).turned("z", -s * 18).at(-0.27 * x, s * 0.19 * y), dough)
        b.add(ball(0.03 * x, 0.03 * x, 0.3 * z, 6).visual_only().at(0.37 * x, s * 0.06 * x, 0.85 * z), white)
    for k in range(3):
        b.add(ball(0.04 * x, 0.04 * x, 0.3 * z, 6).visual_only().at((0.17 - 0.1 * k) * x, 0, 0.85 * z), red)


def candy_cane(b: ObjectBuilder) -> None:
    """A striped hook lying on its side."""
    x, y, z = b.size
    r = (y - z) / 2
    straight = [(-x / 2 + z / 2 + t * (x - z / 2 - z / 2 - r), -r, z / 2) for t in np.linspace(0, 1, 7)]
    hook = [
        (x / 2 - z / 2 - r + r * math.cos(a), r * math.sin(a), z / 2)
        for a in np.linspace(-math.pi / 2, math.pi / 2, 7)[1:]
    ]
    path = straight + hook
    white, red = materials.plain("white", "organic"), materials.plain("red", "organic")
    b.add(tube(path, z / 2, 8, hulls=0), white)
    b.add(
        tube(straight, z / 2, 8, hulls=1).collision_only()
        + tube([straight[-1], *hook], z / 2, 8, hulls=3).collision_only(),
        white,
    )
    for k in range(0, len(path) - 1, 2):
        b.add(rod(path[k], (np.asarray(path[k]) * 0.5 + np.asarray(path[k + 1]) * 0.5), z * 0.515).visual_only(), red)


def lollipop(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(
        cylinder(y / 2, z, 18).at(x / 2 - y / 2),
        materials.plain(b.pick(("red", "orange", "purple", "lime")), "organic", 0.8),
    )
    b.add(rod((-x / 2, 0, z / 2), (x / 2 - y, 0, z / 2), 0.0022), materials.plain("white", "paper"))


def hamburger(b: ObjectBuilder) -> None:
    """Bun, salad, patty, cheese, bun; collides as one hull."""
    x, _, z = b.size
    r = x / 2
    bun = materials.skin((0.82, 0.56, 0.28), b.rng, 0.1)
    b.add(lathe([(0.85 * r, 0), (0.97 * r, 0.12 * z), (0.93 * r, 0.27 * z)]).visual_only(), bun)
    b.add(lathe([(r, 0.27 * z), (r, 0.46 * z)]).visual_only(), materials.skin((0.35, 0.19, 0.11), b.rng, 0.3))
    b.add(
        box(1.45 * r, 1.45 * r, 0.05 * z).visual_only().turned("z", 20).at(z=0.46 * z),
        materials.plain("yellow", "organic"),
    )
    b.add(lathe([(1.02 * r, 0.5 * z), (r, 0.56 * z)], 12).visual_only(), materials.plain("lime", "organic"))
    b.add(lathe([(0.95 * r, 0.56 * z), (0.98 * r, 0.68 * z), (0.7 * r, 0.92 * z), (0, z)]).visual_only(), bun)
    b.add(lathe([(0.9 * r, 0), (r, 0.4 * z), (0.7 * r, 0.93 * z)]).collision_only(), bun)


def sushi(b: ObjectBuilder) -> None:
    """Rice with a slice of fish on top, or a roll."""
    x, y, z = b.size
    rice = materials.skin((0.96, 0.95, 0.92), b.rng, 0.06, 0.01)
    if b.pick((True, False)):
        b.add(soft_box(0.92 * x, 0.9 * y, 0.65 * z), rice)
        b.add(soft_box(x, y, 0.4 * z, 0.15 * z).at(z=0.6 * z), materials.skin((0.95, 0.52, 0.35), b.rng, 0.15, 0.02))
    else:
        r = y / 2
        b.add(cylinder(r, z, 16), materials.plain((0.08, 0.14, 0.10), "organic"))
        b.add(cylinder(0.86 * r, 0.001, 16).visual_only().at(z=z), rice)
        b.add(cylinder(0.35 * r, 0.0015, 10).visual_only().at(z=z), materials.plain("orange", "organic"))


def cheese(b: ObjectBuilder) -> None:
    """A wedge with a rind."""
    x, y, z = b.size
    paste = materials.skin(b.pick(((0.96, 0.80, 0.36), (0.95, 0.90, 0.72), (0.93, 0.68, 0.25))), b.rng, 0.1)
    outline = [(-x / 2, 0), (0.42 * x, -y / 2), (x / 2, 0), (0.42 * x, y / 2)]
    b.add(prism(outline, z), paste)
    rind = [(0.42 * x, -y / 2), (0.43 * x, -y / 2), (x / 2 + 0.001, 0), (0.43 * x, y / 2), (0.42 * x, y / 2)]
    b.add(prism([rind[0], rind[1], rind[2], rind[3]], z * 1.002).visual_only(), materials.plain("orange", "organic"))
    for px, py in ((0.1, 0.05), (0.25, -0.12), (-0.1, 0.0)):
        b.add(
            cylinder(0.03 * x, 0.0008, 8).visual_only().at(px * x, py * y, z),
            materials.plain((0.80, 0.62, 0.25), "organic"),
        )


def egg(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = z / 2
    shell = materials.plain(
        materials.tint(b.pick(((0.95, 0.92, 0.86), (0.82, 0.62, 0.46))), b.rng, 0.04), "organic", 0.4
    )
    profile = [
        (0, 0),
        (0.5 * r, 0.06 * x),
        (0.85 * r, 0.2 * x),
        (r, 0.42 * x),
        (0.88 * r, 0.68 * x),
        (0.5 * r, 0.92 * x),
        (0, x),
    ]
    b.add(lathe(profile, 14).at(z=-x / 2).turned("y", 90).at(z=r), shell)


PLATED = 0.036
"""m. Height of food that is served on a plate."""


def served(
    b: ObjectBuilder,
    *,
    dish: str = "bowl",
    filling: tuple = ("red",),
    bits: tuple = (),
    filled: int | None = None,
    deep: int | None = None,
) -> None:
    """A filled dish: soup or salad in a bowl, lasagne or a casserole in an oven dish. The filling is solid.

    filled: number of models that are filled, the others are empty dishes; None: all are. deep: number of models whose
    bowl is deep, the others are plates; None: all are.
    """
    if deep is not None and b.index >= deep:
        b.size, b.mass = (*b.size[:2], PLATED), 0.45
    x, y, z = b.size
    look = materials.plain(b.pick(("porcelain", "cream", "sky")), "ceramic", 0.7)
    fill = materials.skin(b.pick(filling), b.rng, 0.3, 0.05)
    level = 0.8 * z
    if dish == "bowl":
        r = x / 2
        b.add(turned_vessel([(0.5 * r, 0), (0.82 * r, 0.4 * z), (r, z)], 0.005, 6), look)
        b.add(lathe([(0.45 * r, 0.1 * z), (0.86 * r, level)], 16), fill)
    else:
        b.add(tray(x, y, z, 0.007, spread=0.012), look)
        if filled is None or b.index < filled:
            b.add(
                hull(
                    [(sx * (x / 2 - 0.02), sy * (y / 2 - 0.02), 0.008) for sx in (-1, 1) for sy in (-1, 1)]
                    + [(sx * (x / 2 - 0.01), sy * (y / 2 - 0.01), level) for sx in (-1, 1) for sy in (-1, 1)]
                ),
                fill,
            )
        else:
            bits = ()
        for s in (-1, 1):
            b.add(box(0.25 * x, 0.025, 0.012).at(0, s * (y / 2 + 0.006), 0.8 * z).visual_only(), look)
    for k in range(12 if bits else 0):
        a = 2.4 * k
        r = 0.36 * math.sqrt((k + 0.5) / 12)
        bit = materials.plain(bits[k % len(bits)], "organic")
        size = 0.13 * min(x, y)
        b.add(
            soft_box(size, 0.7 * size, 0.3 * size, 0.1 * size, 1)
            .visual_only()
            .turned("z", 50 * k)
            .at(r * x * math.cos(a), r * y * math.sin(a), level - 0.08 * size),
            bit,
        )


def chip_bag(b: ObjectBuilder, *, looks: tuple = (("red", "yellow"), ("green", "cream"), ("blue", "orange"))) -> None:
    """A pillow-shaped bag lying on its back, printed."""
    x, y, z = b.size
    ground, accent = b.pick(looks)
    foil = materials.plain(ground, "metal", 0.6)
    rows = [(-0.5, 0.02), (-0.44, 0.1), (-0.3, 0.8), (0.0, 1.0), (0.3, 0.8), (0.44, 0.1), (0.5, 0.02)]
    points = [
        (u * x, s * y * (0.5 if abs(u) > 0.35 else 0.46), z / 2 + h * k * z / 2)
        for u, k in rows
        for s in (-1, 1)
        for h in (-1, 1)
    ]
    points += [(u * x, 0, z / 2 + h * k * z / 2) for u, k in rows for h in (-1, 1)]
    b.add(hull(points), foil)
    b.add(decal(0.7 * y, 0.5 * x, "z").at(0, 0, z + 0.0004), printed(b, ground, accent))


def tart(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(
        lathe([(0.82 * r, 0), (r, 0.9 * z), (0.97 * r, z), (0.88 * r, 0.85 * z)], 24),
        materials.skin(CRUST, b.rng, 0.15),
    )
    b.add(
        cylinder(0.88 * r, 0.002, 20).visual_only().at(z=0.86 * z),
        materials.skin(b.pick(((0.65, 0.12, 0.18), (0.95, 0.78, 0.35))), b.rng, 0.2),
    )


CATEGORIES = [
    Entry("bagel", bagel, (0.105, 0.105, 0.036), 0.10, 4, uniform=True),
    Entry("pretzel", pretzel, (0.110, 0.130, 0.024), 0.08, 3, uniform=True),
    Entry("baguette", loaf, (0.550, 0.075, 0.060), 0.28, 3),
    Entry("muffin", muffin, (0.078, 0.078, 0.075), 0.11, 3, rest="standing", uniform=True,
          options={"tops": (CRUST, (0.40, 0.24, 0.14))}),
    Entry("cupcake", muffin, (0.070, 0.070, 0.085), 0.08, 4, rest="standing", uniform=True,
          options={"tops": ("pink", "cream", "sky", (0.40, 0.24, 0.14)), "icing": True}),
    Entry("cookie", disc_cake, (0.070, 0.070, 0.013), 0.020, 4,
          options={"colours": (CRUST, (0.45, 0.28, 0.16)), "dots": "brown"}),
    Entry("gingerbread", gingerbread, (0.120, 0.090, 0.012), 0.035, 3, vary=0.05),
    Entry("candy_cane", candy_cane, (0.140, 0.050, 0.011), 0.014, 3),
    Entry("lollipop", lollipop, (0.130, 0.045, 0.014), 0.020, 3),
    Entry("hamburger", hamburger, (0.105, 0.105, 0.068), 0.22, 4, rest="standing", uniform=True),
    Entry("sushi", sushi, (0.050, 0.028, 0.026), 0.030, 4),
    Entry("cheese", cheese, (0.120, 0.080, 0.045), 0.25, 4),
    Entry("egg", egg, (0.057, 0.044, 0.044), 0.060, 4, uniform=True),
    Entry("salad", served, (0.200, 0.200, 0.085), 0.65, 3, extra=1, rest="upright", uniform=True,
          options={"filling": ("lime",), "bits": ("leaf", "red", "lime", "orange"), "deep": 3}),
    Entry("soup", served, (0.170, 0.170, 0.070), 0.70, 3, rest="upright", uniform=True,
          options={"filling": ("orange", (0.78, 0.70, 0.35), "dark_red"), "bits": ("green",)}),
    Entry("guacamole", served, (0.120, 0.120, 0.055), 0.35, 2, rest="upright", uniform=True,
          options={"filling": ((0.56, 0.68, 0.30),)}),
    Entry("puree", served, (0.130, 0.130, 0.055), 0.38, 2, rest="upright", uniform=True,
          options={"filling": ((0.93, 0.82, 0.50),)}),
    Entry("casserole", served, (0.220, 0.320, 0.075), 2.20, 4, extra=1, rest="upright",
          options={"dish": "tray", "filling": ((0.78, 0.50, 0.20),), "bits": ("green", "orange"), "filled": 4}),
    Entry("lasagna", served, (0.190, 0.270, 0.065), 1.50, 3, rest="upright",
          options={"dish": "tray", "filling": ((0.80, 0.42, 0.18),), "bits": ("red", "cream")}),
    Entry("chip", chip_bag, (0.260, 0.190, 0.065), 0.15, 4),
    Entry("tart", tart, (0.110, 0.110, 0.026), 0.13, 3, rest="standing", uniform=True),
]  # fmt: skip
