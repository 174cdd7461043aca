"""Tables, desks, stands, counters."""

from __future__ import annotations

from ..shapes import materials
from ..shapes.bricks import block, box, cylinder, lathe
from .cabinets import grip
from .entry import Entry
from .model import ObjectBuilder
from .parts import BOARD, drawer, legs


def _wood(b: ObjectBuilder):
    return materials.wood(b.pick(materials.WOODS), b.rng)


def table(b: ObjectBuilder, *, shelf: bool = False, apron: bool = True, top: float = 0.03) -> None:
    """Four legs under a rectangular plate; perhaps an apron and a lower shelf."""
    x, y, z = b.size
    wood = _wood(b)
    plate = wood if b.rng.random() < 0.7 else materials.plain(b.pick(("white", "black", "cream")), "wood")
    b.add(box(x, y, top).at(z=z - top), plate)
    leg = min(0.09, max(0.035, 0.055 * (x + y) / 2))
    look = b.pick(("square", "splayed", "round"))
    height = z - top
    if look == "square":
        legs(b, x, y, height, leg, wood)
    elif look == "splayed":
        legs(b, x, y, height, leg * 0.8, wood, splay=0.06 * min(x, y))
    else:
        legs(b, x, y, height, leg * 0.9, wood, round_=True, inset=0.02)
    if apron and look == "square":
        deep = min(0.09, 0.15 * z)
        for s in (-1, 1):
            b.add(block((x - 2 * leg, 0.02, deep), (0, s * (y / 2 - leg / 2), height - deep / 2)), wood)
            b.add(block((0.02, y - 2 * leg, deep), (s * (x / 2 - leg / 2), 0, height - deep / 2)), wood)
    if shelf and look != "splayed":
        low = 0.3 * z
        b.add(block((x - 0.06 - leg, y - 0.06 - leg, 0.018), (0, 0, low)), wood)


def pedestal_table(b: ObjectBuilder) -> None:
    """A round plate on one turned column with a foot."""
    x, _, z = b.size
    wood = _wood(b)
    r = x / 2
    b.add(cylinder(r, 0.03, 28).at(z=z - 0.03), wood)
    b.add(
        lathe([(0.05, 0.03), (0.065, 0.12), (0.035, 0.3 * z), (0.05, 0.6 * z), (0.04, 0.85 * z), (0.09, z - 0.03)]),
        wood,
    )
    if b.pick((True, False)):
        b.add(lathe([(0.55 * r, 0), (0.52 * r, 0.02), (0.06, 0.05)]), wood)
    else:
        for k in range(4):
            foot = block((0.55 * r, 0.06, 0.035), (0.275 * r, 0, 0.0175)).turned("z", 45 + 90 * k)
            b.add(foot, wood)


def desk(b: ObjectBuilder) -> None:
    """A plate with a pedestal of drawers on one side and a panel on the other; the sitter faces it from +x."""
    x, y, z = b.size
    wood = _wood(b)
    metal = materials.metal("steel")
    front = wood if b.rng.random() < 0.6 else materials.plain("white", "wood")
    side = b.pick((1, -1))
    b.add(box(x, y, 0.028).at(z=z - 0.028), wood)
    width, inner = 0.36 * y if y < 1.1 else 0.42, z - 0.028
    width = min(width, 0.45)
    centre = side * (y - width) / 2
    depth = x - 0.06
    b.add(block((depth, BOARD, inner), (-0.01, centre + width / 2 - BOARD / 2, inner / 2)), wood)
    b.add(block((depth, BOARD, inner), (-0.01, centre - width / 2 + BOARD / 2, inner / 2)), wood)
    b.add(block((0.01, width - 2 * BOARD, inner - 0.04), (-depth / 2, centre, inner / 2 + 0.02)), wood)
    b.add(block((depth, width - 2 * BOARD, BOARD), (-0.01, centre, 0.05)), wood)
    b.add(block((depth, BOARD * 1.3, inner), (-0.01, -side * (y - BOARD * 1.3) / 2, inner / 2)), wood)
    b.add(
        block(
            (0.015, y - width - BOARD * 1.3, 0.35 * z), (-depth / 2 + 0.03, centre - side * y / 2, inner - 0.175 * z)
        ),
        wood,
    )
    rows = b.pick((3, 2))
    low, high = 0.06, inner - 0.004
    pitch = (high - low) / rows
    plane = depth / 2 - 0.01 - BOARD + 0.018
    for k in range(rows):
        middle = low + (k + 0.5) * pitch
        room = (depth - 0.04, width - 2 * BOARD, pitch - 0.006)
        drawer(
            b,
            f"drawer_{k}",
            (plane - room[0] / 2, centre, middle),
            room,
            (width, pitch - 0.004),
            front,
            wood,
            grip(b, width),
            metal,
        )


