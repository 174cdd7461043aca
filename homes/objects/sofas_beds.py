"""Sofas, beds, cribs."""

from __future__ import annotations

from ..shapes import materials
from ..shapes.bricks import block, box, join, rod, sheet, soft_box
from .chairs import padded
from .cloths import cloth
from .entry import Entry
from .model import ObjectBuilder
from .parts import legs


def sofa(b: ObjectBuilder) -> None:
    """Two or three seats, with or without arms, or a corner piece."""
    x, y, z = b.size
    cover = b.pick((materials.fabric, materials.leather))(b.pick(materials.CLOTHS), b.rng)
    wood = materials.wood("walnut", b.rng)
    padded(b, x, y, z, cover, wood, seats=2 if y < 1.8 else 3)
    if b.pick((True, False, True)):
        for s in (-1, 1):
            cushion = soft_box(0.13, 0.4, 0.38, 0.06).turned("y", -12).visual_only()
            b.add(cushion.at(-x / 2 + 0.4, s * (y / 2 - 0.36), 0.42), cloth(b))


def bed(b: ObjectBuilder) -> None:
    """Frame, headboard, mattress, blanket and pillows; the head is at -x."""
    x, y, z = b.size
    wood = (
        materials.wood(b.pick(materials.WOODS), b.rng)
        if b.pick((True, True, False))
        else materials.leather(b.pick(("grey", "beige")), b.rng)
    )
    rail, mattress = 0.30, 0.2
    legs(b, x, y, rail - 0.12, 0.07, wood)
    for s in (-1, 1):
        b.add(block((x, 0.03, 0.16), (0, s * (y - 0.03) / 2, rail - 0.04)), wood)
    b.add(block((0.03, y, 0.16), (x / 2 - 0.015, 0, rail - 0.04)), wood)
    b.add(block((x - 0.06, y - 0.06, 0.03), (0, 0, rail - 0.1)), wood)
    head = b.pick(("board", "slats", "soft"))
    if head == "slats":
        for s in (-1, 1):
            b.add(box(0.05, 0.05, z).at(-x / 2 + 0.025, s * (y - 0.05) / 2), wood)
        for k in range(3):
            b.add(block((0.025, y - 0.1, 0.09), (-x / 2 + 0.025, 0, rail + 0.15 + k * (z - rail - 0.2) / 2)), wood)
    elif head == "board":
        b.add(block((0.04, y, z - rail + 0.12), (-x / 2 + 0.02, 0, (z + rail - 0.12) / 2)), wood)
    else:
        b.add(
            soft_box(0.1, y, z - rail + 0.1, 0.04).at(-x / 2 + 0.05, 0, rail - 0.1),
            materials.fabric(b.pick(materials.CLOTHS), b.rng),
        )
    top = rail - 0.085 + mattress
    b.add(soft_box(x - 0.09, y - 0.07, mattress, 0.05).at(0.0, 0, rail - 0.085), materials.plain("white", "fabric"))
    blanket = cloth(b)
    b.add(soft_box(0.68 * x, y - 0.04, 0.07, 0.03).visual_only().at(x / 2 - 0.34 * x - 0.03, 0, top - 0.045), blanket)
    for s in (-1, 1):
        drop = block((0.66 * x, 0.012, 0.2), (x / 2 - 0.34 * x - 0.03, s * (y / 2 - 0.018), top - 0.1)).visual_only()
        b.add(drop, blanket)
    count = 1 if y < 1.2 else 2
    for k in range(count):
        yy = 0.0 if count == 1 else (k - 0.5) * 0.5 * y
        pillow = soft_box(0.4, min(0.65, 0.42 * y if count == 2 else 0.65 * y), 0.12, 0.055, 3)
        b.add(pillow.visual_only().at(-x / 2 + 0.3, yy, top - 0.02), materials.plain("cream", "fabric"))


def crib(b: ObjectBuilder) -> None:
    """A cot: four barred sides around a mattress."""
    x, y, z = b.size
    wood = materials.wood(b.pick(("white", "pine", "birch")), b.rng)
    for sx in (-1, 1):
        for sy in (-1, 1):
            b.add(box(0.05, 0.05, z).at(sx * (x - 0.05) / 2, sy * (y - 0.05) / 2), wood)
    low = 0.28
    for s in (-1, 1):
        hulls = block((x - 0.1, 0.025, z - low), (0, s * (y - 0.05) / 2, (z + low) / 2)).collision_only()
        hulls += block((0.025, y - 0.1, z - low), (s * (x - 0.05) / 2, 0, (z + low) / 2)).collision_only()
        b.add(hulls, wood)
        for h in (low + 0.025, z - 0.025):
            b.add(block((x - 0.1, 0.03, 0.05), (0, s * (y - 0.05) / 2, h)).visual_only(), wood)
            b.add(block((0.03, y - 0.1, 0.05), (s * (x - 0.05) / 2, 0, h)).visual_only(), wood)
        bars = [
            rod(
                (-x / 2 + (k + 1) * x / 11, s * (y - 0.05) / 2, low),
                (-x / 2 + (k + 1) * x / 11, s * (y - 0.05) / 2, z),
                0.009,
                6,
            )
            for k in range(10)
        ]
        bars += [
            rod(
                (s * (x - 0.05) / 2, -y / 2 + (k + 1) * y / 7, low),
                (s * (x - 0.05) / 2, -y / 2 + (k + 1) * y / 7, z),
                0.009,
                6,
            )
            for k in range(6)
        ]
        b.add(join(bars).visual_only(), wood)
    b.add(block((x - 0.06, y - 0.06, 0.02), (0, 0, low)), wood)
    b.add(soft_box(x - 0.1, y - 0.1, 0.1, 0.03).at(z=low + 0.01), materials.plain("white", "fabric"))
    b.add(sheet(0.5 * x, y - 0.12, 0.02, 0.012).visual_only().at(0.2 * x, 0, low + 0.105), cloth(b))


CATEGORIES = [
    Entry("sofa", sofa, (0.90, 2.00, 0.84), 62.0, 10, fixed=True, rest="upright", vary=0.12),
    Entry("bed", bed, (2.06, 1.50, 1.00), 75.0, 12, fixed=True, rest="upright", vary=0.08),
    Entry("crib", crib, (1.25, 0.68, 0.95), 22.0, 3, fixed=True, rest="upright", vary=0.04),
]
