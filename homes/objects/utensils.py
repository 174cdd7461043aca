"""Kitchen utensils: ladles, spatulas, tongs, boards, graters, colanders, lids."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import block, box, cylinder, hull, lathe, prism, rod, soft_box, tube
from ..shapes.materials import Material
from ..shapes.vessels import turned_vessel
from .entry import Entry
from .model import ObjectBuilder


def _look(b: ObjectBuilder) -> Material:
    return b.pick((materials.metal("silver"), materials.plain("black"), materials.wood("oak", b.rng)))


def spatula(b: ObjectBuilder) -> None:
    """A turner: slotted blade at +x, rising handle."""
    x, y, z = b.size
    look = _look(b)
    blade = 0.3 * x
    b.add(prism([(x / 2 - blade, -0.4 * y), (x / 2, -y / 2), (x / 2, y / 2), (x / 2 - blade, 0.4 * y)], 0.003), look)
    for k in (-1, 0, 1):
        b.add(
            box(0.6 * blade, 0.06 * y, 0.0032).visual_only().at(x / 2 - blade / 2, k * 0.2 * y),
            materials.plain("dark_grey"),
        )
    end = (x / 2 - blade + 0.01, 0, 0.003)
    b.add(tube([end, (0.1 * x, 0, 0.8 * z), (-x / 2 + 0.01, 0, z - 0.012)], 0.008, 8, hulls=2).scaled(y=1.0), look)


def ladle(b: ObjectBuilder, *, flat: bool = False) -> None:
    """A soup ladle: a hollow cup and an upright handle leaning back to -x; a dipper's handle stands straight."""
    x, y, z = b.size
    look = b.pick((materials.metal("silver"), materials.plain("black"), materials.metal("copper")))
    r = y / 2
    deep = 0.6 * r if not flat else 1.1 * r
    cx = x / 2 - r
    b.add(turned_vessel([(0.45 * r, 0), (0.85 * r, 0.45 * deep), (r, deep)], 0.002, 5).at(cx), look)
    path = [
        (cx - r + 0.003, 0, deep - 0.004),
        (cx - 1.15 * r, 0, deep + 0.03),
        (-x / 2 + 0.02, 0, z - 0.015),
        (-x / 2 + 0.002, 0, z - 0.02),
    ]
    b.add(tube(path, 0.005, 7, hulls=2), look)


def tongs(b: ObjectBuilder) -> None:
    """Two sprung arms, slightly open, lying flat."""
    x, y, z = b.size
    steel = materials.metal("silver")
    for s in (-1, 1):
        path = [
            (-x / 2 + z / 2, 0, z / 2),
            (-0.2 * x, s * 0.4 * y, z / 2),
            (0.3 * x, s * 0.45 * y, z / 2),
            (x / 2 - 0.01, s * 0.3 * y, z / 2),
        ]
        arm = tube(path, 0.3 * z, 6, hulls=2)
        b.add(arm, steel)
        b.add(
            soft_box(0.14 * x, 0.2 * y, z).at(0.42 * x, s * 0.36 * y),
            materials.plain(b.pick(("black", "red", "silver"))),
        )


def fork(b: ObjectBuilder) -> None:
    """A long toasting fork with two prongs."""
    x, y, z = b.size
    steel = materials.metal("steel")
    handle = 0.3 * x
    b.add(
        soft_box(handle, 0.6 * y, z, 0.3 * z).at(-x / 2 + handle / 2), materials.wood(b.pick(("walnut", "red")), b.rng)
    )
    b.add(rod((-x / 2 + handle, 0, z / 2), (x / 2 - 0.2 * x, 0, z / 2), 0.003), steel)
    for s in (-1, 1):
        b.add(
            tube([(0.3 * x, 0, z / 2), (0.34 * x, s * 0.4 * y, z / 2), (x / 2, s * 0.4 * y, z / 2)], 0.002, 5, hulls=1),
            steel,
        )


def chopping_board(b: ObjectBuilder) -> None:
    x, y, z = b.size
    look = b.pick(
        (
            materials.wood("oak", b.rng),
            materials.wood("walnut", b.rng),
            materials.plain("white"),
            materials.wood("birch", b.rng),
        )
    )
    b.add(soft_box(x, y, z, 0.4 * z), look)
    b.add(cylinder(0.012, 0.0006, 12).visual_only().at(0, 0.43 * y, z), materials.plain("dark_grey"))


def grater(b: ObjectBuilder) -> None:
    """A four-sided box grater with a bow handle; hollow."""
    x, y, z = b.size
    steel = materials.metal("silver", b.rng)
    top = 0.84 * z
    for axis, a, c in ((0, x, y), (1, y, x)):
        for s in (-1, 1):
            points = []
            for w, h in ((1.0, 0.0), (0.62, top)):
                for inset in (0, 0.0025):
                    for t in (-1, 1):
                        p = [0.0, 0.0, h]
                        p[axis], p[1 - axis] = s * (a / 2 * w - inset), t * c / 2 * w
                        points.append(p)
            b.add(hull(points), steel)
    for i in range(3):
        for j in range(5):
            b.add(
                cylinder(0.003, 0.002, 6)
                .visual_only()
                .turned("y", 76)
                .at(x / 2 * (0.94 - 0.06 * j), (i - 1) * 0.18 * y, 0.16 * z + j * 0.13 * z),
                materials.metal("iron"),
            )
    arch = [
        (0, 0.3 * y * math.cos(a), top + (z - top - 0.005) * math.sin(a)) for a in (k * math.pi / 6 for k in range(7))
    ]
    b.add(tube(arch, 0.006, 6, hulls=1), materials.plain(b.pick(("black", "red"))))


