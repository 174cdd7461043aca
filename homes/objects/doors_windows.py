"""Doors and windows for openings in a wall. Their frame stands in the wall; the leaf opens towards +x."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import Solid, block, join, soft_box
from ..shapes.materials import Material
from .entry import Entry
from .model import LinkBuilder, ObjectBuilder

FRAME = 0.04  # m, width of a frame's posts
LEAF = 0.038  # m, thickness of a door leaf
KNOB = 0.053  # m, how far a handle stands out of the leaf's face; a door's frame is that much less deep than its box


def frame(x: float, y: float, z: float, sill: bool, depth: float = FRAME) -> Solid:
    """Posts and lintel (and a sill) around an opening of outer size y by z, standing on the origin."""
    parts = [block((x, depth, z), (0, s * (y - depth) / 2, z / 2)) for s in (-1, 1)]
    parts.append(block((x, y - 2 * depth, depth), (0, 0, z - depth / 2)))
    if sill:
        parts.append(block((x, y - 2 * depth, depth), (0, 0, depth / 2)))
    return join(parts)


def lever(s: float) -> Solid:
    """A door handle on both faces of a leaf centred on x = 0; s: +1 points to +y."""
    solids = []
    for face in (-1, 1):
        solids.append(soft_box(0.012, 0.045, 0.16, 0.005).visual_only().at(face * (LEAF / 2 + 0.004), 0, -0.08))
        solids.append(block((0.05, 0.018, 0.018), (face * (LEAF / 2 + 0.025), 0, 0)).visual_only())
        solids.append(block((0.016, 0.12, 0.018), (face * (LEAF / 2 + 0.045), s * 0.05, 0)))
    return join(solids)


def door(b: ObjectBuilder) -> None:
    """A room door: frame without threshold and one leaf, plain, panelled or glazed; opens by 90 degrees."""
    x, y, z = b.size
    plan = b.pick(("plain", "panels", "glazed", "planks"))
    wood = b.pick(
        (
            materials.plain("white", "wood"),
            materials.wood("oak", b.rng),
            materials.wood("walnut", b.rng),
            materials.plain("light_grey", "wood"),
            materials.plain("dark_green", "wood"),
        )
    )
    depth = x - KNOB
    b.add(frame(depth, y, z, sill=False).at(-KNOB / 2), wood)
    left = b.pick((True, False, False))
    width, height = y - 2 * FRAME - 0.008, z - FRAME - 0.012
    s = 1 if left else -1
    front = (depth - KNOB) / 2 - LEAF / 2
    # The axis runs along the leaf's edge on the side it opens to: about its middle it would turn into the post.
    axis = (front + LEAF / 2, s * width / 2, 0.008 + height / 2)
    link = b.hinge("leaf", axis, (0, 0, s), math.radians(100))
    centre = (front, 0.0, 0.008 + height / 2)
    if plan == "glazed":
        _glazed_leaf(link, centre, (width, height), wood)
    else:
        link.add(block((LEAF, width, height), centre), wood)
        _trim(link, centre, (width, height), plan, wood)
    link.add(
        lever(s).at(front, -s * (width / 2 - 0.06), 1.0 * z / 2.05), materials.metal(b.pick(("steel", "brass", "iron")))
    )


def _trim(link: LinkBuilder, centre, size, plan: str, wood: Material) -> None:
    dark = materials.plain(materials.colour((0.85 * wood.rgb[0], 0.85 * wood.rgb[1], 0.85 * wood.rgb[2])), "wood")
    cx, cy, cz = centre
    width, height = size
    for face in (-1, 1):
        px = cx + face * (LEAF / 2 + 0.001)
        if plan == "panels":
            for zz, hh in ((0.27, 0.36), (-0.22, 0.42)):
                for yy in (-0.22, 0.22):
                    link.add(
                        block(
                            (0.004, 0.34 * width, hh * height), (px, cy + yy * width, cz + zz * height)
                        ).visual_only(),
                        dark,
                    )
        elif plan == "planks":
            for k in range(1, 6):
                link.add(block((0.003, 0.006, height), (px, cy + (k / 6 - 0.5) * width, cz)).visual_only(), dark)


def _glazed_leaf(link: LinkBuilder, centre, size, wood: Material) -> None:
    cx, cy, cz = centre
    width, height = size
    stile = 0.11
    for s in (-1, 1):
        link.add(block((LEAF, stile, height), (cx, cy + s * (width - stile) / 2, cz)), wood)
    link.add(block((LEAF, width - 2 * stile, stile), (cx, cy, cz + (height - stile) / 2)), wood)
    link.add(block((LEAF, width - 2 * stile, 0.3), (cx, cy, cz - (height - 0.3) / 2)), wood)
    pane = height - stile - 0.3
    middle = cz + (0.3 - stile) / 2
    link.add(block((0.008, width - 2 * stile, pane), (cx, cy, middle)), materials.glass("sky", 0.35))
    for k in (-1, 1):
        link.add(block((0.014, 0.02, pane), (cx, cy + k * 0.13 * width, middle)).visual_only(), wood)
        link.add(block((0.014, width - 2 * stile, 0.02), (cx, cy, middle + k * pane / 6)).visual_only(), wood)


def window(b: ObjectBuilder) -> None:
    """A casement window with one or two sashes opening inwards (+x), or a sliding sash; frame with a sill."""
    x, y, z = b.size
    plan = b.pick(("two", "one", "slide"))
    look = b.pick(
        (materials.plain("white", "wood"), materials.wood("oak", b.rng), materials.plain("dark_grey", "metal"))
    )
    metal = materials.metal("steel")
    b.add(frame(x, y, z, sill=True), look)
    b.add(block((0.06, y, 0.02), (x / 2 + 0.03, 0, FRAME - 0.01)).visual_only(), look)
    width, height = y - 2 * FRAME - 0.008, z - 2 * FRAME - 0.008
    middle = z / 2
    depth = 0.03
    if plan == "slide":
        half = width / 2
        _sash(b.base, (-0.018, -half / 2, middle), (half + 0.02, height), depth, look)
        link = b.slide("sash_0", (0.018, half / 2, middle), (0, -1, 0), half - 0.02)
        _sash(link, (0.018, half / 2 - 0.002, middle), (half, height), depth, look)
        link.add(block((0.02, 0.02, 0.1), (0.018 + 0.024, 0.03, middle)).visual_only(), metal)
        return
    front = x / 2 - depth / 2
    leaves = (
        [(-width / 2, width / 2, True)] if plan == "one" else [(0.002, width / 2, True), (-width / 2, -0.002, False)]
    )
    for k, (low, high, left) in enumerate(leaves):
        axis = (x / 2, high if left else low, middle)
        link = b.hinge(f"sash_{k}", axis, (0, 0, 1 if left else -1), math.pi / 2)
        _sash(link, (front, (low + high) / 2, middle), (high - low, height), depth, look)
        at = low + 0.02 if left else high - 0.02
        link.add(block((0.03, 0.02, 0.1), (front + depth / 2 + 0.012, at, middle)).visual_only(), metal)


def _sash(link: LinkBuilder, centre, size, depth: float, look: Material) -> None:
    cx, cy, cz = centre
    width, height = size
    rail = 0.045
    for s in (-1, 1):
        link.add(block((depth, rail, height), (cx, cy + s * (width - rail) / 2, cz)), look)
        link.add(block((depth, width - 2 * rail, rail), (cx, cy, cz + s * (height - rail) / 2)), look)
    link.add(block((0.006, width - 2 * rail, height - 2 * rail), (cx, cy, cz)), materials.glass("sky", 0.3))


CATEGORIES = [
    Entry("door", door, (0.173, 0.900, 2.050), 28.0, 8, fixed=True, rest="upright", vary=0.03),
    Entry("window", window, (0.110, 1.200, 1.200), 24.0, 9, fixed=True, rest="upright", vary=0.12),
]
