"""Brooms, brushes, vacuum cleaners, scrapers: tools with a cleaning_tool_area, and their relatives."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import ball, block, box, cylinder, hull, lathe, prism, rod, soft_box, tube
from ..shapes.vessels import ring
from .entry import Entry
from .model import ObjectBuilder


def broom(b: ObjectBuilder) -> None:
    """A broom lying along x, bristles towards +x; the bristles clean."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("pine", "birch", "red", "blue")), b.rng)
    bristle = materials.skin(b.pick(((0.80, 0.66, 0.36), "green", "dark_grey")), b.rng, 0.4, 0.05)
    brush = 0.16 * x
    b.add(rod((-x / 2, 0, z / 2), (x / 2 - brush, 0, z / 2), 0.012), wood)
    b.add(
        hull(
            [(x / 2 - brush - 0.04, s * 0.1 * y, z / 2 + h * 0.2 * z) for s in (-1, 1) for h in (-1, 1)]
            + [(x / 2 - brush, s * 0.42 * y, z / 2 + h * z / 2) for s in (-1, 1) for h in (-1, 1)]
        ),
        wood,
    )
    b.add(
        hull(
            [(x / 2 - brush, s * 0.4 * y, z / 2 + h * 0.45 * z) for s in (-1, 1) for h in (-1, 1)]
            + [(x / 2 - 0.02, s * y / 2, z / 2 + h * z / 2) for s in (-1, 1) for h in (-1, 1)]
        ),
        bristle,
    )
    b.area("cleaning_tool_area", (0.05, y, z), (x / 2 - 0.025, 0, z / 2))


def hand_brush(
    b: ObjectBuilder, *, bristles: str = "cream", cleans: bool = True, long: bool = False, round_: bool = False
) -> None:
    """A brush lying with its bristles down: block or handle along x, bristle field underneath at the front."""
    x, y, z = b.size
    body = b.pick(
        (materials.wood("pine", b.rng), materials.plain("blue"), materials.plain("red"), materials.plain("green"))
    )
    hair = materials.skin(bristles, b.rng, 0.4, 0.01)
    field = 0.34 * x if long else 0.94 * x
    back = 0.45 * z
    front = x / 2
    if long:
        b.add(soft_box(x - field, 0.45 * y if not round_ else 0.4 * y, back).at(-field / 2, 0, z - back), body)
        b.add(soft_box(field + 0.01, y, back).at(front - field / 2, 0, z - back), body)
    else:
        b.add(soft_box(x, y, back, 0.3 * back).at(z=z - back), body)
    px = front - 0.5 * field - (0.0 if long else 0.03 * x)
    b.add(box(field * 0.96, 0.86 * y, z - back).at(px), hair)
    if cleans:
        b.area("cleaning_tool_area", (field * 0.96, 0.86 * y, 0.3 * (z - back)), (px, 0, 0.15 * (z - back)))


def paintbrush(b: ObjectBuilder) -> None:
    """A flat paintbrush lying along x."""
    x, y, z = b.size
    b.add(
        hull(
            [(-x / 2, s * 0.16 * y, z / 2 + h * 0.3 * z) for s in (-1, 1) for h in (-1, 1)]
            + [(0.1 * x, s * 0.4 * y, z / 2 + h * 0.45 * z) for s in (-1, 1) for h in (-1, 1)]
        ),
        materials.wood(b.pick(("pine", "red", "navy")), b.rng),
    )
    b.add(block((0.12 * x, y, z), (0.15 * x, 0, z / 2)), materials.metal("silver"))
    b.add(
        hull(
            [(0.2 * x, s * 0.48 * y, z / 2 + h * 0.45 * z) for s in (-1, 1) for h in (-1, 1)]
            + [(x / 2, s * 0.42 * y, z / 2 + h * 0.1 * z) for s in (-1, 1) for h in (-1, 1)]
        ),
        materials.skin("tan", b.rng, 0.4, 0.01),
    )


