"""Chairs, stools, benches."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import bar, block, box, cylinder, hull, rod, soft_box, tube
from .entry import Entry
from .model import ObjectBuilder
from .parts import legs


def straight_chair(b: ObjectBuilder) -> None:
    """Four legs, a seat and a back of slats or a board; the sitter looks along +x."""
    x, y, z = b.size
    wood = materials.wood(b.pick(materials.WOODS), b.rng)
    seat = materials.fabric(b.pick(materials.CLOTHS), b.rng) if b.rng.random() < 0.5 else wood
    height = 0.45 if z > 0.7 else 0.5 * z
    leg = 0.038
    for sy in (-1, 1):
        yy = sy * (y - leg) / 2
        b.add(box(leg, leg, height - 0.02).at((x - leg) / 2 - 0.01, yy), wood)
        b.add(bar((-x / 2 + 0.05, yy, 0), (-x / 2 + 0.055, yy, height), leg, leg), wood)
        b.add(bar((-x / 2 + 0.055, yy, height), (-x / 2 + leg / 2, yy, z), leg, leg * 0.8), wood)
    if seat is wood:
        b.add(block((x - 0.03, y, 0.025), (0.015, 0, height)), wood)
    else:
        b.add(soft_box(x - 0.04, y - 0.01, 0.05).at(0.02, 0, height - 0.025), seat)
    back = b.pick(("slats", "board", "bars"))
    x_back = -x / 2 + 0.035
    if back == "board":
        b.add(block((0.018, y - 2 * leg, 0.5 * (z - height)), (x_back, 0, z - 0.3 * (z - height))), wood)
    elif back == "slats":
        for k in range(3):
            b.add(block((0.016, y - 2 * leg, 0.05), (x_back, 0, height + (k + 1) * (z - height) / 3 - 0.04)), wood)
    else:
        hulls = block((0.016, y - 2 * leg, z - height - 0.06), (x_back, 0, (z + height) / 2 - 0.01)).collision_only()
        b.add(hulls, wood)
        b.add(block((0.02, y - 2 * leg, 0.05), (x_back, 0, z - 0.03)).visual_only(), wood)
        for k in range(5):
            yy = (k - 2) * (y - 2 * leg) / 5.5
            b.add(rod((x_back, yy, height), (x_back, yy, z - 0.04), 0.009).visual_only(), wood)


def armchair(b: ObjectBuilder) -> None:
    """A padded chair with arms on short feet."""
    x, y, z = b.size
    cloth = b.pick((materials.fabric, materials.leather))(b.pick(materials.CLOTHS), b.rng)
    wood = materials.wood("walnut", b.rng)
    padded(b, x, y, z, cloth, wood, seats=1)


def padded(b: ObjectBuilder, x: float, y: float, z: float, cloth, wood, seats: int, arms: bool = True) -> None:
    """The body of an armchair or sofa: frame, back, arms, one cushion per seat."""
    foot = 0.09
    seat = 0.42
    arm = 0.14 if arms else 0.0
    back = 0.2
    legs(b, x - 0.06, y - 0.06, foot, 0.05, wood)
    b.add(soft_box(x, y - 2 * arm, 0.2, 0.02).at(0, 0, foot), cloth)
    b.add(soft_box(back, y - 2 * arm, z - foot - 0.2, 0.06).at(-x / 2 + back / 2, 0, foot + 0.2), cloth)
    if arms:
        for s in (-1, 1):
            b.add(soft_box(x, arm, 0.62 - foot, 0.05).at(0, s * (y - arm) / 2, foot), cloth)
    width = (y - 2 * arm) / seats
    for k in range(seats):
        yy = -(y - 2 * arm) / 2 + (k + 0.5) * width
        b.add(soft_box(x - back, width - 0.01, seat - foot - 0.2, 0.04).at(back / 2, yy, foot + 0.2), cloth)
        b.add(
            soft_box(0.12, width - 0.02, z - seat - 0.02, 0.05).at(-x / 2 + back + 0.03, yy, seat).visual_only(), cloth
        )


def stool(b: ObjectBuilder) -> None:
    x, y, z = b.size
    wood = materials.wood(b.pick(materials.WOODS), b.rng)
    if b.pick((True, False)):
        b.add(cylinder(x / 2, 0.035).at(z=z - 0.035), wood)
        for k in range(4):
            a = math.pi / 4 + k * math.pi / 2
            c, s = math.cos(a), math.sin(a)
            b.add(rod((0.47 * x * c, 0.47 * y * s, 0), (0.33 * x * c, 0.33 * y * s, z - 0.03), 0.016), wood)
    else:
        b.add(soft_box(x, y, 0.06).at(z=z - 0.06), materials.fabric(b.pick(materials.CLOTHS), b.rng))
        legs(b, x, y, z - 0.05, 0.036, wood)
    ring = [(0.36 * x * math.cos(t * math.pi / 8), 0.36 * y * math.sin(t * math.pi / 8), 0.3 * z) for t in range(16)]
    b.add(tube(ring, 0.008, 6, hulls=0, closed=True), wood)


def bench(b: ObjectBuilder) -> None:
    x, y, z = b.size
    wood = materials.wood(b.pick(materials.WOODS), b.rng)
    b.add(box(x, y, 0.04).at(z=z - 0.04), wood)
    for s in (-1, 1):
        b.add(box(x * 0.9, 0.04, z - 0.04).at(0, s * 0.4 * y), wood)
    b.add(block((0.04, 0.8 * y, 0.08), (0, 0, 0.45 * z)), wood)


def highchair(b: ObjectBuilder) -> None:
    """A child's chair: long splayed legs, a seat, a back, a tray in front."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("birch", "pine", "white")), b.rng)
    seat = 0.58 * z
    legs(b, x, y, seat, 0.035, wood, splay=0.07)
    b.add(block((x - 0.18, y - 0.14, 0.03), (-0.02, 0, seat)), materials.plain(b.pick(materials.BRIGHT)))
    b.add(block((0.025, y - 0.16, z - seat), (-x / 2 + 0.1, 0, (z + seat) / 2)), wood)
    for s in (-1, 1):
        b.add(block((x - 0.14, 0.022, 0.03), (0.02, s * (y / 2 - 0.08), seat + 0.2)), wood)
    b.add(soft_box(0.2, y - 0.08, 0.022).at(x / 2 - 0.1, 0, seat + 0.215), materials.plain("white"))


