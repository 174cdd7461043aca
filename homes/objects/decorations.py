"""Lamps, candles, pictures, plants, clocks, Christmas objects, fixtures of a wall."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import (
    Solid,
    ball,
    block,
    box,
    cylinder,
    decal,
    extrusion,
    hull,
    lathe,
    rod,
    sleeve,
    soft_box,
    tube,
)
from ..shapes.vessels import ring
from .entry import Entry
from .model import ObjectBuilder
from .wrappings import loops


def framed(b: ObjectBuilder) -> None:
    """A painting or framed photograph for a wall (its back at -x)."""
    x, y, z = b.size
    wood = b.pick(
        (
            materials.metal("gold"),
            materials.wood("walnut", b.rng),
            materials.plain("black", "wood"),
            materials.wood("oak", b.rng),
        )
    )
    if b.pick((False, False, True)):
        y, z = z * 0.9, y * 1.1
    b.add(box(x, y, z), wood)
    b.add(box(0.5 * x, 0.88 * y, 0.88 * z).visual_only().at(0.26 * x, 0, 0.06 * z), materials.plain("paper", "paper"))
    b.add(
        decal(0.78 * y, 0.78 * z).at(x / 2 + 0.0012, 0, z / 2),
        materials.picture("canvas", textures.painting(b.rng), kind="picture"),
    )


def board(b: ObjectBuilder, *, kind: str) -> None:
    """A whiteboard or a cork board with notes; its back is at -x."""
    x, y, z = b.size
    b.add(box(x, y, z), materials.metal("silver") if kind == "white" else materials.wood("oak", b.rng))
    if kind == "white":
        b.point("toggle_button", (x / 2, 0.45 * y, 0.05 * z))
        b.add(block((0.001, 0.96 * y, 0.94 * z), (x / 2, 0, z / 2)).visual_only(), materials.plain("white", shine=0.8))
        b.add(box(0.05, 0.4 * y, 0.012).visual_only().at(x / 2 + 0.02, 0, 0.0), materials.metal("silver"))
    else:
        cork = materials.picture("cork", textures.speckle((0.76, 0.58, 0.38), b.rng, 0.3), 0.15, "wood")
        b.add(block((0.001, 0.94 * y, 0.92 * z), (x / 2, 0, z / 2)).visual_only(), cork)
        for k in range(5):
            note = materials.picture(
                f"note_{k}",
                textures.paper(b.rng, 6, materials.colour(b.rng.choice(("yellow", "paper", "sky", "pink")))),
            )
            b.add(
                decal(0.13, 0.13)
                .turned("x", b.rng.uniform(-8, 8))
                .at(x / 2 + 0.001, (k - 2) * 0.18 * y, z * b.rng.uniform(0.3, 0.7)),
                note,
            )


def wall_clock(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = z / 2
    b.add(
        cylinder(r, x, 24).turned("y", 90).at(-x / 2, 0, r),
        b.pick((materials.plain("black"), materials.wood("oak", b.rng), materials.metal("brass"))),
    )
    b.add(decal(1.4 * r, 1.4 * r).at(x / 2 + 0.001, 0, r), materials.picture("dial", textures.dial()))
    b.add(sleeve([(r, 0), (0.93 * r, 0.006)], 24).turned("y", 90).at(x / 2, 0, r), materials.metal("silver"))
    b.point("toggle_button", (x / 2, 0, 0.05 * z))


def grandfather_clock(b: ObjectBuilder) -> None:
    """A long-case clock: plinth, waist with a pendulum behind glass, hood with a dial."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("walnut", "cherry", "oak")), b.rng)
    b.add(box(x, y, 0.2 * z), wood)
    b.add(box(0.8 * x, 0.76 * y, 0.55 * z).at(0, 0, 0.2 * z), wood)
    b.add(box(x, y, 0.2 * z).at(0, 0, 0.75 * z), wood)
    b.add(
        hull(
            [(sx * x / 2, sy * y / 2, 0.95 * z) for sx in (-1, 1) for sy in (-1, 1)]
            + [(sx * x / 2, 0, z) for sx in (-1, 1)]
        ),
        wood,
    )
    b.add(
        decal(0.7 * y, 0.7 * y).at(x / 2 + 0.001, 0, 0.85 * z),
        materials.picture("dial", textures.dial((0.93, 0.88, 0.72))),
    )
    b.add(
        block((0.002, 0.5 * y, 0.45 * z), (0.4 * x, 0, 0.47 * z)).visual_only(), materials.plain("black", "glass", 0.9)
    )
    b.add(
        cylinder(0.12 * y, 0.006, 16).visual_only().turned("y", 90).at(0.4 * x, 0, 0.34 * z), materials.metal("brass")
    )
    b.add(block((0.004, 0.012, 0.25 * z), (0.402 * x, 0, 0.48 * z)).visual_only(), materials.metal("brass"))


