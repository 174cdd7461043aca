"""Shelves, racks, coat racks, pegboards."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import block, box, cylinder, lathe, rod, tube
from .entry import Entry
from .model import ObjectBuilder
from .parts import BOARD

WALL_BOARD, WALL_BOARD_SIZE = 14, (0.28, 0.90, 0.025)
"""Number of the model that is a single board for a wall, and its size in metres."""


def shelf(b: ObjectBuilder) -> None:
    """A bookcase: sides, back and boards; open to the front. Variants: ladder frame of metal, low and wide, cubes; and
    a board for a wall, whose bracket is out of sight."""
    if b.index == WALL_BOARD:
        b.add(box(*WALL_BOARD_SIZE), materials.wood("oak", b.rng))
        return
    x, y, z = b.size
    plan = b.pick(("bookcase", "metal", "cubes", "low"))
    wood = materials.wood(b.pick(materials.WOODS), b.rng) if b.rng.random() < 0.7 else materials.plain("white", "wood")
    if plan == "low":
        z *= 0.8
    if plan == "metal":
        iron = materials.metal(b.pick(("iron", "white", "steel")))
        for sx in (-1, 1):
            for sy in (-1, 1):
                b.add(box(0.028, 0.028, z).at(sx * (x - 0.028) / 2, sy * (y - 0.028) / 2), iron)
        count = max(3, round(z / 0.4))
        for k in range(count):
            b.add(block((x, y, 0.02), (0, 0, 0.1 + k * (z - 0.11) / (count - 1))), wood)
        return
    for s in (-1, 1):
        b.add(block((x, BOARD, z), (0, s * (y - BOARD) / 2, z / 2)), wood)
    b.add(block((0.006, y - 2 * BOARD, z), (-x / 2 + 0.003, 0, z / 2)), wood)
    count = max(2, round(z / 0.36)) + 1
    for k in range(count):
        height = 0.05 + k * (z - 0.05 - BOARD / 2) / (count - 1)
        b.add(block((x - 0.006, y - 2 * BOARD, BOARD), (0.003, 0, height)), wood)
    if plan == "cubes":
        b.add(block((x - 0.006, BOARD, z - 0.06), (0.003, 0, z / 2 + 0.02)), wood)


def towel_rack(b: ObjectBuilder) -> None:
    """A wall rail with two bars; its plates are at -x."""
    x, y, z = b.size
    metal = materials.metal(b.pick(("chrome", "brass", "iron")))
    for s in (-1, 1):
        b.add(box(0.012, 0.05, z).at(-x / 2 + 0.006, s * (y / 2 - 0.025)), metal)
        b.add(rod((-x / 2 + 0.01, s * (y / 2 - 0.025), z * 0.7), (x / 2, s * (y / 2 - 0.025), z * 0.7), 0.008), metal)
    b.add(rod((x / 2 - 0.01, -y / 2, z * 0.7), (x / 2 - 0.01, y / 2, z * 0.7), 0.009), metal)
    b.add(rod((0, -y / 2 + 0.02, z * 0.7), (0, y / 2 - 0.02, z * 0.7), 0.007), metal)


def coatrack(b: ObjectBuilder) -> None:
    """A standing coat rack: round foot, pole, hooks."""
    x, _, z = b.size
    wood = materials.wood(b.pick(("walnut", "oak", "birch")), b.rng)
    r = x / 2
    b.add(lathe([(r, 0), (0.95 * r, 0.03), (0.1, 0.06)], 20), wood)
    b.add(lathe([(0.028, 0.05), (0.022, 0.9 * z), (0.03, z)], 12), wood)
    for k in range(6):
        a = math.pi * k / 3
        c, s = math.cos(a), math.sin(a)
        up = z - 0.12 if k % 2 else z - 0.24
        b.add(rod((0.02 * c, 0.02 * s, up), (0.16 * c, 0.16 * s, up + 0.08), 0.011), wood)


def roll_holder(b: ObjectBuilder) -> None:
    """A foot and an upright pin for a kitchen roll."""
    x, _, z = b.size
    look = b.pick((materials.metal("chrome", b.rng), materials.wood("oak", b.rng), materials.plain("black")))
    b.add(lathe([(x / 2, 0), (0.48 * x, 0.018)], 24), look)
    b.add(cylinder(0.009, z - 0.02, 10).at(z=0.015), look)
    b.add(lathe([(0.014, z - 0.02), (0.016, z - 0.01), (0.006, z)], 10), look)


def dish_rack(b: ObjectBuilder) -> None:
    """A wire rack: a floor, four low sides, a row of prongs (seen), feet."""
    x, y, z = b.size
    wire = materials.metal(b.pick(("chrome", "white", "black")))
    low, rim = 0.03, 0.6 * z
    b.add(block((x, y, 0.008), (0, 0, low)).collision_only(), wire)
    for s in (-1, 1):
        b.add(block((0.006, y, rim - low), (s * (x / 2 - 0.003), 0, (rim + low) / 2)).collision_only(), wire)
        b.add(block((x, 0.006, rim - low), (0, s * (y / 2 - 0.003), (rim + low) / 2)).collision_only(), wire)
        for h in (low, rim):
            b.add(rod((s * x / 2, -y / 2, h), (s * x / 2, y / 2, h), 0.004, 6).visual_only(), wire)
            b.add(rod((-x / 2, s * y / 2, h), (x / 2, s * y / 2, h), 0.004, 6).visual_only(), wire)
    b.add(box(0.9 * x, 0.9 * y, low).collision_only(), wire)
    for k in range(9):
        yy = (k - 4) * y / 9
        b.add(
            tube(
                [(-x / 2, yy, low), (-0.2 * x, yy, low), (-0.2 * x, yy, z), (-0.1 * x, yy, low), (x / 2, yy, low)],
                0.0028,
                5,
                hulls=0,
            ),
            wire,
        )
    for sx in (-1, 1):
        for sy in (-1, 1):
            b.add(
                rod((sx * 0.45 * x, sy * 0.45 * y, 0), (sx * 0.45 * x, sy * 0.45 * y, low), 0.006, 6).visual_only(),
                wire,
            )


def fence(b: ObjectBuilder) -> None:
    """A rail fence: posts and three rails."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("pine", "white", "teak")), b.rng)
    for k in (-1, 0, 1):
        b.add(box(x, 0.09, z).at(0, k * (y / 2 - 0.045)), wood)
    for h in (0.25, 0.55, 0.85):
        b.add(block((0.4 * x, y, 0.1), (0, 0, h * z)), wood)


