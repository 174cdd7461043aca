"""Plates, bowls, cups, glasses, cutlery."""

from __future__ import annotations

from typing import Any

from ..shapes import materials
from ..shapes.bricks import Solid, ball, hull, lathe, prism, rod, soft_box, tube
from ..shapes.materials import Material
from ..shapes.vessels import turned_vessel
from .entry import Entry
from .model import ObjectBuilder
from .parts import ear

OF_ITS_KIND = 3
"""Carving knives that stand."""

STANDING, STANDING_MASS = 4, 0.15
"""Number of the first carving knife that stands on its handle, edge down, and what such a one weighs, kg. Only the
object library has such."""

GLAZES = ("porcelain", "cream", "sky", "mint", "terracotta", "navy", "light_grey", "rose")


def glaze(b: ObjectBuilder) -> Material:
    return materials.plain(b.pick(GLAZES), "ceramic", 0.7)


def bowl(b: ObjectBuilder, *, wall: float = 0.005) -> None:
    """A hollow bowl; open shapes by model: round, steep, wide."""
    x, _, z = b.size
    r = x / 2
    foot = b.pick((0.45, 0.6, 0.4)) * r
    profile = [(foot, 0), (foot + 0.6 * (r - foot), 0.35 * z), (foot + 0.88 * (r - foot), 0.7 * z), (r, z)]
    b.add(turned_vessel(profile, wall, 7, floor=0.006), glaze(b))


def plate(b: ObjectBuilder) -> None:
    """A flat plate with a raised rim: the floor is one disc, the rim a ring of wedges."""
    x, _, z = b.size
    r = x / 2
    b.add(turned_vessel([(0.62 * r, 0), (0.7 * r, 0.25 * z), (r, z)], 0.005, 7, 28, floor=0.005), glaze(b))


def mug(b: ObjectBuilder, *, handle: bool = True) -> None:
    """A straight cup with an ear; 6 walls, a floor and the ear collide."""
    x, y, z = b.size
    r = min(y, x / 1.35 if handle else x) / 2
    shift = (x - 2 * r) / 2 if handle else 0.0
    bulge = b.pick((1.0, 0.85, 0.92))
    look = glaze(b)
    b.add(turned_vessel([(bulge * r, 0), (r, 0.5 * z), (r, z)], 0.004, 6).at(-shift), look)
    if handle:
        b.add(ear(0.26 * z, 0.0055).at(r - shift - 0.004, 0, 0.52 * z), look)


def glass(b: ObjectBuilder) -> None:
    """A tumbler or a stemmed wine glass."""
    x, _, z = b.size
    r = x / 2
    look = materials.glass("glass", 0.35)
    if b.pick((True, False)):
        b.add(turned_vessel([(0.8 * r, 0), (r, z)], 0.003, 7, floor=0.008), look)
    else:
        b.add(
            lathe(
                [(0.85 * r, 0), (0.8 * r, 0.003), (0.1 * r, 0.02), (0.08 * r, 0.4 * z), (0.3 * r, 0.44 * z)],
                split=[0.02],
            ),
            look,
        )
        cup = turned_vessel([(0.35 * r, 0), (0.95 * r, 0.2 * z), (r, 0.32 * z), (0.85 * r, 0.56 * z)], 0.003, 5)
        b.add(cup.at(z=0.44 * z), look)


def _handle(length: float, width: float, thick: float) -> Solid:
    """A flat handle from the origin to -x."""
    return hull(
        [(-length, s * 0.6 * width, h) for s in (-1, 1) for h in (0, thick)]
        + [(-0.7 * length, s * width / 2, h) for s in (-1, 1) for h in (0, thick)]
        + [(0, s * 0.28 * width, h) for s in (-1, 1) for h in (0, thick)]
    )


def spoon(b: ObjectBuilder) -> None:
    x, y, z = b.size
    steel = materials.metal("silver")
    head = 0.28 * x
    b.add(_handle(x - head, 0.5 * y, 0.0025).at(x / 2 - head, 0, 0.4 * z), steel)
    b.add(ball(head, y, z).at(x / 2 - head / 2), steel)