def pot_plant(b: ObjectBuilder) -> None:
    """A plant in a pot: broad leaves, a bush, a palm or a cactus; collides as pot and crown."""
    x, _, z = b.size
    plan = b.pick(("leaves", "bush", "palm", "cactus"))
    r = 0.42 * x
    pot = b.pick(
        (
            materials.plain("terracotta", "ceramic"),
            materials.plain("white", "ceramic", 0.6),
            materials.plain("dark_grey", "ceramic"),
            materials.plain("teal", "ceramic", 0.6),
        )
    )
    high = 0.34 * z
    b.add(lathe([(0.68 * r, 0), (0.95 * r, 0.85 * high), (r, 0.86 * high), (r, high)], 20), pot)
    b.add(cylinder(0.92 * r, 0.002, 16).visual_only().at(z=high), materials.plain("soil", "organic"))
    green = [materials.plain(materials.tint("leaf", b.rng, 0.2), "organic") for _ in range(2)]
    if plan == "cactus":
        b.add(lathe([(0.4 * r, high - 0.01), (0.5 * r, 0.6 * z), (0.42 * r, 0.92 * z), (0.1 * r, z)], 14), green[0])
        for s in (-1, 1):
            b.add(
                tube(
                    [(0, s * 0.4 * r, 0.55 * z), (0, s * 0.85 * r, 0.58 * z), (0, s * 0.9 * r, 0.75 * z)],
                    0.13 * r,
                    8,
                    hulls=0,
                ),
                green[0],
            )
        return
    if plan == "bush":
        for k in range(9):
            a = 2.4 * k
            size = 0.5 * x
            spread = 0.28 * x * math.sqrt(k / 9)
            up = high + (z - high - size) * (k % 5) / 4
            b.add(
                ball(size, size, size, 8)
                .visual_only()
                .at(spread * math.cos(a), spread * math.sin(a), max(high - 0.05 * z, up)),
                green[k % 2],
            )
    else:
        count = 12 if plan == "leaves" else 9
        for k in range(count):
            a = 2 * math.pi * k / count + b.rng.uniform(-0.2, 0.2)
            rise = b.rng.uniform(0.55, 1.0) if plan == "leaves" else 1.0
            w = (0.16 if plan == "leaves" else 0.06) * x
            reach = 0.49 * x * (1.05 - 0.4 * rise if plan == "leaves" else 1.0)
            top = high + rise * (z - high)
            tip = high + (0.8 if plan == "leaves" else 0.55) * rise * (z - high)
            leaf = [
                (0.02 * x, 0, high),
                (0.6 * reach, w / 2, top),
                (0.6 * reach, -w / 2, top),
                (0.55 * reach, 0, top - 0.03 * z),
                (reach, 0, tip),
            ]
            b.add(hull(leaf).visual_only().turned("z", math.degrees(a)), green[k % 2])
    crown = lathe([(0.2 * x, high), (0.5 * x, high + 0.5 * (z - high)), (0.25 * x, z)], 8).collision_only()
    b.add(crown, green[0])