def vacuum(b: ObjectBuilder) -> None:
    """An upright vacuum cleaner: nozzle on the floor, bag, handle; the nozzle's underside cleans."""
    x, y, z = b.size
    body = materials.plain(b.pick(("red", "blue", "dark_grey", "purple")), "plastic", 0.6)
    dark = materials.plain("black")
    foot = 0.10
    b.add(soft_box(x * 0.9, y, foot - 0.012, 0.03).at(0.05 * x, 0, 0.012), body)
    b.add(box(0.8 * x, 0.96 * y, 0.012).at(0.07 * x), dark)
    lean = 0.12 * x
    b.add(
        hull(
            [
                (px - 0.2 * x, s * 0.28 * y, pz)
                for px, pz in ((0, foot * 0.7), (0.5 * x, foot * 0.7), (-lean, 0.62 * z), (0.24 * x - lean, 0.62 * z))
                for s in (-1, 1)
            ]
        ),
        body,
    )
    b.add(cylinder(0.2 * y, 0.3 * z, 14).visual_only().at(0.16 * x, 0, foot), materials.glass("sky", 0.5))
    top = (-0.2 * x - lean - 0.02, 0, z - 0.1)
    b.add(rod((-0.15 * x - lean, 0, 0.6 * z), top, 0.014), dark)
    b.add(
        tube(
            [top, (top[0] - 0.01, 0, z - 0.02), (top[0] + 0.06, 0, z - 0.012), (top[0] + 0.1, 0, z - 0.05)],
            0.014,
            8,
            hulls=1,
        ),
        dark,
    )
    b.add(cylinder(0.018, 0.006, 12).visual_only().turned("y", 90).at(0.05 * x, 0, 0.55 * z), materials.plain("red"))
    b.point("toggle_button", (0.06 * x, 0, 0.55 * z))
    b.area("cleaning_tool_area", (0.8 * x, 0.96 * y, 0.012), (0.07 * x, 0, 0.006))


def sweeper(b: ObjectBuilder) -> None:
    """A carpet sweeper: a flat box on rollers with a long handle."""
    x, y, z = b.size
    look = materials.plain(b.pick(("dark_green", "red", "grey")))
    deep = min(0.24, x)
    b.add(soft_box(deep, y, 0.08, 0.02).at(x / 2 - deep / 2, 0, 0.012), look)
    b.add(box(0.8 * deep, 0.96 * y, 0.014).at(x / 2 - deep / 2), materials.plain("black"))
    b.add(rod((x / 2 - deep / 2, 0, 0.08), (-x / 2 + 0.02, 0, z), 0.013), materials.metal("steel"))
    b.area("cleaning_tool_area", (0.8 * deep, 0.96 * y, 0.012), (x / 2 - deep / 2, 0, 0.006))


def scraper(b: ObjectBuilder) -> None:
    """A putty knife: a wide thin blade and a handle; the blade's edge cleans."""
    x, y, z = b.size
    blade = 0.5 * x
    b.add(
        hull(
            [(x / 2 - 0.02, s * y / 2, 0.45 * z + h) for s in (-1, 1) for h in (0, 0.0015)]
            + [(x / 2 - blade, s * 0.18 * y, 0.45 * z + h) for s in (-1, 1) for h in (0, 0.004)]
        ),
        materials.metal("steel"),
    )
    b.add(
        soft_box(x - blade + 0.01, 0.3 * y, z, 0.35 * z).at(-blade / 2 - 0.005),
        b.pick((materials.wood("cherry", b.rng), materials.plain("red"), materials.plain("black"))),
    )
    b.area("cleaning_tool_area", (0.02, y, 0.003), (x / 2 - 0.01, 0, 0.45 * z + 0.001))


def eraser(b: ObjectBuilder) -> None:
    """A rubber in a sleeve; its bare end cleans."""
    x, y, z = b.size
    b.add(box(0.82 * x, y, z).at(-0.09 * x), materials.plain("white", "rubber"))
    b.add(
        box(0.55 * x, y * 1.01, z * 1.01).visual_only().at(-0.2 * x, 0, -0.005 * z),
        materials.plain(b.pick(("blue", "red", "green")), "paper"),
    )
    b.add(box(0.18 * x, y, z).at(0.41 * x).visual_only(), materials.plain("white", "rubber"))
    b.area("cleaning_tool_area", (0.18 * x, y, z), (0.41 * x, 0, z / 2))


def roller(b: ObjectBuilder) -> None:
    """A lint or paint roller lying flat: a cylinder across and a bent handle."""
    x, y, z = b.size
    r = z / 2
    b.add(
        cylinder(r, y, 16).at(z=-y / 2).turned("x", 90).at(x / 2 - r, 0, r),
        materials.plain(b.pick(("white", "cream", "yellow")), "fabric"),
    )
    path = [
        (x / 2 - r, y / 2, r),
        (x / 2 - r, y / 2 + 0.008, r),
        (x / 2 - 2.6 * r, y / 2 + 0.006, r),
        (0.05 * x, 0.1 * y, r),
        (0, 0, r),
    ]
    b.add(tube(path, 0.003, 6, hulls=1), materials.metal("steel"))
    b.add(soft_box(0.5 * x, 0.028, 0.028).at(-x / 4, 0, r - 0.014), materials.plain(b.pick(("red", "blue", "black"))))