def colander(b: ObjectBuilder) -> None:
    """A bowl with holes, two ears and a foot."""
    x, y, z = b.size
    r = y / 2
    look = b.pick(
        (materials.metal("silver", b.rng), materials.plain("red", "metal", 0.6), materials.plain("white", "metal", 0.6))
    )
    b.add(turned_vessel([(0.45 * r, 0), (0.85 * r, 0.45 * z), (r, z)], 0.003, 6), look)
    for ring_, h in ((0.72, 0.32), (0.84, 0.5), (0.93, 0.7)):
        for k in range(12):
            a = 2 * math.pi * k / 12
            b.add(
                cylinder(0.005, 0.002, 6)
                .visual_only()
                .turned("y", 70)
                .turned("z", math.degrees(a))
                .at(ring_ * r * math.cos(a), ring_ * r * math.sin(a), h * z),
                materials.plain("black"),
            )
    for s in (-1, 1):
        ear = [
            (s * 0.97 * r, -0.2 * r, 0.93 * z),
            (s * (x / 2 - 0.005), -0.12 * r, 0.93 * z),
            (s * (x / 2 - 0.005), 0.12 * r, 0.93 * z),
            (s * 0.97 * r, 0.2 * r, 0.93 * z),
        ]
        b.add(tube(ear, 0.004, 6, hulls=0), look)
    # One collision plate through both ears would close the bowl; only the ear at +x collides.
    b.add(block((x / 2 - 0.95 * r, 0.3 * r, 0.008), (x / 4 + 0.475 * r, 0, 0.93 * z)).collision_only(), look)


def griddle(b: ObjectBuilder) -> None:
    """A flat cast plate with ridges, a rim and two ears."""
    x, y, z = b.size
    iron = materials.metal("iron")
    b.add(box(x, 0.86 * y, 0.5 * z), iron)
    for s in (-1, 1):
        b.add(block((x, 0.02, z), (0, s * (0.43 * y - 0.01), z / 2)), iron)
        b.add(block((0.014, 0.86 * y, z), (s * (x / 2 - 0.007), 0, z / 2)), iron)
        b.add(block((0.4 * x, 0.07 * y, 0.4 * z), (0, s * 0.465 * y, 0.7 * z)), iron)
    for k in range(8):
        b.add(
            box(0.92 * x, 0.012, 0.003).visual_only().at(0, (k - 3.5) * 0.09 * y, 0.5 * z), materials.metal("dark_grey")
        )
    b.point("toggle_button", (x / 2, 0.3 * y, 0.5 * z))


def lid(b: ObjectBuilder) -> None:
    """A pot's lid with a knob."""
    x, _, z = b.size
    r = x / 2
    look = b.pick((materials.metal("silver", b.rng), materials.glass("glass", 0.5), materials.metal("iron")))
    b.add(lathe([(r, 0), (r, 0.1 * z), (0.7 * r, 0.45 * z), (0.15 * r, 0.6 * z)], 24), look)
    b.add(lathe([(0.08 * r, 0.6 * z), (0.16 * r, 0.85 * z), (0.1 * r, z)], 12), materials.plain("black"))


def pocketknife(b: ObjectBuilder) -> None:
    """An opened pocket knife lying on its side, edge towards -y; the slicer box is its edge."""
    x, y, z = b.size
    steel = materials.metal("silver")
    handle = 0.56 * x
    start = -x / 2 + handle
    b.add(
        soft_box(handle, 0.8 * y, z, 0.4 * z).at(-x / 2 + handle / 2, 0.05 * y),
        b.pick((materials.plain("red"), materials.wood("walnut", b.rng), materials.plain("black"))),
    )
    low, thick = z / 2 - 0.001, 0.002
    edge, spine = -0.45 * y, 0.3 * y
    rim = 0.2 * (spine - edge)
    b.add(
        prism(
            [
                (start - 0.004, edge),
                (x / 2 - 0.02, edge),
                (x / 2, spine - 0.4 * (spine - edge)),
                (x / 2 - 0.01, spine),
                (start - 0.004, spine),
            ],
            thick,
        )
        .visual_only()
        .at(z=low),
        steel,
    )
    b.add(
        prism(
            [
                (start - 0.004, edge + rim),
                (x / 2 - 0.01, edge + rim),
                (x / 2, spine - 0.4 * (spine - edge)),
                (x / 2 - 0.01, spine),
                (start - 0.004, spine),
            ],
            thick,
        )
        .collision_only()
        .at(z=low),
        steel,
    )
    b.area("slicer", (0.7 * (x - handle), rim, thick), (start + 0.38 * (x - handle), edge + rim / 2, z / 2))


CATEGORIES = [
    Entry("spatula", spatula, (0.340, 0.085, 0.055), 0.12, 4),
    Entry("soup_ladle", ladle, (0.240, 0.095, 0.200), 0.17, 4, uniform=True),
    Entry("dipper", ladle, (0.210, 0.110, 0.200), 0.20, 3, uniform=True, options={"flat": True}),
    Entry("tongs", tongs, (0.280, 0.070, 0.026), 0.13, 3),
    Entry("toasting_fork", fork, (0.480, 0.032, 0.018), 0.12, 2),
    Entry("chopping_board", chopping_board, (0.260, 0.380, 0.020), 1.1, 4),
    Entry("grater", grater, (0.090, 0.110, 0.240), 0.26, 3, rest="upright"),
    Entry("colander", colander, (0.320, 0.260, 0.120), 0.50, 3, rest="upright", uniform=True),
    Entry("griddle", griddle, (0.270, 0.480, 0.030), 3.0, 3, rest="upright"),
    Entry("lid", lid, (0.220, 0.220, 0.060), 0.40, 3, rest="upright", uniform=True),
    Entry("pocketknife", pocketknife, (0.190, 0.026, 0.016), 0.08, 3),
]