def ladder(b: ObjectBuilder) -> None:
    """A step ladder standing open."""
    x, y, z = b.size
    metal = b.pick((materials.metal("steel", b.rng), materials.wood("pine", b.rng), materials.plain("orange")))
    for s in (-1, 1):
        yy = s * (y / 2 - 0.02)
        b.add(rod((x / 2 - 0.02, yy, 0), (0.03, 0.85 * yy, z), 0.02), metal)
        b.add(rod((-x / 2 + 0.02, yy, 0), (-0.03, 0.85 * yy, z), 0.016), metal)
    steps = max(3, round(z / 0.26))
    for k in range(1, steps):
        t = k / steps
        px = (x / 2 - 0.02) * (1 - t) + 0.03 * t
        b.add(block((0.09, (y - 0.04) * (1 - 0.15 * t), 0.02), (px - 0.01, 0, t * z)), metal)
    b.add(box(0.2, 0.9 * y, 0.025).at(z=z - 0.01), metal)


def pegboard(b: ObjectBuilder) -> None:
    """A board of holes for a wall; its back is at -x."""
    x, y, z = b.size
    image = textures.custom(lambda d: d.ellipse([5, 5, 10, 10], fill=(60, 45, 35)), (16, 16), (0.80, 0.68, 0.50))
    b.add(box(x, y, z), materials.picture("pegs", image, 0.05, "wood"))


CATEGORIES = [
    Entry("shelf", shelf, (0.34, 0.85, 1.60), 28.0, WALL_BOARD, extra=1, fixed=True, rest="upright", vary=0.18),
    Entry("towel_rack", towel_rack, (0.120, 0.600, 0.080), 1.0, 3, fixed=True, rest="upright"),
    Entry("coatrack", coatrack, (0.420, 0.420, 1.750), 5.0, 3, rest="upright", uniform=True, fixed=True),
    Entry("paper_towel_holder", roll_holder, (0.150, 0.150, 0.320), 0.5, 3, rest="upright", uniform=True),
    Entry("dish_rack", dish_rack, (0.340, 0.460, 0.130), 1.1, 3, rest="upright"),
    Entry("rail_fence", fence, (0.090, 2.000, 1.050), 25.0, 2, fixed=True, rest="upright"),
    Entry("ladder", ladder, (0.850, 0.480, 1.300), 6.0, 3, rest="upright"),
    Entry("pegboard", pegboard, (0.008, 0.800, 0.600), 2.5, 2, fixed=True, rest="upright"),
]  # fmt: skip