def fork(b: ObjectBuilder) -> None:
    x, y, z = b.size
    steel = materials.metal("silver")
    head = 0.35 * x
    b.add(_handle(x - head, 0.6 * y, 0.0025).at(x / 2 - head, 0, 0.3 * z), steel)
    b.add(
        hull(
            [(x / 2 - head - 0.005, s * 0.15 * y, 0.3 * z + h) for s in (-1, 1) for h in (0, 0.0025)]
            + [(x / 2 - 0.55 * head, s * y / 2, h) for s in (-1, 1) for h in (0, 0.003)]
        ),
        steel,
    )
    for k in range(4):
        yy = (k - 1.5) * y / 3.9
        tine = [
            (x / 2 - 0.55 * head, yy - 0.0014, 0),
            (x / 2 - 0.55 * head, yy + 0.0014, 0),
            (x / 2 - 0.55 * head, yy, 0.003),
            (x / 2, yy - 0.0007, 0.5 * z),
            (x / 2, yy + 0.0007, 0.5 * z),
            (x / 2, yy, z),
        ]
        b.add(hull(tine), steel)


def knife(b: ObjectBuilder, *, blade: float = 0.55, tall: float = 0.8, grip: str = "black") -> None:
    """A knife lying on its side, edge towards -y. `blade`: its share of the length; the slicer box is its edge."""
    x, y, z = b.size
    steel = materials.metal("silver")
    handle = materials.wood("walnut", b.rng) if grip == "wood" else materials.plain(grip)
    start, tip = x / 2 - blade * x, x / 2
    edge, spine = -y / 2, -y / 2 + tall * y
    rim = 0.22 * (spine - edge)  # the part of the blade that is its edge
    thick = 0.0025
    low = z / 2 - thick / 2
    outline = [
        (start, edge),
        (tip - 0.25 * blade * x, edge),
        (tip, spine - 0.35 * (spine - edge)),
        (tip - 0.02, spine),
        (start, spine),
    ]
    b.add(prism(outline, thick).visual_only().at(z=low), steel)
    outline = [
        (start, edge + rim),
        (tip - 0.1 * blade * x, edge + rim),
        (tip, spine - 0.35 * (spine - edge)),
        (tip - 0.02, spine),
        (start, spine),
    ]
    b.add(prism(outline, thick).collision_only().at(z=low), steel)
    b.area("slicer", (0.75 * blade * x, rim, thick), (start + 0.375 * blade * x, edge + rim / 2, z / 2))
    b.add(soft_box(x - blade * x, 0.55 * y, z, 0.3 * z).at(-x / 2 + (x - blade * x) / 2, y / 2 - 0.36 * y, 0), handle)


def carving_knife(b: ObjectBuilder, **options: Any) -> None:
    """Lying on its side; three from number `STANDING` on standing on their handles, so that two fingers take them."""
    if not STANDING <= b.index < STANDING + OF_ITS_KIND:
        knife(b, **options)
        return
    b.rest, b.mass = "upright", STANDING_MASS
    standing_knife(b)


def standing_knife(b: ObjectBuilder) -> None:
    """A knife with a stout handle that stands on the table, edge down, the edge a centimetre above the table."""
    x, y, _ = b.size
    steel, wood = materials.metal("silver"), materials.wood("walnut", b.rng)
    wide, tall, half = 0.75 * y, 1.1 * y, 0.00125
    start, tip, point = -0.12 * x, 0.5 * x, 0.38 * x
    edge, spine = 0.012, 0.95 * tall
    rim = edge + 0.008  # below it the blade is its edge

    def blade(low: float) -> Solid:
        outline = [(start, low), (point, low), (tip, spine - 0.3 * (spine - edge)), (tip, spine), (start, spine)]
        return hull([(px, side, pz) for px, pz in outline for side in (-half, half)])

    b.add(blade(edge).visual_only(), steel)
    b.add(blade(rim).collision_only(), steel)
    b.area("slicer", (point - start, 2 * half, rim - edge), (0.5 * (start + point), 0, 0.5 * (edge + rim)))
    b.add(soft_box(start + 0.5 * x, wide, tall, 0.006).at(0.5 * (start - 0.5 * x), 0, 0), wood)


