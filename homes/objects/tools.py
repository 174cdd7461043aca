"""Hand tools: hammer, saw, drill, screwdriver, scissors, nails, tape."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import Solid, block, box, cylinder, hull, lathe, prism, rod, soft_box, tube
from ..shapes.materials import Material
from ..shapes.vessels import ring, turned_vessel
from .entry import Entry
from .model import ObjectBuilder


def grip(b: ObjectBuilder) -> Material:
    return b.pick(
        (
            materials.plain("red"),
            materials.wood("pine", b.rng),
            materials.plain("black"),
            materials.plain("orange"),
            materials.plain("blue"),
        )
    )


def turned_grip(length: float, radius: float) -> Solid:
    """A screwdriver's handle from x = 0 to -length on the axis z = 0."""
    shape = lathe(
        [
            (0.7 * radius, 0),
            (radius, 0.1 * length),
            (0.8 * radius, 0.3 * length),
            (radius, 0.7 * length),
            (0.85 * radius, length),
        ],
        12,
    )
    return shape.turned("y", -90)


def hammer(b: ObjectBuilder) -> None:
    """A claw hammer lying on its side: handle along x, head across at +x."""
    x, y, z = b.size
    steel = materials.metal("steel")
    b.add(soft_box(0.9 * x, 0.22 * y, 0.8 * z, 0.3 * z).at(-0.05 * x, 0, 0.1 * z), grip(b))
    b.add(cylinder(z / 2, 0.3 * y, 12).turned("x", 90).at(x / 2 - 0.05 * x, -0.2 * y, z / 2), steel)
    b.add(block((0.09 * x, 0.45 * y, 0.8 * z), (0.45 * x, 0.0, z / 2)), steel)
    for s in (-1, 1):
        claw = [
            (0.42 * x, 0.2 * y, z / 2 + s * 0.1 * z),
            (0.49 * x, 0.2 * y, z / 2 + s * 0.4 * z),
            (0.43 * x, 0.2 * y, z / 2 + s * 0.4 * z),
            (0.36 * x, y / 2, z / 2 + s * 0.15 * z),
            (0.38 * x, y / 2, z / 2 + s * 0.38 * z),
        ]
        b.add(hull(claw), steel)


def saw(b: ObjectBuilder) -> None:
    """A hand saw lying flat: tapered blade with teeth, closed grip at -x."""
    x, y, z = b.size
    blade = 0.74 * x
    start = x / 2 - blade
    thick = 0.0025
    outline = [(start, -0.45 * y), (x / 2, -0.1 * y), (x / 2, 0.12 * y), (start, 0.42 * y)]
    b.add(prism(outline, thick).at(z=z / 2 - thick / 2), materials.metal("silver"))
    for k in range(26):
        t = (k + 0.5) / 26
        px, py = start + t * blade, -0.45 * y + t * 0.35 * y
        tooth = [(px - 0.006, py), (px, py - 0.006), (px + 0.006, py)]
        b.add(prism(tooth, thick).visual_only().at(z=z / 2 - thick / 2), materials.metal("silver"))
    wood = b.pick((materials.wood("cherry", b.rng), materials.plain("orange"), materials.plain("red")))
    loop = [
        (start + 0.03, 0.4 * y),
        (start - 0.09 * x, 0.45 * y),
        (-x / 2 + 0.02, 0.3 * y),
        (-x / 2 + 0.02, -0.25 * y),
        (start - 0.04 * x, -0.4 * y),
        (start + 0.02, -0.25 * y),
    ]
    b.add(tube([(px, py, z / 2) for px, py in loop], z / 2, 8, hulls=5, closed=True), wood)


