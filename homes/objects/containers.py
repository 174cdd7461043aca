"""Boxes, bags, baskets, bins, folders: objects that hold objects, many with a lid or flap that opens."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import Solid, arc, block, box, decal, hull, join, prism, soft_box, tube
from ..shapes.vessels import tray, turned_vessel
from .entry import Entry
from .model import ObjectBuilder
from .packages import printed
from .parts import lid


def trash_can(b: ObjectBuilder) -> None:
    """An open bin: round or square, tapered."""
    x, y, z = b.size
    look = b.pick(
        (
            materials.metal("steel", b.rng),
            materials.plain("black"),
            materials.plain("white"),
            materials.plain("blue"),
            materials.plain("dark_green"),
            materials.plain("red"),
        )
    )
    if b.pick((True, False)):
        r = x / 2
        b.add(turned_vessel([(0.78 * r, 0), (0.98 * r, 0.94 * z), (r, 0.95 * z), (r, z)], 0.006, 7), look)
    else:
        b.add(tray(x, y, z, 0.006, spread=0.03), look)


def bucket(b: ObjectBuilder) -> None:
    """A pail with a bail lying on its rim."""
    x, _, z = b.size
    r = x / 2
    look = b.pick(
        (materials.plain("blue"), materials.metal("silver", b.rng), materials.plain("red"), materials.plain("yellow"))
    )
    b.add(turned_vessel([(0.72 * r, 0), (0.97 * r, 0.95 * z), (r, 0.96 * z), (r, z)], 0.005, 7), look)
    bail = [
        (1.03 * r * math.sin(a), r * math.cos(a), 0.93 * z - 0.2 * z * math.sin(a))
        for a in (k * math.pi / 8 for k in range(9))
    ]
    b.add(tube(bail, 0.004, 6, hulls=0), materials.metal("steel"))


def basket(b: ObjectBuilder) -> None:
    """A wicker basket with an arched handle."""
    x, y, z = b.size
    rgb = materials.tint(b.pick(("tan", "brown", "cream")), b.rng)
    wicker = materials.picture("wicker", textures.wicker(rgb), tile=0.08, kind="wood")
    wall = 0.55 * z
    b.add(tray(x, y, wall, 0.010, spread=0.025), wicker)
    arch = [p * (1, 1, 1) + (0, 0, wall - 0.01) for p in arc(1.0, 0, 180, 9, "yz")]
    path = [(0, p[1] * (y / 2 - 0.012), wall - 0.02 + (p[2] - wall + 0.01) * (z - wall)) for p in arch]
    b.add(tube(path, 0.009, 6, hulls=3), wicker)


ROOMY = 5
"""Number of the first carton for removals; only the object library has such."""

ROOMY_SIZE = (0.400, 0.520, 0.360)
"""m."""


def carton(b: ObjectBuilder) -> None:
    """A cardboard box, hollow, with two flaps on top; the flaps meet in the middle. From number `ROOMY` on large."""
    if b.index >= ROOMY:
        b.size, b.mass = ROOMY_SIZE, 1.0
    x, y, z = b.size
    card = materials.picture(
        "cardboard", textures.speckle(materials.tint("cardboard", b.rng), b.rng, 0.06), 0.3, "cardboard"
    )
    wall = 0.005
    b.add(tray(x, y, z - wall - 0.001, wall), card)
    for k, s in enumerate((-1, 1)):
        link = b.hinge(f"flap_{k}", (s * x / 2, 0, z - wall / 2), (0, -1 if s < 0 else 1, 0), 2.2, True)
        link.add(block((x / 2 - 0.001, y, wall), (s * (x / 4 + 0.0005), 0, z - wall / 2)), card)
        strip = block((x / 2 - 0.003, 0.05, 0.0008), (s * x / 4, 0, z)).visual_only()
        link.add(strip, materials.plain((0.80, 0.68, 0.46), "paper"))


def chest(b: ObjectBuilder) -> None:
    """A wooden trunk with a hollow hinged lid, light enough for its hinge, and iron bands."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("oak", "walnut", "cherry", "pine")), b.rng)
    iron = materials.metal(b.pick(("iron", "brass")))
    body = 0.74 * z
    b.add(tray(x, y, body, 0.02, floor=0.03), wood)
    top = [
        (-x / 2, body + 0.003),
        (x / 2, body + 0.003),
        (0.45 * x, 0.9 * z),
        (0.2 * x, z),
        (-0.2 * x, z),
        (-0.45 * x, 0.9 * z),
    ]
    board = 0.004
    gables = [prism(top, board).turned("x", 90).at(0, at) for at in (y / 2, board - y / 2)]
    link = lid(b, "lid", join([_vault(top, y, board), *gables]), wood, -x / 2, body + 0.003, angle=1.7)
    band = [(px * 1.004, pz + (0.002 if pz > body + 0.01 else 0.0)) for px, pz in top]
    for s in (-1, 1):
        for side in (-1, 1):
            b.add(block((0.004, 0.04, body), (side * x / 2, s * 0.3 * y, body / 2)).visual_only(), iron)
        link.add(_vault(band, 0.04, 0.002).visual_only().at(0, s * 0.3 * y), iron)
    link.add(block((0.008, 0.06, 0.06), (x / 2 + 0.003, 0, body + 0.02)).visual_only(), iron)


