"""Household machines: dishwasher, washer, dryer, coffee maker, blender, iron, heater, hood, mower, treadmill."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import block, box, cylinder, decal, hull, join, lathe, rod, soft_box, tube
from ..shapes.materials import Material
from ..shapes.vessels import tray, turned_vessel
from .entry import Entry
from .model import ObjectBuilder
from .parts import bow_handle, button, carcass, flap, knob


def _casing(b: ObjectBuilder) -> Material:
    return b.pick(
        (materials.plain("white", shine=0.5), materials.metal("steel", b.rng), materials.metal("dark_grey", b.rng))
    )


def dishwasher(b: ObjectBuilder) -> None:
    """A hollow case with a front flap and two baskets that slide out once it is open."""
    x, y, z = b.size
    body, chrome = _casing(b), materials.metal("chrome")
    leaf, foot = 0.05, 0.11
    depth = x - leaf - 0.045
    shift = -(x - depth) / 2
    b.add(block((depth - 0.05, y - 0.01, foot), (shift, 0, foot / 2)), materials.plain("black"))
    b.add(carcass(depth, y, z - foot, 0.03, back=0.03).at(shift, 0, foot), body)
    plane = shift + depth / 2
    wire = materials.metal("light_grey")
    room_z = (z - foot - 0.06) / 2
    for k in range(2):
        low = foot + 0.035 + k * room_z
        size = (depth - 0.06, y - 0.07, room_z - 0.02)
        centre = (plane - 0.006 - size[0] / 2, 0, low + size[2] / 2)
        _rack(b, f"rack_{k}", centre, size, wire)
    link = flap(
        b,
        "door",
        plane,
        y - 0.004,
        (foot + 0.003, z - 0.003),
        body,
        bow_handle(0.7 * y, 0.04, 0.009),
        chrome,
        depth=leaf,
        skin=0.003,
        angle=1.5,
    )
    link.add(block((0.004, y - 0.02, 0.06), (plane + leaf, 0, z - 0.04)).visual_only(), materials.plain("black"))
    # The button belongs to the fixed body's rim above the flap, as meta links must lie on the base link.
    button(b, (plane, 0.35 * y, z), materials.plain("red"), 0.01, "z")


def _rack(
    b: ObjectBuilder, name: str, centre: tuple[float, float, float], size: tuple[float, float, float], wire: Material
) -> None:
    """A wire basket that slides towards +x: five collision plates, drawn as rods."""
    sx, sy, sz = size
    tall = 0.5 * sz
    link = b.slide(name, centre, (1, 0, 0), 0.85 * sx, openable=False)
    at = (centre[0], centre[1], centre[2] - sz / 2)
    link.add(tray(sx, sy, tall, 0.006).collision_only().at(*at), wire)
    rods = []
    for h in (0.004, tall / 2, tall):
        rods += [rod((-sx / 2, s * sy / 2, h), (sx / 2, s * sy / 2, h), 0.003, 5) for s in (-1, 1)]
        rods += [rod((s * sx / 2, -sy / 2, h), (s * sx / 2, sy / 2, h), 0.003, 5) for s in (-1, 1)]
    for j in range(9):
        yy = (j / 8 - 0.5) * sy
        path = [(-sx / 2, yy, tall), (-sx / 2, yy, 0.004), (-0.1 * sx, yy, 0.004), (-0.1 * sx, yy, 0.9 * tall)]
        path += [(0, yy, 0.004), (sx / 2, yy, 0.004), (sx / 2, yy, tall)]
        rods.append(tube(path, 0.0025, 4, hulls=0))
    link.add(join(rods).visual_only().at(*at), wire)


def drum(b: ObjectBuilder, *, washing: bool = True) -> None:
    """A washing machine or dryer: a hollow case, a porthole with a door, a panel with a knob and a button."""
    x, y, z = b.size
    body = _casing(b)
    leaf = 0.045
    depth = x - leaf - 0.02
    shift = -(x - depth) / 2
    plane = shift + depth / 2
    panel = 0.14
    hole = 0.5 * min(y, z)
    middle = (z - panel) * 0.52
    b.add(carcass(depth - 0.03, y, z, 0.02, back=0.02).at(shift - 0.015), body)
    front = plane - 0.015
    low, high = middle - hole / 2, middle + hole / 2
    b.add(block((0.03, y, low), (front, 0, low / 2)), body)
    b.add(block((0.03, y, z - high), (front, 0, (z + high) / 2)), body)
    for s in (-1, 1):
        b.add(block((0.03, (y - hole) / 2, hole), (front, s * (y + hole) / 4, middle)), body)
    inside = materials.metal("silver", b.rng)
    reach = depth - 0.08
    for k in range(8):
        a = 2 * math.pi * (k + 0.5) / 8
        r = 0.52 * hole + 0.03
        plate = block((reach, 0.84 * r, 0.008), (plane - 0.04 - reach / 2, 0, r)).turned("x", math.degrees(a))
        b.add(plate.at(0, 0, middle), inside)
    b.add(cylinder(0.52 * hole + 0.03, 0.006, 16).turned("y", 90).at(plane - 0.04 - reach, 0, middle), inside)
    left = b.pick((True, False))
    s = 1 if left else -1
    link = b.hinge("door", (plane + leaf, s * (0.56 * hole + 0.02), middle), (0, 0, s), 2.0)
    r = 0.56 * hole + 0.02
    link.add(cylinder(r, leaf, 20).turned("y", 90).at(plane, 0, middle), body)
    link.add(
        cylinder(0.72 * r, 0.006, 20).visual_only().turned("y", 90).at(plane + leaf - 0.002, 0, middle),
        materials.plain("navy" if washing else "black", "glass", 0.9),
    )
    link.add(block((0.02, 0.02, 0.1), (plane + leaf + 0.008, -s * 0.85 * r, middle)), materials.metal("chrome"))
    at = z - panel / 2
    b.add(block((0.004, y - 0.02, panel - 0.03), (plane + 0.001, 0, at)).visual_only(), materials.plain("light_grey"))
    b.add(knob(0.03, 0.02).visual_only().at(plane, 0, at), materials.metal("silver"))
    shown = materials.picture("display", textures.screen(b.rng, (0.02, 0.1, 0.2)), kind="screen")
    b.add(decal(0.18 * y, 0.05).at(plane + 0.004, 0.28 * y, at), shown)
    button(b, (plane + 0.004, -0.33 * y, at), materials.plain("green"))
    if washing:
        b.add(block((0.006, 0.2 * y, 0.06), (plane + 0.003, -0.38 * y, at)).visual_only(), body)


def coffee_maker(b: ObjectBuilder) -> None:
    """A drip machine: foot plate, tower, head, and a glass pot."""
    x, y, z = b.size
    body = b.pick((materials.plain("black"), materials.metal("steel", b.rng), materials.plain("red")))
    b.add(soft_box(x, y, 0.1 * z, 0.01), body)
    b.add(soft_box(0.34 * x, y, 0.9 * z, 0.02).at(-0.33 * x, 0, 0.08 * z), body)
    b.add(soft_box(0.8 * x, y, 0.24 * z, 0.02).at(-0.1 * x, 0, 0.76 * z), body)
    r = 0.3 * min(x, y) + 0.01
    pot = [(0.9 * r, 0.1 * z), (r, 0.3 * z), (0.9 * r, 0.5 * z), (0.6 * r, 0.62 * z)]
    b.add(lathe(pot).at(0.14 * x), materials.glass("glass", 0.4))
    b.add(
        lathe([(0.88 * r, 0.11 * z), (0.96 * r, 0.3 * z), (0.9 * r, 0.4 * z)]).visual_only().at(0.14 * x),
        materials.plain("brown", "organic"),
    )
    b.add(
        tube(
            [
                (0.14 * x + 0.8 * r, 0, 0.56 * z),
                (0.47 * x, 0, 0.52 * z),
                (0.47 * x, 0, 0.28 * z),
                (0.14 * x + 0.9 * r, 0, 0.26 * z),
            ],
            0.006,
            6,
            hulls=0,
        ),
        materials.plain("black"),
    )
    button(b, (0.3 * x, 0.25 * y, 0.86 * z), materials.plain("red"), 0.01)


def blender(b: ObjectBuilder) -> None:
    """A motor foot with a jug and a lid."""
    x, y, z = b.size
    body = b.pick((materials.metal("chrome", b.rng), materials.plain("red"), materials.plain("black")))
    r = min(x, y) / 2
    base = 0.36 * z
    b.add(lathe([(0.95 * r, 0), (r, 0.1 * z), (0.7 * r, base)]), body)
    b.add(turned_vessel([(0.55 * r, base), (0.85 * r, 0.92 * z)], 0.004, 5), materials.glass("glass", 0.4))
    b.add(
        lathe([(0.87 * r, 0.92 * z), (0.85 * r, 0.96 * z), (0.4 * r, 0.96 * z), (0.38 * r, z)]),
        materials.plain("black"),
    )
    b.add(
        tube(
            [(0.8 * r, 0, 0.86 * z), (1.15 * r, 0, 0.84 * z), (1.1 * r, 0, 0.5 * z), (0.68 * r, 0, 0.48 * z)],
            0.009,
            6,
            hulls=0,
        ),
        materials.plain("black"),
    )
    b.add(knob(0.018, 0.016).visual_only().at(0.93 * r, 0, 0.16 * z), materials.plain("black"))
    b.point("toggle_button", (0.93 * r + 0.016, 0, 0.16 * z))


def iron(b: ObjectBuilder) -> None:
    """A flat iron, its tip along +x."""
    x, y, z = b.size
    body = materials.plain(b.pick(("blue", "purple", "teal")), shine=0.6)
    sole = [
        (-x / 2, -y / 2),
        (0.1 * x, -y / 2),
        (0.35 * x, -0.3 * y),
        (x / 2, 0),
        (0.35 * x, 0.3 * y),
        (0.1 * x, y / 2),
        (-x / 2, y / 2),
    ]
    points = [(px, py, 0) for px, py in sole] + [(px, py, 0.01) for px, py in sole]
    b.add(hull(points), materials.metal("silver"))
    b.add(
        hull(
            [(0.96 * px, 0.94 * py, 0.01) for px, py in sole]
            + [(0.7 * px - 0.1 * x, 0.4 * py, 0.5 * z) for px, py in sole]
        ),
        body,
    )
    grip = [
        (-0.42 * x, 0, 0.4 * z),
        (-0.42 * x, 0, 0.92 * z),
        (-0.1 * x, 0, 0.95 * z),
        (0.15 * x, 0, 0.85 * z),
        (0.2 * x, 0, 0.35 * z),
    ]
    b.add(tube(grip, 0.05 * z + 0.006, 8, hulls=4), body)
    b.point("toggle_button", (0, 0, 0.95 * z))
    b.point("heat_source", (0, 0, 0))


def heater(b: ObjectBuilder) -> None:
    """An oil radiator: ribs between two feet."""
    x, y, z = b.size
    look = b.pick((materials.plain("white"), materials.plain("dark_grey"), materials.plain("cream")))
    count = max(5, round(y / 0.075))
    for k in range(count):
        yy = (k + 0.5) / count * y - y / 2
        b.add(soft_box(0.7 * x, 0.6 * y / count, 0.86 * z, 0.02).visual_only().at(0, yy, 0.1 * z), look)
    b.add(box(0.7 * x, y, 0.86 * z).collision_only().at(z=0.1 * z), look)
    b.add(block((0.3 * x, y * 0.98, 0.03), (0, 0, 0.9 * z)).visual_only(), look)
    for s in (-1, 1):
        b.add(box(x, 0.05, 0.1 * z).at(0, s * 0.36 * y), materials.plain("black"))
    b.add(soft_box(0.66 * x, 0.04, 0.3 * z).at(0, -y / 2 + 0.01, 0.5 * z), materials.plain("black"))
    b.point("heat_source", (0.0, 0, 0.55 * z))
    b.add(knob(0.02, 0.015).visual_only().at(0.4 * x, -y / 2, 0.7 * z), materials.plain("silver"))
    b.point("toggle_button", (0.45 * x, -y / 2, 0.7 * z))


def range_hood(b: ObjectBuilder) -> None:
    """A chimney over a sloped canopy; its back is at -x."""
    x, y, z = b.size
    steel = materials.metal(b.pick(("steel", "dark_grey")), b.rng)
    low = 0.07
    b.add(box(x, y, low), steel)
    slope = [
        (px, s * w, h)
        for px, w, h in (
            (-x / 2, y / 2, low),
            (x / 2, y / 2, low),
            (-x / 2, 0.15 * y, 0.35 * z),
            (-0.05 * x, 0.15 * y, 0.35 * z),
        )
        for s in (-1, 1)
    ]
    b.add(hull(slope), steel)
    b.add(box(0.45 * x, 0.3 * y, 0.66 * z).at(-0.275 * x, 0, 0.34 * z), steel)
    b.add(box(0.8 * x, 0.8 * y, 0.002).visual_only().at(z=-0.001), materials.metal("iron"))
    button(b, (x / 2, 0.2 * y, low / 2), materials.plain("sky"), 0.01)


CATEGORIES = [
    Entry("dishwasher", dishwasher, (0.60, 0.60, 0.84), 32.0, 6, fixed=True, rest="upright", vary=0.04),
    Entry("washer", drum, (0.60, 0.60, 0.85), 68.0, 6, fixed=True, rest="upright", vary=0.04),
    Entry(
        "dryer", drum, (0.62, 0.60, 0.86), 48.0, 5, fixed=True, rest="upright", vary=0.04, options={"washing": False}
    ),
    Entry("coffee_maker", coffee_maker, (0.260, 0.190, 0.340), 2.4, 4, rest="upright"),
    Entry("blender", blender, (0.180, 0.180, 0.400), 2.8, 4, rest="upright", uniform=True),
    Entry("iron", iron, (0.280, 0.115, 0.140), 1.2, 3, rest="upright"),
    Entry("heater", heater, (0.150, 0.560, 0.640), 9.0, 3, rest="upright", fixed=True),
    Entry("range_hood", range_hood, (0.480, 0.700, 0.800), 14.0, 4, fixed=True, rest="upright"),
]