def screwdriver(b: ObjectBuilder) -> None:
    x, _, z = b.size
    handle = 0.42 * x
    b.add(turned_grip(handle, z / 2).at(-x / 2 + handle, 0, z / 2), grip(b))
    b.add(rod((-x / 2 + handle - 0.005, 0, z / 2), (x / 2 - 0.01, 0, z / 2), 0.12 * z, 8), materials.metal("steel"))
    b.add(
        hull(
            [(x / 2 - 0.012, s * 0.1 * z, z / 2 + h * 0.1 * z) for s in (-1, 1) for h in (-1, 1)]
            + [(x / 2, s * 0.18 * z, z / 2) for s in (-1, 1)]
        ),
        materials.metal("steel"),
    )


def drill(b: ObjectBuilder) -> None:
    """A cordless drill standing on its battery: body along x, grip, chuck and bit."""
    x, y, z = b.size
    body = materials.plain(b.pick(("orange", "teal", "yellow", "red")))
    dark = materials.plain("black", "rubber")
    axis = 0.82 * z
    b.add(soft_box(0.62 * x, 0.8 * y, 0.34 * z, 0.02).at(-0.18 * x, 0, axis - 0.17 * z), body)
    b.add(
        lathe([(0.3 * y, 0), (0.3 * y, 0.08 * x), (0.14 * y, 0.18 * x)], 12).turned("y", 90).at(0.13 * x, 0, axis), dark
    )
    b.add(rod((0.3 * x, 0, axis), (x / 2, 0, axis), 0.003, 6), materials.metal("steel"))
    b.add(
        hull(
            [
                (px * x, s * 0.26 * y, pz * z)
                for px, pz in ((-0.32, 0.7), (-0.1, 0.7), (-0.4, 0.2), (-0.2, 0.2))
                for s in (-1, 1)
            ]
        ),
        body,
    )
    b.add(soft_box(0.36 * x, y, 0.22 * z, 0.01).at(-0.26 * x), dark)
    b.add(block((0.02, 0.2 * y, 0.1 * z), (-0.07 * x, 0, 0.56 * z)).visual_only(), materials.plain("red"))
    b.point("toggle_button", (-0.07 * x, 0, 0.56 * z))


def trowel(b: ObjectBuilder) -> None:
    """A garden trowel: a pointed scoop and a handle."""
    x, y, z = b.size
    handle = 0.38 * x
    b.add(
        turned_grip(handle, 0.3 * z + 0.004).at(-x / 2 + handle, 0, 0.6 * z),
        materials.wood(b.pick(("pine", "red", "green")), b.rng),
    )
    b.add(rod((-x / 2 + handle, 0, 0.6 * z), (-x / 2 + handle + 0.16 * x, 0, 0.3 * z), 0.005), materials.metal("steel"))
    start = -x / 2 + handle + 0.14 * x
    scoop = [(start, s * 0.4 * y, 0.5 * z) for s in (-1, 1)] + [
        (start, 0, 0.1 * z),
        (start + 0.2 * x, 0, 0),
        (x / 2, 0, 0.1 * z),
    ]
    scoop += [(start + 0.25 * x, s * y / 2, 0.45 * z) for s in (-1, 1)]
    b.add(hull(scoop), materials.metal("steel"))


def caliper(b: ObjectBuilder) -> None:
    """A vernier caliper: a beam, a fixed and a sliding jaw (rigid)."""
    x, y, z = b.size
    steel = materials.metal("silver")
    b.add(block((x, 0.22 * y, 0.5 * z), (0, 0.12 * y, z / 2)), steel)
    b.add(
        prism([(-x / 2, 0.1 * y), (-x / 2, -y / 2), (-0.44 * x, -0.4 * y), (-0.38 * x, 0.1 * y)], 0.6 * z).at(
            z=0.2 * z
        ),
        steel,
    )
    b.add(
        prism([(-0.3 * x, 0.1 * y), (-0.24 * x, -0.4 * y), (-0.18 * x, -y / 2), (-0.18 * x, 0.1 * y)], 0.6 * z).at(
            z=0.2 * z
        ),
        steel,
    )
    b.add(block((0.28 * x, 0.36 * y, z), (-0.12 * x, 0.12 * y, z / 2)), materials.plain("dark_grey"))
    b.add(block((0.1 * x, 0.2 * y, 0.0006), (-0.12 * x, 0.12 * y, z)).visual_only(), materials.plain("mint"))
    b.point("toggle_button", (0.0, 0.12 * y, z))