def chopstick(b: ObjectBuilder) -> None:
    x, _, z = b.size
    b.add(
        lathe([(z / 2, 0), (z / 4, x)], 8).at(z=-x / 2).turned("y", 90).at(z=z / 2),
        materials.wood(b.pick(("cherry", "ebony")), b.rng),
    )


def straw(b: ObjectBuilder) -> None:
    x, _, z = b.size
    bend = [(-x / 2, 0, z / 2), (0.25 * x, 0, z / 2), (0.32 * x, 0.01, z / 2), (x / 2, 0.03, z / 2)]
    b.add(tube(bend, z / 2, 8, hulls=2), materials.plain(b.pick(("red", "white", "blue", "green"))))


def toothpick(b: ObjectBuilder) -> None:
    x, _, z = b.size
    b.add(rod((-x / 2, 0, z / 2), (x / 2, 0, z / 2), z / 2, 6), materials.plain("birch", "wood"))


def tray(b: ObjectBuilder) -> None:
    """A serving tray with a rim and two grips."""
    from ..shapes.vessels import tray as open_box

    x, y, z = b.size
    look = b.pick(
        (
            materials.wood("oak", b.rng),
            materials.plain("red"),
            materials.metal("silver", b.rng),
            materials.wood("walnut", b.rng),
        )
    )
    b.add(open_box(x, y, 0.55 * z, 0.008, 0.006, spread=0.008), look)
    for s in (-1, 1):
        h = 0.18 * x
        path = [
            (-h, s * (y / 2 - 0.006), 0.5 * z),
            (-h, s * (y / 2 - 0.006), z - 0.005),
            (h, s * (y / 2 - 0.006), z - 0.005),
            (h, s * (y / 2 - 0.006), 0.5 * z),
        ]
        b.add(tube(path, 0.005, 6, hulls=1), look)


CATEGORIES = [
    Entry("bowl", bowl, (0.160, 0.160, 0.070), 0.38, 8, rest="upright", vary=0.12),
    Entry("plate", plate, (0.255, 0.255, 0.022), 0.55, 7, rest="upright", uniform=True),
    Entry("platter", plate, (0.340, 0.340, 0.028), 1.00, 3, rest="upright", uniform=True),
    Entry("mug", mug, (0.118, 0.086, 0.096), 0.33, 6, rest="upright"),
    Entry("cup", mug, (0.104, 0.078, 0.072), 0.22, 5, rest="upright"),
    Entry("glass", glass, (0.074, 0.074, 0.145), 0.22, 4, rest="upright"),
    Entry("spoon", spoon, (0.190, 0.042, 0.020), 0.055, 3),
    Entry("tablefork", fork, (0.195, 0.026, 0.016), 0.050, 3),
    Entry("table_knife", knife, (0.225, 0.022, 0.009), 0.070, 3, options={"blade": 0.5, "grip": "silver"}),
    Entry(
        "carving_knife",
        carving_knife,
        (0.330, 0.046, 0.022),
        0.190,
        STANDING,
        extra=7,
        options={"blade": 0.62, "grip": "wood"},
    ),
    Entry("chopstick", chopstick, (0.230, 0.008, 0.008), 0.012, 2),
    Entry("straw", straw, (0.200, 0.030, 0.006), 0.001, 2),
    Entry("toothpick", toothpick, (0.065, 0.002, 0.002), 0.0002, 2),
    Entry("tray", tray, (0.320, 0.450, 0.060), 0.90, 4, rest="upright"),
]
