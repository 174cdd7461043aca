"""Meat, fish and poultry, raw or done."""

from __future__ import annotations

import math

import numpy as np

from ..shapes import materials
from ..shapes.bricks import ball, block, cylinder, extrusion, lathe, prism, rod, soft_box, tube
from .entry import Entry
from .model import ObjectBuilder
from .vegetables import swept


def slab(b: ObjectBuilder, *, colours: tuple, fat: bool = True, bone: bool = False) -> None:
    """A slice of meat: a rounded flat piece with an edge of fat, perhaps with a bone."""
    x, y, z = b.size
    meat = materials.skin(b.pick(colours), b.rng, 0.3, 0.06)
    t = np.arange(14) * 2 * math.pi / 14
    wobble = 1 - 0.14 * np.cos(2 * t + 0.6) - 0.06 * np.sin(3 * t)
    outline = np.c_[np.cos(t) * wobble, np.sin(t) * wobble]
    outline = (outline - outline.min(0)) / np.ptp(outline, axis=0) - 0.5
    points = [(float(px * x), float(py * y)) for px, py in outline]
    b.add(prism(points, z), meat)
    if fat:
        rim = [p for p in points if p[1] > 0]
        path = sorted(((px * 0.97, py * 0.97, z / 2) for px, py in rim), key=lambda p: p[0])
        b.add(tube(path, 0.48 * z, 6, hulls=0), materials.plain((0.95, 0.90, 0.82), "organic"))
    if bone:
        b.add(
            cylinder(0.12 * y, 0.004, 10).visual_only().at(0.15 * x, -0.1 * y, z - 0.002),
            materials.plain("cream", "organic"),
        )


def bird(b: ObjectBuilder) -> None:
    """A plucked chicken on its back: body, two legs, two wings."""
    x, y, z = b.size
    skin = materials.skin(b.pick(((0.93, 0.80, 0.66), (0.80, 0.52, 0.26))), b.rng, 0.12)
    b.add(ball(0.8 * x, 0.82 * y, z, 16).at(-0.1 * x), skin)
    for s in (-1, 1):
        leg = swept(
            [(0.05 * x, s * 0.3 * y, 0.45 * z), (0.28 * x, s * 0.28 * y, 0.55 * z), (0.48 * x, s * 0.16 * y, 0.42 * z)],
            [0.15 * y, 0.15 * y, 0.06 * y],
            8,
            hulls=1,
        )
        b.add(leg, skin)
        wing = swept(
            [(-0.3 * x, s * 0.36 * y, 0.5 * z), (-0.05 * x, s * 0.46 * y, 0.4 * z), (0.08 * x, s * 0.4 * y, 0.3 * z)],
            [0.07 * y, 0.06 * y, 0.04 * y],
            6,
            hulls=1,
        )
        b.add(wing, skin)


