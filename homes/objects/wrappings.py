"""Gifts, ribbons, envelopes, punnets."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import Solid, ball, block, box, cylinder, decal, hull, join, lathe, soft_box, tube
from .entry import Entry
from .model import ObjectBuilder
from .packages import printed

_TURN = [k * math.pi / 6 for k in range(12)]


def gift(b: ObjectBuilder) -> None:
    """A wrapped present with a ribbon and a bow."""
    x, y, z = b.size
    first, second = b.pick(
        (("red", "white"), ("blue", "silver"), ("green", "gold"), ("purple", "yellow"), ("pink", "white"))
    )
    paper = textures.stripes(materials.colour(first), materials.tint(first, b.rng, 0.4), 4)
    top = 0.85 * z
    b.add(box(x, y, top), materials.picture("wrap", paper, 0.12))
    ribbon_ = materials.plain(second, "fabric")
    b.add(block((x + 0.002, 0.12 * y, top + 0.002), (0, 0, top / 2)).visual_only(), ribbon_)
    b.add(block((0.12 * y, y + 0.002, top + 0.002), (0, 0, top / 2)).visual_only(), ribbon_)
    b.add(loops(0.5 * min(x, y), z - top).at(z=top), ribbon_)
    b.add(box(0.3 * min(x, y), 0.45 * min(x, y), z - top).collision_only().at(z=top), ribbon_)


def bow(b: ObjectBuilder) -> None:
    x, y, z = b.size
    cloth = materials.plain(b.pick(("red", "gold", "blue", "pink")), "fabric", 0.5)
    b.add(loops(y, z), cloth)
    for s in (-1, 1):
        b.add(
            block((0.5 * x, 0.16 * y, 0.003)).visual_only().turned("z", s * 22).at(0.25 * x, s * 0.12 * y, 0.002), cloth
        )
    b.add(box(x, y, z).collision_only(), cloth)


def ribbon(b: ObjectBuilder) -> None:
    """A spool of ribbon."""
    x, _, z = b.size
    r = x / 2
    b.add(cylinder(r, 0.08 * z), materials.plain("cardboard", "paper"))
    b.add(
        lathe([(0.92 * r, 0.08 * z), (0.92 * r, 0.92 * z)]),
        materials.plain(b.pick(("red", "gold", "purple", "green")), "fabric", 0.6),
    )
    b.add(cylinder(r, 0.08 * z).at(z=0.92 * z), materials.plain("cardboard", "paper"))


def envelope(b: ObjectBuilder) -> None:
    x, y, z = b.size
    card = materials.plain(b.pick(("paper", "cream", "cardboard")), "paper")
    b.add(box(x, y, z), card)
    flap = [(-x / 2, -y / 2, z), (-x / 2, y / 2, z), (0.1 * x, 0, z), (-x / 2, 0, z + 0.0008)]
    b.add(hull(flap).visual_only(), materials.plain(materials.tint("light_grey", b.rng), "paper"))


def loops(width: float, height: float) -> Solid:
    """A tied bow, visual only: two loops and a knot, standing on z = 0."""
    parts = []
    for s in (-1, 1):
        ellipse = [(0, s * 0.25 * width * (1 - math.cos(a)), 0.5 * height + 0.38 * height * math.sin(a)) for a in _TURN]
        parts.append(tube(ellipse, 0.1 * height, 5, hulls=0, closed=True).scaled(x=2.5))
    parts.append(soft_box(0.4 * height, 0.4 * height, 0.5 * height).visual_only().at(z=0.25 * height))
    return join(parts)


def tea_bag(b: ObjectBuilder) -> None:
    x, y, z = b.size
    paper = materials.picture("tea", textures.speckle((0.80, 0.70, 0.55), b.rng, 0.2), 0.05, "paper")
    b.add(soft_box(0.6 * x, y, z, 0.4 * z).at(-0.2 * x), paper)
    b.add(
        tube([(0.1 * x, 0, z / 2), (0.2 * x, 0.1 * y, z / 4), (0.35 * x, 0, z / 4)], 0.0005, 4, hulls=0),
        materials.plain("white", "fabric"),
    )
    b.add(box(0.24 * x, 0.4 * y, 0.001).at(0.38 * x), materials.plain(b.pick(("red", "green", "yellow")), "paper"))


def sweets_box(b: ObjectBuilder) -> None:
    """A flat box of chocolates, its cover printed."""
    x, y, z = b.size
    ground = b.pick(("dark_red", "brown", "gold"))
    b.add(box(x, y, z), materials.plain(ground, "paper"))
    b.add(decal(0.95 * y, 0.95 * x, "z").at(z=z + 0.0004), printed(b, ground, "cream", (96, 72)))
    b.add(block((x + 0.001, 0.02, z + 0.001), (0, 0.25 * y, z / 2)).visual_only(), materials.plain("gold", "fabric"))


def punnet(b: ObjectBuilder, *, colours: tuple) -> None:
    """A closed clear punnet of berries or dates; solid."""
    x, y, z = b.size
    looks = [materials.plain(materials.tint(c, b.rng), "organic") for c in colours]
    for i in range(4):
        for j in range(5):
            size = 0.2 * x
            look = looks[(i + j) % len(looks)]
            b.add(
                ball(size, size * 1.1, 0.7 * z, 6).visual_only().at((i - 1.5) * 0.22 * x, (j - 2) * 0.18 * y, 0.05 * z),
                look,
            )
    b.add(box(x, y, z).collision_only(), looks[0])
    clear = materials.glass("glass", 0.3)
    b.add(soft_box(x, y, z, 0.1 * z).visual_only(), clear)


CATEGORIES = [
    Entry("envelope", envelope, (0.114, 0.162, 0.003), 0.010, 3),
    Entry("wrapped_gift", gift, (0.220, 0.260, 0.180), 0.8, 5, rest="upright", vary=0.15),
    Entry("bow", bow, (0.080, 0.120, 0.045), 0.015, 3),
    Entry("ribbon", ribbon, (0.070, 0.070, 0.030), 0.04, 3, uniform=True),
    Entry("container_date", punnet, (0.120, 0.160, 0.055), 0.30, 2, options={"colours": ((0.36, 0.18, 0.08),)}),
    Entry("container_cranberry", punnet, (0.110, 0.150, 0.060), 0.34, 2, options={"colours": ("dark_red", "red")}),
    Entry("chocolate_box", sweets_box, (0.190, 0.260, 0.035), 0.35, 3),
    Entry("tea_bag", tea_bag, (0.110, 0.050, 0.010), 0.003, 2),
]  # fmt: skip
