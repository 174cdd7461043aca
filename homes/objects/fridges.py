"""Refrigerators: shelves and room inside, one, two or French doors, some with a freezer drawer."""

from __future__ import annotations

from ..shapes import materials
from ..shapes.bricks import block
from .entry import Entry
from .model import LinkBuilder, ObjectBuilder
from .parts import GAP, bow_handle, carcass, door, drawer

WALL = 0.045  # m, insulated


def fridge(b: ObjectBuilder) -> None:
    """plan by model: one door; freezer above; freezer drawer below; French doors over a drawer."""
    x, y, z = b.size
    body = b.pick(
        (
            materials.metal("steel", b.rng),
            materials.plain("white"),
            materials.metal("dark_grey", b.rng),
            materials.plain("cream"),
            materials.plain("mint"),
        )
    )
    inner = materials.plain("white")
    metal = materials.metal("chrome")
    plan = b.pick(("single", "freezer_top", "drawer", "french"))
    leaf = 0.055
    depth = x - leaf - 0.036
    shift = -(x - depth) / 2
    foot = 0.04
    b.add(block((depth - 0.06, y - 0.06, foot), (shift, 0, foot / 2)), materials.plain("black"))
    b.add(carcass(depth, y, z - foot, WALL, back=WALL).at(shift, 0, foot), body)
    b.add(
        block(
            (0.004, y - 2 * WALL, z - foot - 2 * WALL), (shift - depth / 2 + WALL + 0.002, 0, (z + foot) / 2)
        ).visual_only(),
        inner,
    )
    plane = shift + depth / 2
    # Height of the board between the two compartments; 0: there is only one.
    heights = {"freezer_top": foot + 0.68 * (z - foot), "drawer": foot + 0.3 * z, "french": foot + 0.33 * z}
    split = heights.get(plan, 0.0)
    room_x = depth - WALL - 0.02
    middle_x = plane - 0.01 - room_x / 2
    if split:
        b.add(block((room_x, y - 2 * WALL, 0.04), (middle_x, 0, split)), body)
    cold_low, cold_high = foot + WALL, z - WALL
    if plan == "freezer_top":
        cold_high = split - 0.02
    elif split:
        cold_low = split + 0.02
    shelf = materials.glass("sky", 0.45)
    count = max(2, round((cold_high - cold_low) / 0.34))
    for k in range(1, count):
        height = cold_low + k * (cold_high - cold_low) / count
        b.add(block((room_x - 0.1, y - 2 * WALL, 0.008), (middle_x - 0.05, 0, height)), shelf)
    if plan in ("drawer", "french"):
        room = (room_x - 0.01, y - 2 * WALL, split - 0.02 - foot - WALL - 0.01)
        centre = (plane - room[0] / 2, 0, foot + WALL + room[2] / 2 + 0.003)
        front = (y - 2 * GAP, split - foot - GAP)
        drawer(b, "drawer_0", centre, room, front, body, inner, bow_handle(0.5 * y), metal, face_depth=leaf)
        top = (split + GAP, z - GAP)
    else:
        top = (foot + GAP, (split or z) - GAP)
    doors: list[LinkBuilder] = []
    if plan == "french":
        doors.append(_leaf(b, "door_0", plane, (GAP / 2, y / 2), top, body, metal, True, leaf))
        doors.append(_leaf(b, "door_1", plane, (-y / 2, -GAP / 2), top, body, metal, False, leaf))
    else:
        left = b.rng.random() < 0.5
        doors.append(_leaf(b, "door_0", plane, (-y / 2, y / 2), top, body, metal, left, leaf))
        if plan == "freezer_top":
            doors.append(_leaf(b, "door_1", plane, (-y / 2, y / 2), (split + GAP, z - GAP), body, metal, left, leaf))
    # A cold source that acts on what is inside; the point says where the cold comes from.
    b.point("heat_source", (middle_x, 0, (cold_low + cold_high) / 2))


def _leaf(b, name, plane, y, z, body, metal, left, depth) -> LinkBuilder:
    """A door that fills the span y but for what its free edge swings beyond it: the leaf is thick."""
    height, width = z[1] - z[0], y[1] - y[0]
    air = depth**2 / (2 * width) + 0.001
    y = (y[0] + air, y[1]) if left else (y[0], y[1] - air)
    handle = bow_handle(min(0.45, 0.5 * height), 0.035, 0.008, upright=True)
    return door(b, name, plane, y, z, body, handle, metal, left=left, depth=depth, angle=1.9)


CATEGORIES = [
    Entry("fridge", fridge, (0.72, 0.72, 1.75), 85.0, 12, fixed=True, rest="upright", vary=0.1),
]