def _vault(outline: list[tuple[float, float]], y: float, board: float) -> Solid:
    """Boards along all edges but the first of an outline (x, z), over the width y: a lid hollow from below."""
    cx, cz = (sum(p[k] for p in outline) / len(outline) for k in (0, 1))
    (left, low), (right, _) = outline[:2]
    shrink_x, shrink_z = 1 - 2 * board / (right - left), 1 - 2 * board / (max(p[1] for p in outline) - low)
    inner = [(cx + (px - cx) * shrink_x, low if pz == low else cz + (pz - cz) * shrink_z) for px, pz in outline]
    boards = []
    for k in range(1, len(outline)):
        n = (k + 1) % len(outline)
        corners = (outline[k], outline[n], inner[n], inner[k])
        boards.append(hull([(px, side * y / 2, pz) for px, pz in corners for side in (-1, 1)]))
    return join(boards)


def small_box(b: ObjectBuilder) -> None:
    """A pencil box: a shallow tray with a hinged lid."""
    x, y, z = b.size
    look = materials.plain(b.pick(("blue", "red", "green", "purple")), "plastic", 0.5)
    body = 0.72 * z
    b.add(tray(x, y, body, 0.003), look)
    link = lid(
        b, "lid", block((x, y, z - body - 0.001), (0, 0, (z + body + 0.001) / 2)), look, -x / 2, body + 0.001, angle=2.0
    )
    link.add(decal(0.7 * y, 0.5 * x, "z").at(z=z + 0.0004), printed(b, "cream", "orange", (96, 48)))
    b.add(block((0.006, 0.03, 0.012), (x / 2 + 0.002, 0, body - 0.004)).visual_only(), materials.metal("silver"))


def parcel(b: ObjectBuilder) -> None:
    """A postal package: a hollow box with one top flap, tape and an address label."""
    x, y, z = b.size
    card = materials.picture(
        "cardboard", textures.speckle(materials.tint("cardboard", b.rng), b.rng, 0.06), 0.3, "cardboard"
    )
    wall = 0.004
    b.add(tray(x, y, z - wall - 0.001, wall), card)
    link = lid(b, "flap", block((x, y, wall), (0, 0, z - wall / 2)), card, -x / 2, z - wall / 2, angle=2.2)
    link.add(block((x, 0.04, 0.0008), (0, 0, z)).visual_only(), materials.plain((0.80, 0.68, 0.46), "paper"))
    label = materials.picture("address", textures.paper(b.rng, 6))
    link.add(decal(0.3 * y, 0.4 * x, "z").at(0.1 * x, 0.25 * y, z + 0.0006), label)


def briefcase(b: ObjectBuilder) -> None:
    """A flat case lying down: two shells, hinged at the rear, a grip in front."""
    x, y, z = b.size
    hide = materials.leather(b.pick(("brown", "black", "dark_red")), b.rng)
    grip = 0.045
    depth = x - grip
    shift = -grip / 2
    half = 0.55 * z
    b.add(tray(depth, y, half, 0.006).at(shift), hide)
    cover = (
        _shell(depth, y, z - half - 0.001, 0.006).visual_only()
        + block((depth, y, 0.006), (0, 0, z - half - 0.004)).collision_only()
    )
    lid(b, "lid", cover.at(shift, 0, half + 0.001), hide, shift - depth / 2, half + 0.001, angle=1.7)
    metal = materials.metal("brass")
    front = shift + depth / 2
    for s in (-1, 1):
        b.add(block((0.006, 0.04, 0.02), (front + 0.002, s * 0.3 * y, half - 0.012)).visual_only(), metal)
    path = [
        (front, -0.07, half - 0.02),
        (front + grip, -0.055, half - 0.02),
        (front + grip, 0.055, half - 0.02),
        (front, 0.07, half - 0.02),
    ]
    b.add(
        tube(path, 0.008, 6, hulls=0)
        + block((0.012, 0.12, 0.016), (front + grip - 0.006, 0, half - 0.02)).collision_only(),
        hide,
    )