def rake(b: ObjectBuilder) -> None:
    x, y, z = b.size
    wood = materials.wood("pine", b.rng)
    iron = materials.metal(b.pick(("iron", "dark_green")))
    b.add(rod((-x / 2, 0, z - 0.014), (x / 2 - 0.02, 0, z - 0.014), 0.013), wood)
    b.add(block((0.016, y, 0.016), (x / 2 - 0.01, 0, z - 0.014)), iron)
    for k in range(10):
        yy = (k - 4.5) * y / 9.4
        b.add(rod((x / 2 - 0.01, yy, z - 0.014), (x / 2, yy, 0), 0.004, 5).visual_only(), iron)
    b.add(block((0.012, y, z - 0.02), (x / 2 - 0.006, 0, (z - 0.02) / 2)).collision_only(), iron)


def hose(b: ObjectBuilder) -> None:
    """A coiled garden hose; collides as a ring of wedges."""
    x, _, z = b.size
    green = materials.plain(b.pick(("green", "dark_green", "yellow")), "rubber", 0.5)
    r = x / 2
    thick = z / 3
    for k in range(3):
        for inner in range(2):
            radius = r - thick / 2 - inner * thick
            path = [
                (radius * math.cos(a), radius * math.sin(a), thick * (k + 0.5))
                for a in (j * math.pi / 9 for j in range(18))
            ]
            b.add(tube(path, thick / 2, 6, hulls=0, closed=True), green)
    b.add(ring(r, r, 0, z, 2 * thick, 7), green)
    b.add(cylinder(0.5 * thick, 0.05, 10).visual_only().turned("y", 90).at(r - 0.04, 0, z), materials.metal("brass"))


