"""Clothes as rigid bundles, shoes, hats, jewellery, bags' small relatives."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..shapes import materials, textures
from ..shapes.bricks import arc, ball, block, box, cylinder, decal, extrusion, hull, lathe, prism, rod, soft_box, tube
from ..shapes.vessels import ring, tray
from .cloths import cloth
from .entry import Entry
from .model import ObjectBuilder

SHIRT = [
    (0.5, -0.26),
    (0.5, -0.12),
    (0.44, 0.0),
    (0.5, 0.12),
    (0.5, 0.26),
    (0.3, 0.5),
    (0.14, 0.42),
    (0.22, 0.27),
    (-0.5, 0.27),
    (-0.5, -0.27),
    (0.22, -0.27),
    (0.14, -0.42),
    (0.3, -0.5),
]
LONG = [
    (0.5, -0.2),
    (0.5, -0.1),
    (0.46, 0.0),
    (0.5, 0.1),
    (0.5, 0.2),
    (0.36, 0.32),
    (-0.12, 0.5),
    (-0.16, 0.38),
    (0.18, 0.26),
    (-0.5, 0.27),
    (-0.5, -0.27),
    (0.18, -0.26),
    (-0.16, -0.38),
    (-0.12, -0.5),
    (0.36, -0.32),
]
TROUSERS = [(0.5, -0.34), (0.5, 0.34), (-0.5, 0.5), (-0.5, 0.1), (0.2, 0.0), (-0.5, -0.1), (-0.5, -0.5)]
DRESS = [
    (0.5, -0.2),
    (0.5, -0.12),
    (0.4, 0.0),
    (0.5, 0.12),
    (0.5, 0.2),
    (0.3, 0.27),
    (0.1, 0.2),
    (-0.5, 0.5),
    (-0.5, -0.5),
    (0.1, -0.2),
    (0.3, -0.27),
]
BRIEFS = [(0.5, -0.5), (0.5, 0.5), (0.1, 0.5), (-0.3, 0.14), (-0.5, 0.12), (-0.5, -0.12), (-0.3, -0.14), (0.1, -0.5)]
SOCK = [(0.5, -0.1), (0.5, 0.3), (-0.15, 0.3), (-0.3, 0.5), (-0.5, 0.44), (-0.5, 0.1), (-0.3, -0.14), (-0.1, -0.2)]
MITTEN = [
    (-0.5, -0.3),
    (0.05, -0.36),
    (0.1, -0.5),
    (0.24, -0.44),
    (0.2, -0.24),
    (0.46, -0.2),
    (0.5, 0.1),
    (0.42, 0.4),
    (-0.1, 0.44),
    (-0.5, 0.36),
]


STANDING_STOCKING = (0.260, 0.150, 0.360)
"""m."""

GARMENT_DENSITY = 65.0
"""kg/m^3 of the box around a folded garment."""

FOLDED = 4
"""Number of the first garment that is folded, or stands; only the object library has such."""


def garment(
    b: ObjectBuilder,
    *,
    outline: list[tuple[float, float]],
    kind: str | None = None,
    layers: int = 2,
    folds: tuple[float, float, float] | None = None,
) -> None:
    """A flat garment lying on its back, collar towards +x; collides as one box of full size.

    folds: size (x, y, z) of models from number `FOLDED` on, which are folded for a shelf or a box.
    """
    if folds is not None and b.index >= FOLDED:
        b.size, b.mass = folds, GARMENT_DENSITY * math.prod(folds)
        folded_garment(b, kind=kind)
        return
    x, y, z = b.size
    turned = outline if _area(outline) > 0 else outline[::-1]
    points = [(u * x, v * y) for u, v in turned]
    look = cloth(b, kind)
    t = z / layers
    for k in range(layers):
        shrink = 1 - 0.02 * k
        b.add(extrusion([(u * shrink, v * shrink) for u, v in points], t, []).at(z=k * t), look)
    b.add(box(x, y, z).collision_only(), look)


def folded_garment(b: ObjectBuilder, *, layers: int = 3, kind: str | None = None) -> None:
    """A shirt, sweater or pair of trousers folded for a shelf, its collar or waistband towards +x; collides as one
    box."""
    x, y, z = b.size
    look = cloth(b, kind)
    t = z / layers
    for k in range(layers):
        b.add(
            soft_box(x - 0.004 * (k % 2), y - 0.006 * k, t, 0.45 * t).visual_only().at(0.002 * (k % 2), 0, k * t),
            look,
        )
    band = [(0.46 * x, 0.2 * y * math.cos(a), z + 0.004 * math.sin(a)) for a in (k * math.pi / 6 for k in range(7))]
    b.add(tube(band, 0.004, 6, hulls=0), look)
    b.add(box(x, y, z).collision_only(), look)


def stocking(b: ObjectBuilder, **options: Any) -> None:
    """A Christmas stocking, flat; from number `FOLDED` on of stiff felt, standing on its foot, open at the top; its toe
    towards +x."""
    if b.index < FOLDED:
        garment(b, **options)
        return
    b.size, b.mass, b.rest = STANDING_STOCKING, 0.16, "upright"
    x, y, z = b.size
    felt, fur = cloth(b, "stripes"), materials.plain("white", "fabric")
    wall, leg, foot = 0.006, 0.58 * x, 0.32 * z
    rear = -x / 2 + leg / 2
    b.add(tray(leg, y, z, wall).at(rear), felt)
    toe = soft_box(x - leg + wall, y, foot, 0.3 * foot, 2)
    b.add(toe.at((leg - wall) / 2), felt)
    for s in (-1, 1):
        b.add(block((leg + 0.01, 0.008, 0.16 * z), (rear, s * (y / 2 + 0.001), 0.9 * z)).visual_only(), fur)
        b.add(block((0.008, y + 0.01, 0.16 * z), (rear + s * (leg / 2 + 0.001), 0, 0.9 * z)).visual_only(), fur)


def _area(points: list[tuple[float, float]]) -> float:
    return sum(a[0] * c[1] - c[0] * a[1] for a, c in zip(points, points[1:] + points[:1], strict=True))


def folded_pair(b: ObjectBuilder) -> None:
    """Pyjamas: folded trousers with a folded top on them."""
    x, y, z = b.size
    look = cloth(b, "stripes")
    b.add(soft_box(x, y, 0.5 * z, 0.2 * z), look)
    b.add(soft_box(0.9 * x, 0.94 * y, 0.5 * z, 0.2 * z).at(z=0.5 * z), look)
    for k in range(3):
        b.add(cylinder(0.006, 0.003, 8).visual_only().at((k - 1) * 0.2 * x, 0, z - 0.001), materials.plain("white"))


def scarf(b: ObjectBuilder) -> None:
    """A folded scarf with fringes."""
    x, y, z = b.size
    look = cloth(b)
    b.add(soft_box(x - 0.03, y, z, 0.45 * z), look)
    for k in range(8):
        yy = (k - 3.5) * y / 8.5
        b.add(rod((x / 2 - 0.03, yy, z / 3), (x / 2, yy, 0.004), 0.004, 5).visual_only(), look)


def shoe(b: ObjectBuilder, *, style: str = "trainer") -> None:
    """One shoe, toe towards +x: sole and upper; a trainer has laces, a sandal straps."""
    x, y, z = b.size
    sole_z = 0.26 * z if style == "trainer" else 0.3 * z
    foot = [
        (0.5, 0.0),
        (0.44, 0.32),
        (0.2, 0.5),
        (-0.2, 0.34),
        (-0.42, 0.36),
        (-0.5, 0.0),
        (-0.42, -0.36),
        (-0.2, -0.34),
        (0.2, -0.5),
        (0.44, -0.32),
    ]
    b.add(
        prism([(u * x, v * y) for u, v in foot], sole_z),
        materials.plain("white" if style == "trainer" else "brown", "rubber"),
    )
    colour = b.pick(("red", "navy", "black", "grey", "pink"))
    if style == "trainer":
        upper = materials.fabric(colour, b.rng)
        low = [(u * x * 0.96, v * y * 0.92, sole_z) for u, v in foot]
        high = [(0.36 * x, s * 0.22 * y, 0.5 * z) for s in (-1, 1)] + [
            (0.05 * x, s * 0.24 * y, 0.82 * z) for s in (-1, 1)
        ]
        high += [(-0.12 * x, s * 0.24 * y, z) for s in (-1, 1)] + [(-0.46 * x, s * 0.16 * y, z) for s in (-1, 1)]
        b.add(hull(low + high), upper)
        b.add(
            hull(
                [(px * x, s * 0.17 * y, z * 1.002) for px in (-0.13, -0.42) for s in (-1, 1)]
                + [(-0.27 * x, 0, 0.9 * z)]
            ).visual_only(),
            materials.plain("black", "fabric"),
        )
        for k in range(4):
            px, pz = 0.08 + 0.065 * k, 0.8 - 0.09 * k
            b.add(
                block((0.012, 0.4 * y, 0.006), (px * x, 0, (pz + 0.03) * z)).visual_only(),
                materials.plain("white", "fabric"),
            )
        for s in (-1, 1):
            b.add(
                block((0.3 * x, 0.003, 0.12 * z)).visual_only().turned("y", -25).at(-0.05 * x, s * 0.4 * y, 0.45 * z),
                materials.plain("white"),
            )
    else:
        strap = materials.leather(b.pick(("brown", "black", "tan")), b.rng)
        for px, w, h in ((0.22, 0.46, 0.7), (-0.1, 0.36, 1.0)):
            path = [
                (px * x, w * y * math.cos(a), sole_z * 0.8 + (h * z - sole_z * 0.9) * math.sin(a))
                for a in (k * math.pi / 8 for k in range(9))
            ]
            b.add(tube(path, 0.004, 5, hulls=1).scaled(x=1.0), strap)
        heel = [
            (-0.46 * x, 0.3 * y * math.cos(a), sole_z * 0.8 + 0.5 * z * math.sin(a))
            for a in (k * math.pi / 8 for k in range(9))
        ]
        b.add(tube(heel, 0.004, 5, hulls=0), strap)


def hat(b: ObjectBuilder) -> None:
    """A brimmed hat: hollow crown, wide brim."""
    x, y, z = b.size
    felt = materials.fabric(b.pick(("beige", "black", "navy", "red", "brown")), b.rng)
    r = x / 2
    crown = lathe([(0.52 * r, 0.012), (0.54 * r, 0.3 * z), (0.5 * r, 0.85 * z), (0.4 * r, z)], 20)
    b.add(crown.visual_only() + ring(0.53 * r, 0.5 * r, 0.0, 0.92 * z, 0.01, 6), felt)
    b.add(lathe([(0.98 * r, 0), (r, 0.006), (0.52 * r, 0.014)], 24).visual_only(), felt)
    b.add(cylinder(r, 0.008).collision_only(), felt)
    b.add(cylinder(0.5 * r, 0.01).collision_only().at(z=z - 0.01), felt)
    b.add(lathe([(0.545 * r, 0.014), (0.545 * r, 0.22 * z)], 20).visual_only(), materials.plain("black", "fabric"))
    del y


def glasses(b: ObjectBuilder) -> None:
    """Sunglasses: two dark lenses, a bridge, two temples."""
    x, y, z = b.size
    frame = materials.plain(b.pick(("black", "brown", "red")), shine=0.8)
    lens = materials.plain("black", "glass", 0.9)
    for s in (-1, 1):
        outline = [(0.21 * y * math.cos(a), 0.5 * z * math.sin(a)) for a in (k * math.pi / 6 for k in range(12))]
        shape = prism(outline, 0.003).turned("x", 90).turned("z", 90).at(x / 2 - 0.003, s * 0.25 * y, z / 2)
        b.add(shape, lens)
        rim = [
            (x / 2, s * 0.25 * y + 0.215 * y * math.cos(a), z / 2 + 0.49 * z * math.sin(a))
            for a in (k * math.pi / 8 for k in range(16))
        ]
        b.add(tube(rim, 0.0025, 5, hulls=0, closed=True), frame)
        b.add(block((x - 0.004, 0.003, 0.008), (0, s * (y / 2 - 0.002), 0.72 * z)), frame)
    b.add(block((0.004, 0.12 * y, 0.005), (x / 2 - 0.003, 0, 0.65 * z)).visual_only(), frame)


def jewel_ring(b: ObjectBuilder, *, gem: bool = True) -> None:
    """A finger ring or a bracelet lying flat."""
    x, _, z = b.size
    r = x / 2
    metal = materials.metal(b.pick(("gold", "silver")))
    thick = min(z / 2, 0.1 * x)
    path = [((r - thick) * math.cos(a), (r - thick) * math.sin(a), z / 2) for a in (k * math.pi / 9 for k in range(18))]
    b.add(tube(path, thick, 7, hulls=6, closed=True).at(z=-z / 2).scaled(z=0.5 * z / thick).at(z=z / 2), metal)
    if gem:
        b.add(
            ball(0.2 * x, 0.2 * x, 0.2 * x, 6).visual_only().at(r - thick, 0, z / 2 - 0.1 * x),
            materials.glass(b.pick(("sky", "red", "green")), 0.8),
        )


def necklace(b: ObjectBuilder) -> None:
    """A chain of beads lying in a loop with a pendant; collides as wedges of the ring."""
    x, y, z = b.size
    beads = (
        materials.metal(b.pick(("gold", "silver")))
        if b.rng.random() < 0.5
        else materials.plain("porcelain", "ceramic", 0.8)
    )
    rx, ry = (x - 0.03) / 2, y / 2
    for k in range(26):
        a = 2 * math.pi * k / 26
        b.add(
            ball(0.7 * z, 0.7 * z, 0.7 * z, 6)
            .visual_only()
            .at((rx - z / 2) * math.cos(a) - 0.015, (ry - z / 2) * math.sin(a)),
            beads,
        )
    b.add(
        lathe([(0.3, 0), (0.5, 0.5), (0.2, 1)], 8).visual_only().scaled(0.02, 0.02, z).at(x / 2 - 0.012),
        materials.glass("red", 0.9),
    )
    path = [
        ((rx - z / 2) * math.cos(a) - 0.015, (ry - z / 2) * math.sin(a), z / 2)
        for a in (k * math.pi / 8 for k in range(16))
    ]
    b.add(
        tube(path, z / 2, 6, hulls=7, closed=True).collision_only()
        + box(0.024, 0.02, z).collision_only().at(x / 2 - 0.012),
        beads,
    )


def jewel(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(lathe([(0, 0), (r, 0.62 * z), (0.6 * r, z)], 8), materials.glass(b.pick(("red", "green", "sky")), 0.85))


def watch(b: ObjectBuilder) -> None:
    """A wrist watch: case, face, closed strap standing on its edge."""
    x, y, z = b.size
    strap = materials.leather(b.pick(("brown", "black")), b.rng)
    r = 0.42 * x
    path = [(r * math.cos(a) - 0.06 * x, r * 0.9 * math.sin(a), z / 2) for a in (k * math.pi / 8 for k in range(16))]
    flat = tube(path, 0.002, 6, hulls=0, closed=True).at(z=-z / 2).scaled(z=0.3 * z / 0.002).at(z=z / 2)
    b.add(flat + ring(r, r, 0.2 * z, 0.8 * z, 0.004, 6).at(-0.06 * x), strap)
    b.add(cylinder(z / 2, 0.12 * x, 16).turned("y", 90).at(x / 2 - 0.16 * x, 0, z / 2), materials.metal("silver"))
    b.add(decal(0.62 * z, 0.62 * z).at(x / 2 - 0.04 * x + 0.0005, 0, z / 2), materials.picture("dial", textures.dial()))
    del y
    b.point("toggle_button", (x / 2 - 0.1 * x, z / 2, z / 2))


def umbrella(b: ObjectBuilder) -> None:
    """A closed umbrella lying along x, crook towards -x."""
    x, y, z = b.size
    cloth_ = materials.fabric(b.pick(("black", "red", "navy", "green")), b.rng)
    r = z / 2
    crook = 0.5 * y
    b.add(
        lathe([(0.2 * r, 0), (0.9 * r, 0.2 * x), (r, 0.6 * x), (0.3 * r, 0.72 * x)], 12)
        .turned("y", -90)
        .at(x / 2 - 0.03, 0, r),
        cloth_,
    )
    b.add(rod((x / 2, 0, r), (-x / 2 + crook, 0, r), 0.005, 6).visual_only(), materials.metal("steel"))
    path = [(-x / 2 + crook + 0.12, 0, r), (-x / 2 + crook, 0, r)] + [
        (-x / 2 + crook - 0.8 * crook * math.sin(a), -0.8 * crook * (1 - math.cos(a)), r)
        for a in (k * math.pi / 6 for k in range(1, 7))
    ]
    b.add(tube(path, 0.010, 6, hulls=3), materials.wood("walnut", b.rng))


def hanger(b: ObjectBuilder) -> None:
    """A coat hanger lying flat."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("pine", "walnut", "white")), b.rng)
    drop = 0.42 * x
    left, top, right = (
        (-x / 2 + z / 2, -y / 2 + z / 2, z / 2),
        (-x / 2 + drop, 0, z / 2),
        (-x / 2 + z / 2, y / 2 - z / 2, z / 2),
    )
    for start, end in ((left, top), (top, right), (left, right)):
        b.add(rod(start, end, z / 2, 8), wood)
    hook = [top, (top[0] + 0.1 * x, 0, z / 2)] + [
        p + np.array([x / 2 - 0.17 * x, 0, z / 2]) for p in arc(0.15 * x, -160, 60, 8, "xy")
    ]
    b.add(tube(hook, 0.25 * z, 6, hulls=2), materials.metal("steel"))