def christmas_tree(b: ObjectBuilder, *, decorated: bool = False) -> None:
    """A fir: trunk in a stand and tiers of cones, perhaps with balls, a star and candles of light."""
    x, _, z = b.size
    r = x / 2
    needles = materials.skin((0.10, 0.30, 0.14), b.rng, 0.5, 0.08)
    b.add(
        lathe([(0.4 * r, 0), (0.35 * r, 0.04 * z), (0.06, 0.05 * z), (0.05, 0.2 * z)], 14, split=[0.05 * z]),
        materials.plain("brown", "wood"),
    )
    tiers = 5
    for k in range(tiers):
        low = 0.13 * z + k * 0.155 * z
        wide = r * (1 - 0.16 * k)
        b.add(lathe([(wide, low), (0.25 * wide, low + 0.2 * z), (0.0, low + 0.25 * z)], 16), needles)
    if decorated:
        for k in range(28):
            a, t = 2.4 * k, (k % 14) / 14
            level = int(t * tiers)
            wide = r * (1 - 0.16 * level) * 0.97
            place = (wide * math.cos(a), wide * math.sin(a), 0.12 * z + level * 0.155 * z)
            look = materials.plain(("red", "gold", "silver", "blue")[k % 4], "metal", 0.9)
            b.add(ball(0.05 * x, 0.05 * x, 0.05 * x, 8).visual_only().at(*place), look)
        b.add(star(0.07 * x).turned("y", 90).turned("z", 0).at(0, 0, 0.985 * z), materials.metal("gold"))
        b.point("toggle_button", (0.3 * r, 0, 0.03 * z))


def star(size: float) -> Solid:
    """A five-pointed star in the plane z = 0, visual only, a twentieth as thick."""
    corners = []
    for k in range(10):
        a = math.pi * k / 5
        r = size if k % 2 == 0 else 0.42 * size
        corners.append((r * math.cos(a), r * math.sin(a)))
    return extrusion(corners, size / 10, [])


def wreath(b: ObjectBuilder) -> None:
    """A ring of twigs with a bow, lying down."""
    x, _, z = b.size
    r = 0.38 * x
    needles = materials.skin((0.12, 0.34, 0.16), b.rng, 0.5, 0.05)
    path = [(r * math.cos(a), r * math.sin(a), z * 0.45) for a in (k * math.pi / 9 for k in range(18))]
    b.add(tube(path, 0.45 * z, 7, hulls=0, closed=True) + ring(0.47 * x, 0.47 * x, 0, 0.9 * z, 0.18 * x, 7), needles)
    for k in range(30):
        a = 2 * math.pi * k / 30
        c, s = math.cos(a), math.sin(a)
        out = r + (0.12 * x if k % 2 else -0.1 * x)
        b.add(
            rod(
                (r * c, r * s, z * 0.5), (out * math.cos(a + 0.15), out * math.sin(a + 0.15), 0.6 * z), 0.06 * z, 4
            ).visual_only(),
            needles,
        )
        if k % 5 == 0:
            b.add(
                ball(0.06 * x, 0.06 * x, 0.06 * x, 7).visual_only().at(r * c, r * s, 0.75 * z),
                materials.plain("red", "organic", 0.8),
            )
    b.add(
        loops(0.3 * x, 0.14 * x).turned("y", 90).at(0.36 * x, 0, z), materials.plain(b.pick(("red", "gold")), "fabric")
    )


def tinsel(b: ObjectBuilder) -> None:
    """A garland lying in waves."""
    x, y, z = b.size
    look = materials.plain(b.pick(("gold", "silver", "red")), "metal", 0.9)
    path = [(t * (x - z), 0.5 * (y - z) * math.sin(9 * t), z / 2) for t in [k / 16 - 0.5 for k in range(17)]]
    b.add(tube(path, 0.3 * z, 6, hulls=5), look)
    for k in range(17):
        px, py, pz = path[k]
        for a in (0.4, 2.5, 4.6):
            b.add(
                rod(
                    (px, py, pz),
                    (px + 0.3 * z * math.cos(a), py + 0.5 * z * math.sin(a), pz + 0.4 * z * math.cos(2 * a)),
                    0.04 * z,
                    4,
                ).visual_only(),
                look,
            )