def pool_table(b: ObjectBuilder) -> None:
    """A slate with green cloth, rims and six pockets to be seen."""
    x, y, z = b.size
    wood = _wood(b)
    cloth = materials.fabric(b.pick(("green", "teal", "navy")), b.rng)
    rim = 0.11
    b.add(block((x - 2 * rim, y - 2 * rim, 0.05), (0, 0, z - 0.065)), cloth)
    for s in (-1, 1):
        b.add(block((rim, y, 0.14), (s * (x - rim) / 2, 0, z - 0.07)), wood)
        b.add(block((x - 2 * rim, rim, 0.14), (0, s * (y - rim) / 2, z - 0.07)), wood)
    black = materials.plain("black")
    for sx in (-1, 1):
        for sy in (-1, 0, 1):
            b.add(cylinder(0.055, 0.004, 12).visual_only().at(sx * (x / 2 - rim), sy * (y / 2 - rim), z - 0.002), black)
    legs(b, x, y, z - 0.14, 0.14, wood, inset=0.08)
    b.add(block((x * 0.7, y * 0.7, 0.1), (0, 0, z - 0.14)), wood)


def countertop(b: ObjectBuilder) -> None:
    """A stone slab on closed side panels and a back: a counter with open space under it."""
    x, y, z = b.size
    slab = materials.stone(b.pick(("grey", "cream", "dark_grey", "white")), b.rng)
    body = materials.plain(b.pick(("white", "light_grey", "cream", "navy")), "wood")
    b.add(block((x, y, 0.04), (0, 0, z - 0.02)), slab)
    inner = z - 0.04
    for s in (-1, 1):
        b.add(block((x - 0.03, 0.03, inner), (-0.015, s * (y - 0.03) / 2, inner / 2)), body)
    b.add(block((0.02, y - 0.06, inner), (-x / 2 + 0.01, 0, inner / 2)), body)
    b.add(block((x - 0.08, y - 0.06, 0.02), (-0.02, 0, 0.4 * inner)), body)


def night_stand(b: ObjectBuilder) -> None:
    """A small stand: open shelf below, one or two drawers above."""
    x, y, z = b.size
    wood = _wood(b)
    metal = materials.metal("brass")
    leg = 0.1 * z
    legs(b, x - 0.02, y, leg, 0.035, wood)
    depth = x - BOARD
    rows = b.pick((1, 2))
    height = z - leg
    middle = leg + height * (0.45 if rows == 1 else 0.02)
    for s in (-1, 1):
        b.add(block((depth, BOARD, height), (-BOARD / 2, s * (y - BOARD) / 2, leg + height / 2)), wood)
    b.add(block((depth, y - 2 * BOARD, BOARD), (-BOARD / 2, 0, leg + BOARD / 2)), wood)
    b.add(block((depth, y - 2 * BOARD, BOARD), (-BOARD / 2, 0, z - BOARD / 2)), wood)
    b.add(block((0.008, y - 2 * BOARD, height - 2 * BOARD), (-x / 2 + 0.004, 0, leg + height / 2)), wood)
    if rows == 1:
        b.add(block((depth - 0.01, y - 2 * BOARD, BOARD), (-BOARD / 2 + 0.005, 0, middle)), wood)
    low = middle + BOARD
    pitch = (z - BOARD - low) / rows
    for k in range(rows):
        room = (depth - 0.025, y - 2 * BOARD, pitch - 0.006)
        centre = (x / 2 - BOARD - room[0] / 2, 0, low + (k + 0.5) * pitch)
        drawer(b, f"drawer_{k}", centre, room, (y - 0.006, pitch - 0.002), wood, wood, grip(b, y), metal)


CATEGORIES = [
    Entry("breakfast_table", table, (0.85, 1.40, 0.75), 28.0, 9, fixed=True, rest="upright", vary=0.15),
    Entry("coffee_table", table, (0.60, 1.10, 0.43), 16.0, 9, fixed=True, rest="upright", vary=0.15,
          options={"shelf": True, "apron": False}),
    Entry("console_table", table, (0.36, 1.15, 0.80), 18.0, 6, fixed=True, rest="upright", vary=0.15,
          options={"shelf": True}),
    Entry("gaming_table", table, (0.75, 1.20, 0.74), 26.0, 3, fixed=True, rest="upright"),
    Entry("pedestal_table", pedestal_table, (0.80, 0.80, 0.74), 20.0, 5, fixed=True, rest="upright", uniform=True),
    Entry("desk", desk, (0.66, 1.35, 0.75), 38.0, 8, fixed=True, rest="upright", vary=0.12),
    Entry("stand", night_stand, (0.42, 0.48, 0.56), 14.0, 8, fixed=True, rest="upright", vary=0.12),
    Entry("pool_table", pool_table, (1.30, 2.40, 0.80), 250.0, 3, fixed=True, rest="upright", vary=0.05),
    Entry("countertop", countertop, (0.62, 1.60, 0.90), 70.0, 8, fixed=True, rest="upright", vary=0.15),
]  # fmt: skip