CATEGORIES = [
    Entry("t-shirt", garment, (0.620, 0.560, 0.020), 0.18, FOLDED, extra=1,
          options={"outline": SHIRT, "folds": (0.290, 0.240, 0.040)}),
    Entry("sweater", garment, (0.620, 0.640, 0.040), 0.45, FOLDED, extra=1,
          options={"outline": LONG, "folds": (0.310, 0.270, 0.085)}),
    Entry("coat", garment, (0.900, 0.640, 0.060), 1.40, 3, options={"outline": LONG, "kind": "plain"}),
    Entry("jeans", garment, (0.900, 0.400, 0.035), 0.60, FOLDED, extra=1,
          options={"outline": TROUSERS, "kind": "plain", "folds": (0.330, 0.250, 0.070)}),
    Entry("dress", garment, (0.900, 0.500, 0.022), 0.30, 3, options={"outline": DRESS}),
    Entry("underwear", garment, (0.240, 0.320, 0.012), 0.06, FOLDED, extra=1,
          options={"outline": BRIEFS, "folds": (0.150, 0.120, 0.030)}),
    Entry("sock", garment, (0.280, 0.120, 0.012), 0.03, 4, options={"outline": SOCK, "kind": "stripes"}),
    Entry("stocking", stocking, (0.420, 0.210, 0.020), 0.10, FOLDED, extra=1,
          options={"outline": SOCK, "kind": "stripes"}),
    Entry("glove", garment, (0.230, 0.130, 0.024), 0.06, 3, options={"outline": MITTEN}),
    Entry("pajamas", folded_pair, (0.300, 0.260, 0.070), 0.45, 2),
    Entry("scarf", scarf, (0.300, 0.200, 0.045), 0.16, 3),
    Entry("gym_shoe", shoe, (0.290, 0.105, 0.110), 0.35, 4, rest="upright"),
    Entry("walker", shoe, (0.300, 0.110, 0.130), 0.50, 3, rest="upright"),
    Entry("sandal", shoe, (0.270, 0.100, 0.080), 0.25, 4, rest="upright", options={"style": "sandal"}),
    Entry("hat", hat, (0.330, 0.330, 0.120), 0.12, 4, rest="upright", uniform=True),
    Entry("sunglass", glasses, (0.150, 0.145, 0.045), 0.030, 3),
    Entry("ring", jewel_ring, (0.024, 0.024, 0.008), 0.006, 2, uniform=True),
    Entry("bracelet", jewel_ring, (0.070, 0.070, 0.012), 0.025, 3, uniform=True, options={"gem": False}),
    Entry("necklace", necklace, (0.180, 0.140, 0.009), 0.030, 3),
    Entry("jewel", jewel, (0.014, 0.014, 0.010), 0.004, 2, uniform=True),
    Entry("watch", watch, (0.065, 0.055, 0.038), 0.07, 2),
    Entry("umbrella", umbrella, (0.850, 0.100, 0.070), 0.45, 4),
    Entry("hanger", hanger, (0.240, 0.420, 0.014), 0.10, 3),
]  # fmt: skip