def drumstick(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = z / 2
    meat = materials.skin((0.70, 0.42, 0.20), b.rng, 0.2)
    b.add(
        lathe(
            [(0.3 * r, 0), (0.9 * r, 0.15 * x), (r, 0.3 * x), (0.6 * r, 0.52 * x), (0.28 * r, 0.66 * x)],
            12,
            split=[0.35 * x],
        )
        .at(z=-x / 2)
        .turned("y", 90)
        .at(z=r),
        meat,
    )
    b.add(
        lathe([(0.22 * r, 0.6 * x), (0.2 * r, 0.88 * x), (0.38 * r, 0.94 * x), (0.2 * r, x)], 8)
        .at(z=-x / 2)
        .turned("y", 90)
        .at(z=r),
        materials.plain("cream", "organic"),
    )


def sausage(b: ObjectBuilder) -> None:
    x, _, z = b.size
    path = [(t * (x - z), 0.12 * x * (0.25 - t * t) * 4 - 0.06 * x, z / 2) for t in np.linspace(-0.5, 0.5, 9)]
    radii = [0.3 * z, *[0.5 * z] * 7, 0.3 * z]
    b.add(swept(path, radii, 10, hulls=3), materials.skin(b.pick(((0.60, 0.30, 0.20), (0.72, 0.40, 0.30))), b.rng, 0.1))


def rib(b: ObjectBuilder) -> None:
    """A rack of ribs: a bent slab with bone ends."""
    x, y, z = b.size
    meat = materials.skin((0.55, 0.22, 0.14), b.rng, 0.25)
    b.add(soft_box(0.86 * x, y, z, 0.3 * z), meat)
    for k in range(6):
        yy = (k - 2.5) * y / 6.3
        b.add(
            rod((-x / 2, yy, z / 2), (x / 2, yy, z / 2), 0.22 * z, 6).visual_only(), materials.plain("cream", "organic")
        )
    b.add(block((x, 0.8 * y, 0.3 * z), (0, 0, z / 2)).collision_only(), meat)


def crab(b: ObjectBuilder) -> None:
    """A flat shell, eight legs, two claws."""
    x, y, z = b.size
    shell = materials.skin((0.82, 0.30, 0.16), b.rng, 0.2)
    b.add(ball(0.62 * x, 0.6 * y, z, 14), shell)
    for s in (-1, 1):
        for k in range(4):
            dx = (k - 1.9) * 0.13 * x
            knee, foot = (1.6 * dx, s * 0.4 * y, 0.8 * z), (2.0 * dx, s * 0.49 * y, 0)
            b.add(tube([(dx, s * 0.22 * y, 0.4 * z), knee, foot], 0.02 * y, 5, hulls=0), shell)
        claw = [(0.22 * x, s * 0.2 * y, 0.4 * z), (0.42 * x, s * 0.24 * y, 0.5 * z), (0.47 * x, s * 0.1 * y, 0.45 * z)]
        b.add(swept(claw, [0.03 * y, 0.06 * y, 0.02 * y], 7, hulls=1), shell)
        b.add(block((0.5 * x, 0.2 * y, 0.5 * z), (-0.02 * x, s * 0.4 * y, 0.3 * z)).collision_only(), shell)


def fish(b: ObjectBuilder) -> None:
    """A fish lying on its side along x: body, tail fin, back fin, eye."""
    x, y, z = b.size
    skin = materials.skin(b.pick(((0.60, 0.66, 0.70), (0.80, 0.52, 0.42), (0.50, 0.56, 0.50))), b.rng, 0.25, 0.03)
    body = 0.78 * x
    profile = [
        (0.05, 0),
        (0.16, 0.08),
        (0.36, 0.25),
        (0.48, 0.5),
        (0.46, 0.68),
        (0.32, 0.86),
        (0.12, 0.97),
        (0.03, 1.0),
    ]
    shape = (
        lathe(profile, 14, split=[0.35])
        .at(z=-0.5)
        .turned("y", 90)
        .scaled(body, 0.8 * y, z * 0.98)
        .at((x - body) / 2, 0, z / 2)
    )
    b.add(shape, skin)
    fin = materials.plain((0.45, 0.48, 0.52), "organic")
    root = x / 2 - body
    tail = [
        (root + 0.03 * x, -0.08 * y),
        (root + 0.03 * x, 0.08 * y),
        (-x / 2, 0.42 * y),
        (-x / 2 + 0.07 * x, 0),
        (-x / 2, -0.42 * y),
    ]
    b.add(
        extrusion([tail[0], tail[1], tail[2], tail[3], tail[4]], 0.004, [[tail[0], tail[1], tail[2], tail[4]]]).at(
            z=z / 2 - 0.002
        ),
        fin,
    )
    back = [(0.2 * x, 0.3 * y), (0.05 * x, 0.5 * y), (-0.12 * x, 0.42 * y), (-0.12 * x, 0.25 * y)]
    b.add(prism(back, 0.004).at(z=z / 2 - 0.002), fin)
    b.add(
        prism([(0.02 * x, -0.3 * y), (-0.06 * x, -0.3 * y), (-0.1 * x, -0.48 * y), (-0.02 * x, -0.44 * y)], 0.004)
        .visual_only()
        .at(z=z / 2),
        fin,
    )
    for h in (0.72, 0.28):
        b.add(
            ball(0.028 * x, 0.028 * x, 0.028 * x, 8).visual_only().at(0.41 * x, 0.1 * y, h * z - 0.014 * x),
            materials.plain("black", "organic"),
        )


def flat_meat(b: ObjectBuilder) -> None:
    """Folded slices of ham."""
    x, y, z = b.size
    meat = materials.skin((0.84, 0.42, 0.42), b.rng, 0.3, 0.05)
    for k in range(3):
        b.add(
            soft_box(x * (1 - 0.1 * k), y * (1 - 0.08 * k), z / 3, 0.12 * z).at((k - 1) * 0.02 * x, 0, k * z / 3), meat
        )


CATEGORIES = [
    Entry("fish", fish, (0.300, 0.090, 0.055), 0.45, 5),
    Entry("fillet", slab, (0.180, 0.080, 0.022), 0.17, 3,
          options={"colours": ((0.95, 0.62, 0.48), (0.94, 0.88, 0.82)), "fat": False}),
    Entry("steak", slab, (0.180, 0.120, 0.028), 0.30, 4, extra=4, wide=True,
          options={"colours": ((0.58, 0.16, 0.14), (0.45, 0.22, 0.14)), "bone": True}),
    Entry("beef", slab, (0.200, 0.130, 0.080), 1.00, 3, options={"colours": ((0.55, 0.14, 0.13),)}),
    Entry("pork", slab, (0.180, 0.110, 0.030), 0.35, 3, options={"colours": ((0.90, 0.62, 0.56),)}),
    Entry("prosciutto", flat_meat, (0.160, 0.090, 0.015), 0.10, 3),
    Entry("chicken", bird, (0.290, 0.200, 0.130), 1.50, 3, uniform=True),
    Entry("drumstick", drumstick, (0.135, 0.055, 0.055), 0.11, 3, uniform=True),
    Entry("sausage", sausage, (0.150, 0.036, 0.028), 0.08, 4),
    Entry("rib", rib, (0.160, 0.260, 0.030), 0.80, 3),
    Entry("crab", crab, (0.150, 0.220, 0.050), 0.60, 3, uniform=True),
]  # fmt: skip