def _shell(x: float, y: float, z: float, wall: float) -> Solid:
    """A tray upside down, its open side at z = 0."""
    return tray(x, y, z, wall).mirrored("z").at(z=z)


LARGE = 4
"""Number of the first backpack for a journey; only the object library has such."""

LARGE_SIZE = (0.290, 0.340, 0.470)
"""m."""


def backpack(b: ObjectBuilder) -> None:
    """A standing rucksack: hollow body, front pocket, straps at the rear, a top flap hinged at the back. From number
    `LARGE` on large."""
    if b.index >= LARGE:
        b.size, b.mass = LARGE_SIZE, 1.2
    x, y, z = b.size
    cloth = materials.fabric(b.pick(("navy", "red", "dark_green", "grey", "teal")), b.rng)
    dark = materials.plain("black", "fabric")
    wall = 0.008
    pocket = 0.25 * x
    depth = x - pocket - 0.02
    shift = -(x - depth) / 2 + 0.02
    body = 0.9 * z
    b.add(tray(depth, y, body, wall).at(shift), cloth)
    b.add(soft_box(pocket, 0.78 * y, 0.5 * z, 0.03).at(shift + (depth + pocket) / 2, 0, 0.04), cloth)
    for s in (-1, 1):
        strap = [
            (shift - depth / 2, s * 0.2 * y, 0.85 * z),
            (-x / 2 - 0.015, s * 0.26 * y, 0.5 * z),
            (shift - depth / 2, s * 0.34 * y, 0.08 * z),
        ]
        b.add(tube(strap, 0.012, 6, hulls=0), dark)
    rear = shift - depth / 2
    flap = soft_box(depth + 0.01, y, z - body - 0.002, 0.03).at(shift + 0.005, 0, body + 0.002)
    link = lid(b, "flap", flap, cloth, rear, body + 0.002, angle=1.9)
    link.add(block((0.006, 0.05, 0.05), (shift + depth / 2 + 0.011, 0, body + 0.01)).visual_only(), dark)
    handle = [p * (1, 1, 1) + (rear + 0.01, 0, z - 0.012) for p in arc(0.035, 0, 180, 7, "yz")]
    b.add(tube(handle, 0.005, 6, hulls=0), dark)


def soft_bag(b: ObjectBuilder, *, roll: bool = True) -> None:
    """A duffel (a soft roll with two handles) or a shoulder bag (flat, with a long strap)."""
    x, y, z = b.size
    cloth = materials.fabric(b.pick(("navy", "dark_grey", "dark_green", "red", "beige")), b.rng)
    dark = materials.plain("black", "fabric")
    top = 0.78 * z
    if roll:
        b.add(soft_box(x, y, top, 0.3 * top, 3), cloth)
        for s in (-1, 1):
            path = [p * (1, y / x * 0.55, 0.9) + (s * 0.18 * x, 0, top * 0.93) for p in arc(0.45 * x, 0, 180, 7, "yz")]
            b.add(tube([(p[0], p[1], min(p[2], z)) for p in path], 0.01, 6, hulls=0), dark)
    else:
        b.add(soft_box(x, y, top, 0.3 * x, 2), cloth)
        b.add(soft_box(0.02, y * 1.01, 0.6 * top, 0.008).visual_only().at(x / 2 - 0.004, 0, 0.42 * top), cloth)
        path = [p * (1, 1, (z - 0.9 * top) / (0.46 * y)) + (0, 0, 0.9 * top) for p in arc(0.46 * y, 0, 180, 9, "yz")]
        b.add(tube(path, 0.009, 6, hulls=0), dark)
    b.add(block((0.006, 0.8 * y, 0.006), (0, 0, top)).visual_only(), dark)
    b.add(box(0.3 * x, 0.4 * y, z - top).collision_only().at(z=top), cloth)