def scissors(b: ObjectBuilder) -> None:
    """Closed scissors lying flat: two blades and two finger rings."""
    x, y, z = b.size
    steel = materials.metal("silver")
    look = materials.plain(b.pick(("red", "black", "blue", "orange")))
    for s, low in ((-1, 0.15 * z), (1, 0.5 * z)):
        b.add(
            prism(
                [
                    (-0.05 * x, s * -0.12 * y),
                    (0.1 * x, s * 0.02 * y - 0.1 * y),
                    (x / 2, 0.0),
                    (0.1 * x, s * 0.02 * y + 0.1 * y),
                    (-0.05 * x, s * -0.12 * y + 0.12 * y),
                ],
                0.3 * z,
            ).at(z=low),
            steel,
        )
        centre = (-0.33 * x, s * 0.27 * y)
        path = [
            (centre[0] + 0.15 * x * math.cos(a), centre[1] + 0.19 * y * math.sin(a), z / 2)
            for a in (k * math.pi / 6 for k in range(12))
        ]
        b.add(tube(path, 0.4 * z, 6, hulls=0, closed=True), look)
        b.add(block((0.32 * x, 0.44 * y, 0.8 * z), (centre[0], centre[1], z / 2)).collision_only(), look)
        b.add(rod((-0.2 * x, s * 0.2 * y, z / 2), (0.0, -s * 0.04 * y, z / 2), 0.35 * z, 6), look)
    b.add(cylinder(0.5 * z, z, 10).visual_only(), steel)


def nail(b: ObjectBuilder, *, head: float = 0.5, colour: str = "steel") -> None:
    """A nail or a pin lying down: shank, point, head at -x."""
    x, _, z = b.size
    look = materials.metal(colour) if colour == "steel" else materials.plain(b.pick(("red", "blue", "yellow")))
    shaft = 0.22 * z
    b.add(
        lathe([(z / 2, 0), (z / 2, head * 0.12 * x), (shaft, head * 0.14 * x)], 10)
        .turned("y", 90)
        .at(-x / 2, 0, z / 2),
        look,
    )
    b.add(
        lathe([(shaft, 0.05 * x), (shaft, 0.88 * x), (0.0, x)], 8).turned("y", 90).at(-x / 2, 0, z / 2),
        materials.metal("steel"),
    )