def rocking_chair(b: ObjectBuilder) -> None:
    """A chair on two curved runners."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("walnut", "cherry", "oak")), b.rng)
    seat = 0.42
    radius = 1.1
    half = math.asin(min(0.9, x / 2 / radius))
    for s in (-1, 1):
        yy = s * (y / 2 - 0.03)
        angles = [-half + k * half / 3 for k in range(7)]
        path = [(radius * math.sin(a), yy, 0.02 + radius * (1 - math.cos(a))) for a in angles]
        b.add(tube(path, 0.02, 8, hulls=3), wood)
        # A flat spot in the middle of the runner, on which the chair comes to rest.
        b.add(block((0.44, 0.036, 0.02), (-0.03, yy, 0.01)).collision_only(), wood)
        b.add(rod((0.2, yy, 0.04), (0.2, yy, seat + 0.2), 0.018), wood)
        b.add(rod((-0.2, yy, 0.04), (-0.25, yy, seat), 0.018), wood)
        b.add(bar((-0.25, yy, seat + 0.2), (0.24, yy, seat + 0.2), 0.045, 0.02), wood)
        b.add(bar((-0.24, yy, seat), (-x / 2 + 0.06, yy, z), 0.03, 0.03), wood)
    b.add(block((0.48, y - 0.06, 0.03), (-0.01, 0, seat)), wood)
    b.add(bar((-0.245, 0, seat + 0.1), (-x / 2 + 0.065, 0, z), y - 0.1, 0.018), wood)


def folding_chair(b: ObjectBuilder) -> None:
    """Crossed metal legs, a seat and a back plate."""
    x, y, z = b.size
    metal = materials.metal(b.pick(("steel", "dark_grey", "white")))
    seat = materials.plain(b.pick(("black", "white", "blue", "grey")))
    height = 0.44
    for s in (-1, 1):
        yy = s * (y / 2 - 0.015)
        b.add(rod((x / 2 - 0.02, yy, 0), (-x / 2 + 0.02, yy, z), 0.012), metal)
        b.add(rod((-x / 2 + 0.03, yy * 0.93, 0), (x / 2 - 0.08, yy * 0.93, height), 0.012), metal)
    b.add(block((0.38, y - 0.08, 0.025), (0.03, 0, height)), seat)
    b.add(block((0.02, y - 0.05, 0.2), (-x / 2 + 0.04, 0, z - 0.11)), seat)


def swivel_chair(b: ObjectBuilder) -> None:
    """An office chair: star foot with castors, a column, and a seat with back and arms that turns on it."""
    z = b.size[2]
    black = materials.plain("black")
    cloth = materials.fabric(b.pick(("dark_grey", "navy", "grey", "red")), b.rng)
    metal = materials.metal(b.pick(("chrome", "iron")))
    seat = 0.46
    reach = 0.30
    for k in range(5):
        a = 2 * math.pi * k / 5
        c, s = reach * math.cos(a), reach * math.sin(a)
        b.add(
            hull(
                [
                    (c * t + dx, s * t + dy, h)
                    for t, w, h0, h1 in ((0.1, 0.03, 0.07, 0.12), (1, 0.02, 0.05, 0.07))
                    for dx in (-w, w)
                    for dy in (-w, w)
                    for h in (h0, h1)
                ]
            ),
            metal,
        )
        b.add(soft_box(0.05, 0.05, 0.055, 0.02).at(c, s), black)
    b.add(cylinder(0.03, seat - 0.1, 12).at(z=0.08), metal)
    top = b.spin("seat", (0, 0, seat - 0.03), (0, 0, 1))
    top.add(soft_box(0.48, 0.48, 0.08).at(0.03, 0, seat - 0.02), cloth)
    top.add(bar((-0.18, 0, seat), (-0.26, 0, seat + 0.15), 0.06, 0.02), black)
    top.add(soft_box(0.06, 0.44, z - seat - 0.12).turned("y", -4).at(-0.26, 0, seat + 0.12), cloth)
    if b.pick((True, False)):
        for s in (-1, 1):
            top.add(rod((0.03, s * 0.25, seat), (0.03, s * 0.27, seat + 0.2), 0.014), black)
            top.add(soft_box(0.24, 0.05, 0.03).at(0.03, s * 0.27, seat + 0.2), black)


def chaise_longue(b: ObjectBuilder) -> None:
    """A long padded seat with a raised back at one end."""
    x, y, z = b.size
    cloth = materials.fabric(b.pick(materials.CLOTHS), b.rng)
    wood = materials.wood("walnut", b.rng)
    legs(b, x - 0.1, y - 0.06, 0.14, 0.05, wood)
    b.add(soft_box(x, y, 0.26, 0.05).at(0, 0, 0.14), cloth)
    b.add(bar((-x / 2 + 0.45, 0, 0.42), (-x / 2 + 0.05, 0, z - 0.05), y, 0.14), cloth)


CATEGORIES = [
    Entry("straight_chair", straight_chair, (0.48, 0.44, 0.92), 6.0, 12, rest="upright"),
    Entry("armchair", armchair, (0.84, 0.86, 0.88), 32.0, 8, rest="upright"),
    Entry("stool", stool, (0.36, 0.36, 0.55), 4.2, 8, rest="upright", vary=0.12),
    Entry("bench", bench, (0.38, 1.20, 0.45), 14.0, 4, rest="upright", vary=0.12),
    Entry("highchair", highchair, (0.60, 0.56, 0.98), 7.0, 3, rest="upright", vary=0.05),
    Entry("rocking_chair", rocking_chair, (0.86, 0.62, 1.08), 12.0, 3, rest="upright", vary=0.05),
    Entry("folding_chair", folding_chair, (0.48, 0.46, 0.82), 4.0, 4, rest="upright", vary=0.04),
    Entry("swivel_chair", swivel_chair, (0.64, 0.62, 1.02), 14.0, 6, rest="upright", vary=0.05),
    Entry("chaise_longue", chaise_longue, (1.65, 0.68, 0.82), 35.0, 3, rest="upright", vary=0.05),
]  # fmt: skip
