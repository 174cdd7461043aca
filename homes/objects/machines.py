"""Big machines: lawn mower, treadmill, piano, car."""

from __future__ import annotations

from ..shapes import materials, textures
from ..shapes.bricks import ball, block, box, cylinder, decal, hull, rod, soft_box
from .entry import Entry
from .model import ObjectBuilder
from .parts import button


def lawn_mower(b: ObjectBuilder) -> None:
    """Deck on four wheels, motor, push bar; the blade is a slicer box underneath."""
    x, y, z = b.size
    look = materials.plain(b.pick(("green", "red", "orange")), "metal", 0.6)
    dark = materials.plain("black", "rubber")
    deck = 0.55 * x
    front = x / 2
    b.add(soft_box(deck, 0.8 * y, 0.14, 0.03).at(front - deck / 2, 0, 0.08), look)
    b.add(cylinder(0.1, 0.13, 14).at(front - deck / 2, 0, 0.21), dark)
    for sx, r in ((front - 0.09, 0.09), (front - deck + 0.09, 0.11)):
        for s in (-1, 1):
            b.add(cylinder(r, 0.05, 16).at(z=-0.025).turned("x", 90).at(sx, s * (0.4 * y + 0.03), r), dark)
    for s in (-1, 1):
        b.add(
            rod((front - deck + 0.05, s * 0.3 * y, 0.18), (-x / 2 + 0.05, s * 0.24 * y, z - 0.02), 0.013),
            materials.metal("iron"),
        )
    b.add(rod((-x / 2 + 0.05, -0.25 * y, z - 0.02), (-x / 2 + 0.05, 0.25 * y, z - 0.02), 0.016), dark)
    b.point("toggle_button", (front - deck / 2, 0, 0.34))
    b.area("slicer", (0.7 * deck, 0.06, 0.006), (front - deck / 2, 0, 0.06))


def treadmill(b: ObjectBuilder) -> None:
    """A belt deck with two posts, rails and a console at -x; the runner faces the console."""
    x, y, z = b.size
    dark, grey = materials.plain("black", "rubber"), materials.plain("grey")
    b.add(box(x, y, 0.14), grey)
    b.add(box(0.9 * x, 0.64 * y, 0.004).visual_only().at(0.03 * x, 0, 0.14), dark)
    for s in (-1, 1):
        b.add(block((0.06, 0.06, z - 0.14), (-x / 2 + 0.16, s * (y / 2 - 0.04), (z + 0.14) / 2 - 0.06)), grey)
        b.add(block((0.55, 0.04, 0.04), (-x / 2 + 0.45, s * (y / 2 - 0.04), 0.92)), dark)
    b.add(soft_box(0.12, 0.9 * y, 0.2, 0.03).turned("y", -25).at(-x / 2 + 0.15, 0, z - 0.22), grey)
    panel = materials.picture("display", textures.screen(b.rng, (0.02, 0.15, 0.2)), kind="screen")
    b.add(decal(0.5 * y, 0.13).turned("y", -25).at(-x / 2 + 0.2, 0, z - 0.1), panel)
    button(b, (-x / 2 + 0.21, 0.3 * y, z - 0.14), materials.plain("red"))


def piano(b: ObjectBuilder) -> None:
    """An upright piano: case, key bed, keyboard, pedals."""
    x, y, z = b.size
    wood = b.pick((materials.plain("black", "wood", 0.9), materials.wood("walnut", b.rng)))
    depth = 0.55 * x
    b.add(box(depth, y, z).at(-x / 2 + depth / 2), wood)
    b.add(block((x - depth + 0.02, y, 0.13), (x / 2 - (x - depth) / 2 - 0.01, 0, 0.65)), wood)
    for s in (-1, 1):
        b.add(box(0.06, 0.06, 0.6).at(x / 2 - 0.04, s * (y / 2 - 0.05)), wood)

    def draw_keys(draw) -> None:
        for k in range(32):
            draw.rectangle([k * 8, 0, k * 8, 32], fill=(120, 120, 120))
            if k % 7 in (1, 2, 4, 5, 6):
                draw.rectangle([k * 8 - 2, 0, k * 8 + 2, 19], fill=(10, 10, 10))

    keys = textures.custom(draw_keys, (256, 32), (0.97, 0.97, 0.95), 4)
    b.add(
        decal(0.94 * y, 0.8 * (x - depth), "z").at(x / 2 - 0.5 * (x - depth), 0, 0.716), materials.picture("keys", keys)
    )
    b.add(block((0.02, 0.6, 0.2), (-x / 2 + depth + 0.01, 0, 0.9)).visual_only(), wood)
    for k in range(3):
        b.add(
            block((0.08, 0.02, 0.01), (-x / 2 + depth + 0.04, (k - 1) * 0.07, 0.06)).visual_only(),
            materials.metal("brass"),
        )


