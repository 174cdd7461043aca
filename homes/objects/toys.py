"""Toys and games: balls, toy cars, blocks, bears, board games, darts, a guitar, a bell."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import ball, block, box, cylinder, decal, extrusion, hull, lathe, rod, sleeve, soft_box
from .entry import Entry
from .model import ObjectBuilder
from .packages import printed


def play_ball(b: ObjectBuilder) -> None:
    """A ball: striped beach ball, football or plain rubber."""
    x, y, z = b.size
    first, second = b.pick((("red", "white"), ("blue", "yellow"), ("green", "white"), ("orange", "orange")))
    look = materials.picture(
        "stripes", textures.stripes(materials.colour(first), materials.colour(second), 3), x / 1.5, "rubber", 0.5
    )
    b.add(ball(x, y, z, 20), look)


def toy(b: ObjectBuilder) -> None:
    """By model: a toy car, a stack of blocks, a teddy bear, a boat."""
    x, y, z = b.size
    plan = b.pick(("car", "blocks", "bear", "boat"))
    colours = [materials.plain(c) for c in b.rng.sample(materials.BRIGHT, 4)]
    if plan == "car":
        b.add(soft_box(x, 0.8 * y, 0.42 * z, 0.1 * z).at(z=0.18 * z), colours[0])
        b.add(soft_box(0.55 * x, 0.7 * y, 0.42 * z, 0.12 * z).at(-0.05 * x, 0, 0.58 * z), materials.glass("sky", 0.8))
        for sx in (-0.3, 0.3):
            for s in (-1, 1):
                wheel = (
                    cylinder(0.2 * z, 0.14 * y, 14).at(z=-0.07 * y).turned("x", 90).at(sx * x, s * 0.42 * y, 0.2 * z)
                )
                b.add(wheel, materials.plain("black", "rubber"))
    elif plan == "blocks":
        e = min(x, y) / 2.1
        for k, (px, py, level) in enumerate(((-0.55, -0.5, 0), (0.55, -0.45, 0), (0, 0.55, 0), (0.02, -0.1, 1))):
            b.add(soft_box(e, e, e, 0.06 * e, 1).at(px * e, py * e, level * e), colours[k])
    elif plan == "bear":
        fur = materials.fabric(b.rng.choice(("brown", "tan", "cream")), b.rng)
        b.add(ball(0.62 * x, 0.6 * y, 0.58 * z, 12), fur)
        b.add(ball(0.5 * x, 0.55 * y, 0.44 * z, 12).at(z=0.52 * z), fur)
        for s in (-1, 1):
            b.add(ball(0.16 * x, 0.18 * y, 0.18 * z, 8).visual_only().at(0, s * 0.22 * y, 0.84 * z), fur)
            b.add(ball(0.42 * x, 0.22 * y, 0.22 * z, 8).at(0.28 * x, s * 0.24 * y), fur)
            b.add(ball(0.2 * x, 0.2 * y, 0.36 * z, 8).turned("x", s * 28).at(0.1 * x, s * 0.36 * y, 0.24 * z), fur)
            b.add(
                ball(0.05 * x, 0.05 * y, 0.05 * z, 6).visual_only().at(0.22 * x, s * 0.1 * y, 0.76 * z),
                materials.plain("black"),
            )
        b.add(
            ball(0.16 * x, 0.16 * y, 0.13 * z, 8).visual_only().at(0.23 * x, 0, 0.62 * z),
            materials.plain("cream", "fabric"),
        )
    else:
        hull_points = [
            (px * x, s * w * y, h * z)
            for px, w, h in ((-0.45, 0.3, 0), (0.2, 0.3, 0), (-0.5, 0.45, 0.4), (0.2, 0.45, 0.4))
            for s in (-1, 1)
        ]
        b.add(hull([*hull_points, (0.5 * x, 0, 0.45 * z), (0.35 * x, 0, 0)]), colours[0])
        b.add(soft_box(0.4 * x, 0.5 * y, 0.3 * z, 0.04 * z).at(-0.15 * x, 0, 0.4 * z), colours[1])
        b.add(cylinder(0.07 * x, 0.3 * z, 12).at(-0.15 * x, 0, 0.7 * z), colours[2])


def board_game(b: ObjectBuilder) -> None:
    x, y, z = b.size
    ground = b.pick(("blue", "red", "green", "purple"))
    b.add(box(x, y, z), materials.plain(ground, "cardboard"))
    b.add(decal(0.97 * y, 0.97 * x, "z").at(z=z + 0.0004), printed(b, ground, "yellow", (96, 96)))
    b.add(decal(0.9 * y, 0.7 * z).at(x / 2 + 0.0004, 0, z / 2), printed(b, ground, "white", (96, 32)))


def dart(b: ObjectBuilder) -> None:
    x, _, z = b.size
    b.add(
        lathe(
            [
                (0.0, 0),
                (0.12 * z, 0.25 * x),
                (0.22 * z, 0.3 * x),
                (0.22 * z, 0.6 * x),
                (0.1 * z, 0.65 * x),
                (0.1 * z, 0.8 * x),
            ],
            8,
            split=[0.25 * x],
        )
        .turned("y", -90)
        .at(x / 2, 0, z / 2),
        materials.metal("brass"),
    )
    for a in (45, 135):
        b.add(
            block((0.28 * x, 0.001, z)).turned("x", a).at(-0.36 * x, 0, z / 2),
            materials.plain(b.pick(("red", "blue", "green"))),
        )


def dartboard(b: ObjectBuilder) -> None:
    """A round board for a wall; its back at -x."""
    x, _, z = b.size
    r = z / 2
    b.add(cylinder(r, x, 24).turned("y", 90).at(-x / 2, 0, r), materials.plain("black", "fabric"))

    def rings(draw) -> None:
        for k in range(20):
            fill = (20, 20, 20) if k % 2 else (235, 225, 195)
            draw.pieslice([4, 4, 91, 91], k * 18 - 9, k * 18 + 9, fill=fill)
        for radius, fill in ((26, (180, 30, 30)), (23, None), (7, (30, 110, 50)), (3, (190, 30, 30))):
            if fill:
                draw.ellipse(
                    [48 - radius, 48 - radius, 48 + radius, 48 + radius],
                    outline=fill if radius > 10 else None,
                    width=3,
                    fill=None if radius > 10 else fill,
                )

    b.add(
        decal(1.38 * r, 1.38 * r).at(x / 2 + 0.0005, 0, r),
        materials.picture("rings", textures.custom(rings, (96, 96), (0.08, 0.08, 0.08))),
    )


def guitar(b: ObjectBuilder) -> None:
    """An acoustic guitar lying on its back: body with a waist, sound hole, neck, head."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("pine", "cherry", "oak")), b.rng)
    dark = materials.wood("ebony", b.rng)
    body = 0.48 * x
    start = x / 2 - body
    outline = []
    for k in range(24):
        a = 2 * math.pi * k / 24
        u = -math.cos(a)
        wide = (0.5 if u > 0 else 0.38) * y * (1 - 0.16 * math.exp(-((u + 0.1) ** 2) / 0.05))
        outline.append((start + body / 2 + u * body / 2, -wide * math.sin(a)))
    lower = [p for p in outline if p[0] >= start + 0.48 * body]
    upper = [p for p in outline if p[0] <= start + 0.52 * body]
    b.add(extrusion(outline, z * 0.9, [lower, upper]), wood)
    b.add(cylinder(0.13 * y, 0.001, 20).visual_only().at(start + 0.38 * body, 0, 0.9 * z), materials.plain("black"))
    b.add(box(0.02, 0.3 * y, 0.012).visual_only().at(start + 0.75 * body, 0, 0.9 * z), dark)
    b.add(block((x - body + 0.15 * body, 0.055, 0.025), (start - (x - body) / 2 + 0.07 * body, 0, 0.93 * z)), dark)
    b.add(block((0.13 * x, 0.085, 0.018), (-x / 2 + 0.065 * x, 0, 0.9 * z)), wood)
    for k in range(6):
        yy = (k - 2.5) * 0.008
        b.add(
            rod(
                (start + 0.75 * body, yy, 0.95 * z + 0.012), (-x / 2 + 0.1 * x, yy, 0.95 * z + 0.01), 0.0006, 4
            ).visual_only(),
            materials.metal("silver"),
        )