def baseboard(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(box(x, y, z), materials.plain("white", "wood") if b.pick((True, False)) else materials.wood("oak", b.rng))
    b.add(box(0.5 * x, y, 0.1 * z).visual_only().at(0.05 * x, 0, 0.95 * z), materials.plain("light_grey", "wood"))


def wall_socket(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(soft_box(x, y, z, 0.4 * x, 1), materials.plain("white"))
    b.add(
        cylinder(0.32 * y, 0.001, 18).visual_only().turned("y", 90).at(x / 2, 0, z / 2), materials.plain("light_grey")
    )
    for s in (-1, 1):
        b.add(
            cylinder(0.04 * y, 0.002, 8).visual_only().turned("y", 90).at(x / 2, s * 0.13 * y, z / 2),
            materials.plain("black"),
        )
    b.point("toggle_button", (x / 2, 0.35 * y, 0.85 * z))


def hook(b: ObjectBuilder) -> None:
    """A wall hook; its plate at -x."""
    x, y, z = b.size
    metal = materials.metal(b.pick(("brass", "chrome", "iron")))
    b.add(box(0.1 * x, y, z).at(-0.45 * x), metal)
    path = [(-0.4 * x, 0, 0.4 * z), (0.1 * x, 0, 0.25 * z), (0.4 * x, 0, 0.35 * z), (0.44 * x, 0, 0.6 * z)]
    b.add(tube(path, 0.06 * x, 8, hulls=3), metal)


def hinge(b: ObjectBuilder) -> None:
    """A door hinge, lying open."""
    x, y, z = b.size
    metal = materials.metal(b.pick(("brass", "steel")))
    for s in (-1, 1):
        b.add(box(0.46 * x, y, 0.4 * z).at(s * 0.26 * x), metal)
        for k in (-1, 0, 1):
            b.add(
                cylinder(0.04 * x, 0.001, 8).visual_only().at(s * 0.28 * x, k * 0.3 * y, 0.4 * z),
                materials.plain("black"),
            )
    b.add(rod((0, -y / 2, z / 2), (0, y / 2, z / 2), z / 2, 10), metal)


def slab(b: ObjectBuilder, *, kind: str) -> None:
    """A floor tile or a sheet of plywood, lying down."""
    x, y, z = b.size
    if kind == "tile":
        look = materials.stone(b.pick(("terracotta", "cream", "grey", "sky")), b.rng, 0.3)
    else:
        look = materials.wood(b.pick(("birch", "pine")), b.rng, 0.8)
    b.add(box(x, y, z), look)


CATEGORIES = [
    Entry("painting", framed, (0.030, 0.800, 0.600), 2.2, 6, rest="upright", fixed=True, vary=0.15, two_hands=True),
    Entry("picture", framed, (0.022, 0.420, 0.320), 0.8, 6, rest="upright", fixed=True, vary=0.15),
    Entry("whiteboard", board, (0.022, 1.200, 0.900), 8.0, 2, rest="upright", fixed=True, options={"kind": "white"}),
    Entry("bulletin_board", board, (0.020, 0.900, 0.600), 2.5, 3, rest="upright", fixed=True, options={"kind": "cork"}),
    Entry("wall_clock", wall_clock, (0.045, 0.300, 0.300), 0.9, 3, rest="upright", fixed=True, uniform=True),
    Entry("grandfather_clock", grandfather_clock, (0.280, 0.480, 2.000), 45.0, 3, rest="upright", fixed=True,
                  vary=0.05),
    Entry("pot_plant", pot_plant, (0.320, 0.320, 0.520), 3.0, 8, rest="upright", uniform=True, vary=0.2),
    Entry("christmas_tree", christmas_tree, (0.950, 0.950, 1.700), 9.0, 3, rest="upright", fixed=True, uniform=True,
          two_hands=True),
    Entry("christmas_tree_decorated", christmas_tree, (0.950, 0.950, 1.700), 11.0, 3, rest="upright", fixed=True,
                  uniform=True, two_hands=True,
          options={"decorated": True}),
    Entry("wreath", wreath, (0.300, 0.300, 0.055), 0.4, 3, uniform=True),
    Entry("tinsel", tinsel, (0.500, 0.160, 0.040), 0.08, 2),
    Entry("baseboard", baseboard, (0.016, 2.000, 0.090), 2.0, 2, rest="upright", fixed=True),
    Entry("wall_socket", wall_socket, (0.014, 0.080, 0.080), 0.08, 2, rest="upright", fixed=True),
    Entry("hook", hook, (0.050, 0.030, 0.080), 0.06, 2, rest="upright", fixed=True),
    Entry("hinge", hinge, (0.075, 0.090, 0.010), 0.09, 2),
    Entry("tile", slab, (0.300, 0.300, 0.010), 2.0, 4, options={"kind": "tile"}),
    Entry("plywood", slab, (0.600, 1.000, 0.018), 6.5, 3, two_hands=True, options={"kind": "plywood"}),
]  # fmt: skip
