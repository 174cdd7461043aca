"""Bathtub, toilet, shower, pool."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import Solid, block, box, cylinder, decal, hull, join, lathe, prism, rod, sleeve, soft_box, tube
from ..shapes.vessels import tray, turned_vessel
from .entry import Entry
from .model import ObjectBuilder
from .parts import lid
from .sinks import tap

WHITE = materials.plain("porcelain", "ceramic", 0.8)


def bathtub(b: ObjectBuilder) -> None:
    """A tub along x with a wide rim, apron, and a tap at -x."""
    x, y, z = b.size
    top = z - 0.12
    wall = 0.07
    b.add(tray(x, y, top, wall, 0.09), WHITE)
    for s in (-1, 1):
        b.add(soft_box(x + 0.01, wall + 0.015, 0.03, 0.01).visual_only().at(0, s * (y - wall) / 2, top - 0.022), WHITE)
        b.add(soft_box(wall + 0.015, y - wall, 0.03, 0.01).visual_only().at(s * (x - wall) / 2, 0, top - 0.022), WHITE)
    if b.pick((True, False)):
        tiles = materials.picture(
            "tiles",
            textures.tiles(materials.tint(b.pick(("sky", "mint", "cream")), b.rng), (0.8, 0.8, 0.8)),
            0.4,
            "tile",
        )
        for s in (-1, 1):
            b.add(block((x, 0.004, top - 0.05), (0, s * (y / 2 + 0.002), (top - 0.05) / 2)).visual_only(), tiles)
    chrome = materials.metal("chrome")
    b.add(tap(0.12, 0.16).at(-x / 2 + 0.035, 0, top), chrome)
    b.add(cylinder(0.02, 0.04, 10).visual_only().at(-x / 2 + 0.035, 0.1, top), chrome)
    b.point("water_sink", (-0.3 * x, 0, 0.09))
    b.add(cylinder(0.03, 0.003, 12).visual_only().at(-0.3 * x, 0, 0.09), materials.metal("iron"))


def toilet(b: ObjectBuilder) -> None:
    """Bowl on a foot, cistern with a push button, seat ring and a lid that turns up."""
    x, y, z = b.size
    seat = 0.40
    tank = 0.2
    bowl_x = x - tank
    cx = -x / 2 + tank + bowl_x / 2
    outline = [(0.5 * bowl_x * math.cos(a), 0.5 * 0.95 * y * math.sin(a)) for a in (k * math.pi / 8 for k in range(16))]
    foot = [(0.7 * px - 0.06, 0.55 * py) for px, py in outline]
    b.add(prism(foot, 0.22).at(cx), WHITE)
    # The bowl: eight wedges around a hollow, over a floor.
    inner = [(0.62 * px, 0.62 * py) for px, py in outline]
    b.add(prism([(0.8 * px - 0.03, 0.8 * py) for px, py in outline], 0.04).at(cx, 0, 0.2), WHITE)
    b.add(_bowl(outline, inner, 0.2, seat).at(cx), WHITE)
    b.add(box(0.12, 0.6 * y, seat - 0.02).at(-x / 2 + tank - 0.02), WHITE)
    b.add(soft_box(tank, y, z - seat, 0.03).at(-x / 2 + tank / 2, 0, seat), WHITE)
    b.add(soft_box(tank + 0.012, y + 0.01, 0.03, 0.01).visual_only().at(-x / 2 + tank / 2, 0, z - 0.02), WHITE)
    b.add(cylinder(0.025, 0.006, 14).visual_only().at(-x / 2 + tank / 2, 0, z + 0.008), materials.metal("chrome"))
    # The lid ends before the cistern, so that it has room there when it stands up.
    rear = 0.036 - bowl_x / 2
    ring_outline = [(max(px * 0.99, rear), py * 0.97) for px, py in outline]
    cover = prism(ring_outline, 0.02).at(cx, 0, seat + 0.004)
    lid(
        b,
        "lid",
        cover,
        b.pick((WHITE, materials.wood("oak", b.rng), materials.plain("black"))),
        cx + rear,
        seat + 0.004,
        angle=1.6,
        openable=False,
    )


def _bowl(outline, inner, low: float, high: float) -> Solid:
    """A hollow cup between two outlines, narrower below; visual and collision in ten wedges."""
    parts = []
    count = len(outline)
    for k in range(0, count, 2):
        points = []
        for i in (k, k + 1, (k + 2) % count):
            (ox, oy), (ix, iy) = outline[i], inner[i]
            points += [
                (ox, oy, high),
                (ix, iy, high),
                (0.75 * ox - 0.04, 0.75 * oy, low),
                (0.7 * ix - 0.03, 0.7 * iy, low),
            ]
        parts.append(hull(points))
    return join(parts)


def shower(b: ObjectBuilder) -> None:
    """A shower tray with two glass walls, a mixer and a shower head on a pole."""
    x, y, z = b.size
    b.add(tray(x, y, 0.09, 0.05, 0.05), WHITE)
    glass = materials.glass("sky", 0.25)
    chrome = materials.metal("chrome")
    b.add(block((0.01, y - 0.04, z - 0.09), (x / 2 - 0.025, 0, (z + 0.09) / 2)), glass)
    b.add(block((x - 0.06, 0.01, z - 0.09), (0, -y / 2 + 0.025, (z + 0.09) / 2)), glass)
    for px, py in ((x / 2 - 0.025, y / 2 - 0.02), (x / 2 - 0.025, -y / 2 + 0.025), (-x / 2 + 0.025, -y / 2 + 0.025)):
        b.add(rod((px, py, 0.09), (px, py, z), 0.012, 8).visual_only(), chrome)
    wall_x = -x / 2 + 0.03
    b.add(rod((wall_x, 0.1, 0.9), (wall_x, 0.1, z - 0.05), 0.01), chrome)
    b.add(
        tube(
            [(wall_x, 0.1, z - 0.08), (wall_x + 0.05, 0.1, z - 0.02), (wall_x + 0.22, 0.1, z - 0.06)], 0.01, 8, hulls=1
        ),
        chrome,
    )
    b.add(lathe([(0.09, 0), (0.08, 0.012), (0.02, 0.03)], 16).at(wall_x + 0.24, 0.1, z - 0.1), chrome)
    b.add(soft_box(0.05, 0.2, 0.05, 0.015).at(wall_x, 0.1, 1.05), chrome)
    b.point("water_sink", (0, 0, 0.05))
    b.add(cylinder(0.04, 0.003, 12).visual_only().at(0, 0, 0.05), materials.metal("iron"))


def pool(b: ObjectBuilder) -> None:
    """A round paddling pool: a ring wall and a floor, hollow."""
    x, _, z = b.size
    r = x / 2
    look = materials.plain(b.pick(("blue", "teal", "sky")), "plastic", 0.5)
    b.add(turned_vessel([(0.97 * r, 0), (r, 0.4 * z), (r, z)], 0.07, 10, 28, floor=0.02), look)
    b.add(cylinder(0.9 * r, 0.002, 28).visual_only().at(z=0.021), materials.plain("sky"))
    stripe = sleeve([(1.005 * r, 0.62 * z), (1.005 * r, 0.78 * z)], 28)
    b.add(stripe, materials.plain("white"))


def mirror(b: ObjectBuilder) -> None:
    """A framed wall mirror; its back is at -x."""
    x, y, z = b.size
    wood = b.pick((materials.wood("walnut", b.rng), materials.metal("gold"), materials.plain("white", "wood")))
    b.add(box(x, y, z), wood)
    b.add(
        decal(0.9 * y, 0.93 * z).at(x / 2 + 0.001, 0, z / 2),
        materials.Material("mirror", (0.78, 0.86, 0.90), kind="mirror", shine=1.0),
    )


CATEGORIES = [
    Entry("bathtub", bathtub, (1.650, 0.750, 0.680), 75.0, 6, fixed=True, rest="upright", vary=0.06),
    Entry("toilet", toilet, (0.660, 0.380, 0.780), 32.0, 6, fixed=True, rest="upright", vary=0.04),
    Entry("shower", shower, (0.900, 0.900, 2.050), 60.0, 5, fixed=True, rest="upright", vary=0.06),
    Entry("pool", pool, (1.800, 1.800, 0.450), 18.0, 3, fixed=True, rest="upright", uniform=True),
    Entry("mirror", mirror, (0.025, 0.600, 0.900), 8.0, 4, fixed=True, rest="upright", vary=0.15),
]