def paper_bag(b: ObjectBuilder) -> None:
    """An open paper sack, hollow."""
    x, y, z = b.size
    card = materials.plain(materials.tint(b.pick(("cardboard", "white", "tan")), b.rng), "paper")
    b.add(tray(x, y, z, 0.003, 0.003), card)
    for s in (-1, 1):
        path = [p * (1, 1, 0.9) + (s * x / 2, 0, z - 0.01) for p in arc(0.2 * y, 0, 180, 7, "yz")]
        b.add(tube(path, 0.0025, 5, hulls=0), card)


def folder(b: ObjectBuilder) -> None:
    """A cardboard folder lying shut with papers inside; its cover turns on the spine (-y edge)."""
    x, y, z = b.size
    card = materials.plain(b.pick(("blue", "red", "green", "cream", "cardboard")), "paper")
    skin = 0.002
    b.add(box(x, y, skin), card)
    b.add(block((x, skin, z - skin), (0, -y / 2 + skin / 2, z / 2)), card)
    b.add(box(x - 0.015, y - 0.015, z - 3 * skin).at(0, 0.003, skin), materials.plain("paper", "paper"))
    cover = b.hinge("cover", (0, -y / 2 + skin, z - skin), (1, 0, 0), 2.6, True)
    cover.add(box(x, y - 2 * skin, skin).at(0, skin, z - skin), card)
    cover.add(
        decal(0.4 * y, 0.2 * x, "z").at(-0.15 * x, 0, z + 0.0003), materials.picture("tab", textures.paper(b.rng, 3))
    )


def dustpan(b: ObjectBuilder) -> None:
    """A dustpan: floor, two sides, a back, and a handle towards -x."""
    x, y, z = b.size
    look = materials.plain(b.pick(("red", "blue", "green", "grey")))
    pan = 0.62 * x
    front = x / 2
    b.add(
        hull(
            [(front, s * y / 2, h) for s in (-1, 1) for h in (0, 0.002)]
            + [(front - pan, s * 0.45 * y, h) for s in (-1, 1) for h in (0, 0.006)]
        ),
        look,
    )
    for s in (-1, 1):
        side = [(front - 0.02, s * y / 2, h) for h in (0, 0.01)] + [
            (front - pan, s * 0.45 * y, h) for h in (0, 0.8 * z)
        ]
        side += [(px, py - s * 0.005, pz) for px, py, pz in side]
        b.add(hull(side), look)
    b.add(block((0.006, 0.9 * y, 0.8 * z), (front - pan, 0, 0.4 * z)), look)
    b.add(soft_box(x - pan, 0.035, 0.024).turned("y", 8).at(-x / 2 + (x - pan) / 2, 0, 0.55 * z), look)


CATEGORIES = [
    Entry("trash_can", trash_can, (0.290, 0.290, 0.340), 1.4, 6, rest="upright", vary=0.12),
    Entry("bucket", bucket, (0.290, 0.290, 0.270), 0.9, 4, rest="upright", uniform=True),
    Entry("basket", basket, (0.300, 0.400, 0.330), 0.8, 5, rest="upright", vary=0.1),
    Entry("carton", carton, (0.320, 0.420, 0.300), 0.7, ROOMY, extra=1, rest="upright", vary=0.15),
    Entry("chest", chest, (0.480, 0.800, 0.480), 10.0, 4, rest="upright", vary=0.1),
    Entry("pencil_box", small_box, (0.085, 0.210, 0.040), 0.14, 3, rest="upright"),
    Entry("package", parcel, (0.220, 0.300, 0.130), 0.6, 4, rest="upright", vary=0.12),
    Entry("briefcase", briefcase, (0.340, 0.420, 0.110), 2.0, 4, rest="upright"),
    Entry("backpack", backpack, (0.220, 0.300, 0.430), 0.9, LARGE, extra=1, rest="upright"),
    Entry("duffel_bag", soft_bag, (0.260, 0.520, 0.330), 1.0, 4, rest="upright"),
    Entry("shoulder_bag", soft_bag, (0.110, 0.300, 0.420), 0.7, 3, rest="upright", options={"roll": False}),
    Entry("paper_bag", paper_bag, (0.150, 0.250, 0.320), 0.06, 4, rest="upright", vary=0.1),
    Entry("folder", folder, (0.310, 0.230, 0.018), 0.45, 4, rest="upright"),
    Entry("dustpan", dustpan, (0.340, 0.230, 0.070), 0.25, 3, rest="upright"),
]  # fmt: skip