def thumbtack(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(
        lathe([(0.9 * r, 0), (r, 0.1 * z), (0.5 * r, 0.3 * z), (0.5 * r, 0.5 * z)], 12),
        materials.plain(b.pick(("red", "blue", "yellow"))),
    )
    b.add(lathe([(0.09 * r, 0.5 * z), (0.02 * r, z)], 6), materials.metal("silver"))


def paper_clip(b: ObjectBuilder) -> None:
    x, y, z = b.size
    r = z / 2
    path = [
        (-0.3 * x, -0.25 * y, r),
        (0.3 * x, -0.25 * y, r),
        (0.42 * x, 0, r),
        (0.3 * x, 0.25 * y, r),
        (-0.4 * x, 0.25 * y, r),
        (-0.5 * x + r, 0.0, r),
        (-0.4 * x, -0.45 * y, r),
        (0.4 * x, -0.45 * y, r),
        (0.5 * x - r, 0.0, r),
        (0.4 * x, 0.45 * y, r),
        (-0.2 * x, 0.45 * y, r),
    ]
    b.add(
        tube(path, r, 5, hulls=0) + box(x, y, z).collision_only(),
        b.pick((materials.metal("silver"), materials.plain("red"), materials.plain("blue"))),
    )


def bulldog_clip(b: ObjectBuilder) -> None:
    x, y, z = b.size
    body = [
        (0, -y / 2, 0),
        (0, y / 2, 0),
        (0, -y / 2, z),
        (0, y / 2, z),
        (x / 2, -y / 2, 0.45 * z),
        (x / 2, y / 2, 0.45 * z),
        (x / 2, -y / 2, 0.55 * z),
        (x / 2, y / 2, 0.55 * z),
    ]
    b.add(hull(body), b.pick((materials.plain("black", "metal", 0.6), materials.metal("silver"))))
    for s in (0.12, 0.88):
        path = [
            (0.05 * x, -0.3 * y, s * z),
            (-0.45 * x, -0.18 * y, s * z),
            (-0.45 * x, 0.18 * y, s * z),
            (0.05 * x, 0.3 * y, s * z),
        ]
        b.add(tube(path, 0.04 * z + 0.0005, 5, hulls=1), materials.metal("silver"))


def tape(b: ObjectBuilder) -> None:
    """A roll of tape."""
    x, _, z = b.size
    r = x / 2
    look = b.pick((materials.plain("tan"), materials.plain("silver"), materials.plain("cream")))
    b.add(turned_vessel([(r, 0), (r, z)], 0.38 * r, 7, floor=0.0005).visual_only() + ring(r, r, 0, z, 0.4 * r, 7), look)
    b.add(cylinder(0.61 * r, 0.0005).visual_only(), materials.plain("cardboard", "paper"))


def ruler(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(box(x, y, z), b.pick((materials.wood("birch", b.rng), materials.plain("yellow"), materials.metal("silver"))))
    for k in range(30):
        long = 0.5 if k % 5 == 0 else 0.25
        b.add(
            box(0.0008, long * y, 0.0003).visual_only().at((k / 30 - 0.48) * x, y / 2 - long * y / 2, z),
            materials.plain("black"),
        )


def steel_rod(b: ObjectBuilder) -> None:
    """A honing steel: ridged rod, guard, grip."""
    x, _, z = b.size
    handle = 0.36 * x
    b.add(turned_grip(handle, z / 2).at(-x / 2 + handle, 0, z / 2), materials.plain("black"))
    b.add(cylinder(0.5 * z, 0.012, 12).turned("y", 90).at(-x / 2 + handle, 0, z / 2), materials.metal("silver"))
    b.add(
        lathe([(0.2 * z, 0), (0.2 * z, 0.95 * (x - handle)), (0.05 * z, x - handle)], 8)
        .turned("y", 90)
        .at(-x / 2 + handle, 0, z / 2),
        materials.metal("steel"),
    )


CATEGORIES = [
    Entry("hammer", hammer, (0.320, 0.125, 0.030), 0.55, 4),
    Entry("saw", saw, (0.560, 0.150, 0.026), 0.45, 3),
    Entry("screwdriver", screwdriver, (0.230, 0.032, 0.032), 0.11, 4),
    Entry("drill", drill, (0.240, 0.080, 0.220), 1.5, 4, rest="upright"),
    Entry("trowel", trowel, (0.300, 0.080, 0.045), 0.25, 3),
    Entry("caliper", caliper, (0.230, 0.075, 0.014), 0.16, 2),
    Entry("scissors", scissors, (0.210, 0.085, 0.012), 0.09, 3),
    Entry("clout_nail", nail, (0.050, 0.009, 0.009), 0.004, 2),
    Entry("straight_pin", nail, (0.034, 0.004, 0.004), 0.0003, 2, options={"colour": "bright", "head": 0.9}),
    Entry("thumbtack", thumbtack, (0.010, 0.010, 0.016), 0.0008, 2, uniform=True),
    Entry("paper_clip", paper_clip, (0.034, 0.009, 0.0015), 0.0005, 2),
    Entry("bulldog_clip", bulldog_clip, (0.050, 0.041, 0.020), 0.015, 2),
    Entry("tape", tape, (0.095, 0.095, 0.024), 0.07, 3, uniform=True),
    Entry("foot_rule", ruler, (0.305, 0.032, 0.003), 0.030, 3),
    Entry("honing_steel", steel_rod, (0.350, 0.034, 0.034), 0.25, 2),
]  # fmt: skip