def car(b: ObjectBuilder) -> None:
    """A small car: floor, side walls, roof on pillars, seats; doors on both sides open, its front along +x."""
    x, y, z = b.size
    paint = materials.plain(b.pick(("red", "blue", "silver", "dark_green")), "metal", 0.9)
    dark, glass = materials.plain("black", "rubber"), materials.glass("sky", 0.35)
    low, waist = 0.2 * z, 0.6 * z
    b.add(block((0.94 * x, y - 0.1, 0.08), (0, 0, low)), dark)
    b.add(
        hull(
            [
                (px * x, s * y / 2 * w, pz * z)
                for px, pz, w in ((0.5, 0.18, 0.92), (0.5, 0.42, 0.9), (0.18, 0.6, 1), (0.18, 0.18, 1))
                for s in (-1, 1)
            ]
        ),
        paint,
    )
    b.add(
        hull(
            [
                (px * x, s * y / 2 * w, pz * z)
                for px, pz, w in ((-0.5, 0.2, 0.92), (-0.5, 0.56, 0.9), (-0.26, 0.6, 1), (-0.26, 0.18, 1))
                for s in (-1, 1)
            ]
        ),
        paint,
    )
    b.add(
        hull(
            [
                (px * x, s * y / 2 * w, pz * z)
                for px, pz, w in ((-0.2, 1.0, 0.78), (0.04, 1.0, 0.78), (-0.3, 0.96, 0.8), (0.1, 0.96, 0.8))
                for s in (-1, 1)
            ]
        ),
        paint,
    )
    for s in (-1, 1):
        side = s * (y / 2 - 0.03)
        for top, foot in (((0.08, 0.97), (0.2, 0.6)), ((-0.28, 0.97), (-0.36, 0.58))):
            b.add(rod((foot[0] * x, side, foot[1] * z), (top[0] * x, s * 0.4 * y, top[1] * z), 0.035), paint)
        b.add(block((0.46 * x, 0.05, 0.1), (-0.04 * x, side, low)), paint)
        span = (-0.255 * x, 0.175 * x)
        link = b.hinge(f"door_{'left' if s > 0 else 'right'}", (span[1], s * y / 2, waist / 2), (0, 0, -s), 1.1)
        panel = block(
            (span[1] - span[0] - 0.01, 0.05, waist - low - 0.06),
            ((span[0] + span[1]) / 2, s * (y / 2 - 0.025), (waist + low) / 2 + 0.02),
        )
        link.add(panel, paint)
        pane = [(span[0] + 0.02, waist), (span[1] - 0.04, waist), (0.06 * x, 0.95 * z), (-0.24 * x, 0.95 * z)]
        lean = [(px, s * (y / 2 - 0.03 - 0.1 * y * (pz - waist) / (0.4 * z)), pz) for px, pz in pane]
        link.add(hull(lean + [(px, py - s * 0.008, pz) for px, py, pz in lean]), glass)
        link.add(block((0.14, 0.02, 0.03), (span[0] + 0.14, s * (y / 2 + 0.008), waist - 0.06)).visual_only(), dark)
        for px in (0.32, -0.34):
            b.add(cylinder(0.2 * z, 0.16, 20).at(z=-0.08).turned("x", 90).at(px * x, s * (y / 2 - 0.08), 0.2 * z), dark)
            b.add(
                cylinder(0.11 * z, 0.165, 12)
                .visual_only()
                .at(z=-0.0825)
                .turned("x", 90)
                .at(px * x, s * (y / 2 - 0.08), 0.2 * z),
                materials.metal("silver"),
            )
        b.add(
            ball(0.05, 0.14, 0.12, 10).visual_only().at(0.485 * x, s * 0.34 * y, 0.36 * z),
            materials.plain("cream", "glass", 0.9),
        )
        b.add(soft_box(0.5, 0.42 * y, 0.14, 0.04).at(-0.06 * x, s * 0.22 * y, low + 0.06), dark)
        b.add(soft_box(0.14, 0.42 * y, 0.5, 0.04).turned("y", -10).at(-0.13 * x, s * 0.22 * y, low + 0.15), dark)
    front = [
        (0.19 * x, -0.4 * y, waist),
        (0.19 * x, 0.4 * y, waist),
        (0.09 * x, 0.36 * y, 0.96 * z),
        (0.09 * x, -0.36 * y, 0.96 * z),
    ]
    rear = [
        (-0.35 * x, -0.4 * y, waist),
        (-0.35 * x, 0.4 * y, waist),
        (-0.28 * x, 0.36 * y, 0.96 * z),
        (-0.28 * x, -0.36 * y, 0.96 * z),
    ]
    for pane in (front, rear):
        b.add(hull(pane + [(px + 0.01, py, pz) for px, py, pz in pane]), glass)
    button(b, (0.19 * x, 0.15 * y, 0.62 * z), materials.plain("red"), 0.02)


CATEGORIES = [
    Entry("lawn_mower", lawn_mower, (1.400, 0.520, 1.000), 22.0, 3, rest="upright", vary=0.05),
    Entry("treadmill", treadmill, (1.700, 0.780, 1.350), 80.0, 3, fixed=True, rest="upright", vary=0.05),
    Entry("piano", piano, (0.600, 1.480, 1.220), 210.0, 3, fixed=True, rest="upright", vary=0.04),
    Entry("car", car, (3.600, 1.620, 1.450), 950.0, 4, fixed=True, rest="upright", vary=0.05),
]  # fmt: skip