def mousetrap(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(box(x, y, 0.4 * z), materials.wood("pine", b.rng))
    steel = materials.metal("steel")
    path = [(0, -0.4 * y, 0.5 * z), (0.4 * x, -0.4 * y, 0.6 * z), (0.4 * x, 0.4 * y, 0.6 * z), (0, 0.4 * y, 0.5 * z)]
    b.add(tube(path, 0.0018, 5, hulls=0), steel)
    b.add(cylinder(0.3 * z, 0.8 * y, 8).at(z=-0.4 * y).turned("x", 90).at(0, 0, 0.7 * z), steel)
    b.add(box(0.2 * x, 0.3 * y, 0.15 * z).visual_only().at(-0.25 * x, 0, 0.45 * z), materials.plain("yellow", "metal"))
    b.point("toggle_button", (-0.25 * x, 0, 0.6 * z))


def comb(b: ObjectBuilder) -> None:
    x, y, z = b.size
    look = materials.plain(b.pick(("black", "brown", "pink")))
    b.add(block((x, 0.35 * y, z), (0, 0.325 * y, z / 2)), look)
    for k in range(18):
        px = (k - 8.5) * x / 18.4
        b.add(block((0.3 * x / 18, 0.66 * y, 0.7 * z), (px, -0.17 * y, z / 2)).visual_only(), look)
    b.add(block((x, 0.65 * y, 0.7 * z), (0, -0.175 * y, z / 2)).collision_only(), look)


def razor(b: ObjectBuilder) -> None:
    x, y, z = b.size
    look = materials.plain(b.pick(("blue", "pink", "black")))
    b.add(
        hull(
            [(-x / 2, s * 0.11 * y, 0.35 * z + h * 0.25 * z) for s in (-1, 1) for h in (-1, 1)]
            + [(0.42 * x, s * 0.13 * y, 0.6 * z + h * 0.2 * z) for s in (-1, 1) for h in (-1, 1)]
        ),
        look,
    )
    b.add(box(0.14 * x, y, 0.5 * z).at(x / 2 - 0.07 * x, 0, 0.4 * z), materials.metal("silver"))


def toothbrush(b: ObjectBuilder) -> None:
    """A toothbrush lying on its back with the bristles up; the bristles clean."""
    x, y, z = b.size
    look = materials.plain(b.pick(("blue", "red", "green", "purple", "orange")))
    low = 0.4 * z
    b.add(
        hull(
            [(-x / 2, s * 0.35 * y, h) for s in (-1, 1) for h in (0, low)]
            + [(0.2 * x, s * 0.2 * y, h) for s in (-1, 1) for h in (0, low)]
        ),
        look,
    )
    b.add(
        hull(
            [(0.2 * x, s * 0.2 * y, h) for s in (-1, 1) for h in (0, low)]
            + [(px, s * y / 2, h) for px in (0.36 * x, x / 2) for s in (-1, 1) for h in (0, low)]
        ),
        look,
    )
    b.add(box(0.15 * x, 0.85 * y, z - low).visual_only().at(0.415 * x, 0, low), materials.plain("white"))
    b.area("cleaning_tool_area", (0.15 * x, 0.85 * y, z - low), (0.415 * x, 0, (z + low) / 2))


def hairbrush(b: ObjectBuilder) -> None:
    x, y, z = b.size
    look = materials.wood("cherry", b.rng) if b.pick((True, False)) else materials.plain("black")
    pad = 0.5 * x
    b.add(ball(pad, y, 0.6 * z, 14).at(x / 2 - pad / 2, 0, 0), look)
    b.add(
        lathe([(0.2 * y, 0), (0.17 * y, 0.7 * (x - pad)), (0.24 * y, x - pad)], 10)
        .turned("y", -90)
        .at(x / 2 - pad + 0.02, 0, 0.3 * z)
        .at(0, 0, 0),
        look,
    )
    for i in range(5):
        for j in range(3):
            b.add(
                rod(
                    (x / 2 - pad * 0.8 + i * pad * 0.15, (j - 1) * 0.22 * y, 0.45 * z),
                    (x / 2 - pad * 0.8 + i * pad * 0.15, (j - 1) * 0.22 * y, z),
                    0.0012,
                    4,
                ).visual_only(),
                materials.plain("black"),
            )
    b.add(box(0.7 * pad, 0.6 * y, 0.5 * z).collision_only().at(x / 2 - pad / 2, 0, 0.5 * z), look)


def dental_floss(b: ObjectBuilder) -> None:
    x, y, z = b.size
    look = materials.plain(b.pick(("white", "sky", "mint")), shine=0.6)
    outline = [(-x / 2, -y / 2), (x / 2, -0.3 * y), (x / 2, 0.3 * y), (0.2 * x, y / 2), (-x / 2, y / 2)]
    b.add(prism(outline, z), look)
    b.add(prism([(0.7 * u, 0.7 * v) for u, v in outline], z * 1.01).visual_only(), materials.plain("blue"))


CATEGORIES = [
    Entry("broom", broom, (1.350, 0.300, 0.050), 0.80, 4, rest="any"),
    Entry("scrub_brush", hand_brush, (0.170, 0.065, 0.060), 0.16, 4, rest="upright"),
    Entry("toothbrush", toothbrush, (0.185, 0.014, 0.017), 0.018, 4),
    Entry("hairbrush", hairbrush, (0.230, 0.070, 0.040), 0.12, 3),
    Entry("paintbrush", paintbrush, (0.230, 0.060, 0.020), 0.08, 3),
    Entry("vacuum", vacuum, (0.320, 0.300, 1.100), 6.0, 4, rest="upright", vary=0.05, two_hands=True),
    Entry("carpet_sweeper", sweeper, (0.600, 0.300, 1.050), 2.0, 3, rest="upright", vary=0.05),
    Entry("scraper", scraper, (0.220, 0.080, 0.026), 0.12, 3),
    Entry("eraser", eraser, (0.055, 0.022, 0.013), 0.018, 3),
    Entry("roller", roller, (0.240, 0.110, 0.055), 0.15, 3),
    Entry("rake", rake, (1.450, 0.380, 0.080), 1.3, 3),
    Entry("hose", hose, (0.450, 0.450, 0.080), 2.5, 3, uniform=True),
    Entry("mousetrap", mousetrap, (0.100, 0.048, 0.016), 0.025, 3, rest="upright"),
    Entry("comb", comb, (0.180, 0.035, 0.004), 0.020, 3),
    Entry("razor", razor, (0.140, 0.042, 0.022), 0.020, 3),
    Entry("dental_floss", dental_floss, (0.060, 0.050, 0.015), 0.025, 2),
]