def bell(b: ObjectBuilder) -> None:
    """A hand bell with a wooden grip."""
    x, _, z = b.size
    r = x / 2
    b.add(lathe([(r, 0), (0.85 * r, 0.1 * z), (0.6 * r, 0.35 * z), (0.25 * r, 0.5 * z)], 20), materials.metal("brass"))
    b.add(
        lathe([(0.16 * r, 0.5 * z), (0.26 * r, 0.7 * z), (0.2 * r, 0.9 * z), (0.28 * r, z)], 12),
        materials.wood("walnut", b.rng),
    )
    b.point("toggle_button", (0, 0, z))


def trinket(b: ObjectBuilder) -> None:
    """A small ornament: a figure on a round foot."""
    x, _, z = b.size
    r = x / 2
    look = materials.plain(b.pick(("porcelain", "gold", "sky")), "ceramic", 0.8)
    b.add(
        lathe(
            [(r, 0), (0.9 * r, 0.08 * z), (0.3 * r, 0.14 * z), (0.55 * r, 0.4 * z), (0.3 * r, 0.66 * z)],
            16,
            split=[0.14 * z],
        ),
        look,
    )
    b.add(ball(0.75 * r, 0.75 * r, 0.36 * z, 12).at(z=0.64 * z), look)
    b.add(sleeve([(0.92 * r, 0.03 * z), (0.95 * r, 0.07 * z)]), materials.metal("gold"))


def ice_cube(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(soft_box(x, y, z, 0.15 * z), materials.glass("sky", 0.55))


CATEGORIES = [
    Entry("ball", play_ball, (0.210, 0.210, 0.210), 0.30, 5, uniform=True, vary=0.25),
    Entry("toy", toy, (0.190, 0.130, 0.120), 0.25, 8, rest="upright"),
    Entry("board_game", board_game, (0.270, 0.270, 0.055), 0.9, 4),
    Entry("dart", dart, (0.150, 0.040, 0.040), 0.022, 2),
    Entry("dartboard", dartboard, (0.040, 0.450, 0.450), 4.5, 2, rest="upright", fixed=True, uniform=True),
    Entry("guitar", guitar, (1.000, 0.380, 0.105), 2.0, 3),
    Entry("bell", bell, (0.075, 0.075, 0.140), 0.25, 3, rest="standing", uniform=True),
    Entry("folderal", trinket, (0.070, 0.070, 0.130), 0.18, 3, rest="standing", uniform=True),
    Entry("ice_cube", ice_cube, (0.030, 0.030, 0.028), 0.022, 3, uniform=True),
]
