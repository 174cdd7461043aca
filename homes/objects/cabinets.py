"""Cupboards and chests of drawers: kitchen bases, wall cupboards, wardrobes."""

from __future__ import annotations

import numpy as np

from ..shapes import materials
from ..shapes.bricks import Solid, block
from ..shapes.materials import Material
from .entry import Entry
from .model import ObjectBuilder
from .parts import BOARD, GAP, bow_handle, carcass, door, drawer, knob

STYLES = ("oak", "white", "walnut", "cream", "navy", "birch", "light_grey", "cherry")


def style(b: ObjectBuilder) -> tuple[Material, Material, Material]:
    """(body, front, metal) of one model: wood all over, or painted."""
    name = b.pick(STYLES)
    if name in materials.WOODS:
        body = materials.wood(name, b.rng)
        front = body
    else:
        body = materials.plain(materials.tint(name, b.rng, 0.04), "wood")
        front = body if b.rng.random() < 0.6 else materials.wood("oak", b.rng)
    return body, front, materials.metal(b.rng.choice(("steel", "brass", "iron")))


def grip(b: ObjectBuilder, width: float, upright: bool = False) -> Solid:
    return bow_handle(min(0.16, 0.5 * width), upright=upright) if b.rng.random() < 0.75 else knob()


def base_cabinet(b: ObjectBuilder, *, top: bool = True, plan: str | None = None) -> None:
    """A base cabinet. plan: how the front is divided: "drawers", "doors", "drawer_doors", "shelf_doors"."""
    x, y, z = b.size
    body, front, metal = style(b)
    plan = plan or b.pick(("drawers", "doors", "drawer_doors", "wide_drawers"))
    plinth = min(0.08, 0.1 * z) if b.rng.random() < 0.7 else 0.0
    if plinth:
        b.add(block((x - 0.05, y - 0.02, plinth), (-0.02, 0, plinth / 2)), body)
    slab = 0.025 if top else 0.0
    depth = x - BOARD
    height = z - plinth - slab
    b.add(carcass(depth, y, height, top=top).at(-BOARD / 2, 0, plinth), body)
    if top:
        plate = materials.stone(b.rng.choice(("grey", "cream", "dark_grey")), b.rng) if b.rng.random() < 0.4 else body
        b.add(block((x, y, slab), (0, 0, z - slab / 2)), plate)
    low, high = plinth, z - slab
    split = high
    if plan == "drawer_doors":
        split = high - 0.28 * (high - low)
        b.add(block((depth - 0.01, y - 2 * BOARD, BOARD), (-BOARD / 2, 0, split)), body)
    plane = x / 2 - BOARD
    if plan in ("drawers", "wide_drawers"):
        rows = 2 if plan == "wide_drawers" else max(3, min(5, round(height / 0.2)))
        _drawers(b, plane, depth, y, (low, high), rows, front, body, metal)
    if plan == "drawer_doors":
        _drawers(b, plane, depth, y, (split, high), 1, front, body, metal)
    if plan in ("doors", "drawer_doors", "shelf_doors"):
        _doors(b, plane, y, (low, split), front, metal)
        middle = (low + split) / 2
        b.add(block((depth - 0.03, y - 2 * BOARD, BOARD), (-BOARD / 2 - 0.012, 0, middle)), body)


def wall_cabinet(b: ObjectBuilder) -> None:
    """A wall cupboard with one or two doors and one or two shelves."""
    x, y, z = b.size
    body, front, metal = style(b)
    depth = x - BOARD
    b.add(carcass(depth, y, z).at(-BOARD / 2), body)
    shelves = 1 if z < 0.75 else 2
    for k in range(shelves):
        height = (k + 1) * z / (shelves + 1)
        b.add(block((depth - 0.03, y - 2 * BOARD, BOARD), (-BOARD / 2 - 0.012, 0, height)), body)
    glazed = b.rng.random() < 0.25
    _doors(b, x / 2 - BOARD, y, (0.0, z), front, metal, glazed=glazed, handle_low=True)


def _drawers(b, plane, depth, y, span, rows, front, body, metal) -> None:
    low, high = span
    pitch = (high - low) / rows
    width = y - 2 * BOARD
    for k in range(rows):
        base = low + BOARD + 0.002 if k == 0 else low + k * pitch + 0.004
        roof = low + (k + 1) * pitch - (BOARD if k == rows - 1 else 0.0) - 0.002
        room = (depth - 0.02, width, roof - base)
        centre = (plane - room[0] / 2, 0.0, (base + roof) / 2)
        face = (y - 2 * GAP, pitch - GAP)
        link = drawer(b, f"drawer_{k}", centre, room, face, front, body, None, metal)
        middle = low + (k + 0.5) * pitch
        # The front board is centred on its pitch, not on the room behind it.
        _recentre(link, centre[2], middle)
        link.add(grip(b, y).at(plane + BOARD, 0, middle), metal)


def _recentre(link, was: float, now: float) -> None:
    """Moves a drawer's front board (its last hull and mesh) from height `was` to `now`."""
    shift = now - was
    link.hulls[-1] = link.hulls[-1] + np.array([0, 0, shift])
    material, mesh = link.visuals[-1]
    link.visuals[-1] = (material, type(mesh)(mesh.vertices + np.array([0, 0, shift]), mesh.faces, mesh.uv))


def _doors(b, plane, y, span, front, metal, *, glazed: bool = False, handle_low: bool = False) -> None:
    low, high = span
    z = (low + GAP / 2, high - GAP / 2)
    count = 1 if y < 0.5 else 2
    height = z[1] - z[0]
    at = z[0] + 0.15 * height if handle_low else z[1] - 0.2 * height
    for k in range(count):
        if count == 1:
            span_y, left = (-y / 2 + GAP, y / 2 - GAP), b.rng.random() < 0.5
        else:
            span_y, left = ((GAP / 2, y / 2 - GAP), True) if k == 0 else ((-y / 2 + GAP, -GAP / 2), False)
        handle = grip(b, y, upright=True)
        link = door(b, f"door_{k}", plane, span_y, z, front, handle, metal, left=left, handle_z=at)
        if glazed:
            width = span_y[1] - span_y[0]
            pane = block(
                (0.004, width * 0.7, height * 0.75), (plane + BOARD, sum(span_y) / 2, sum(z) / 2)
            ).visual_only()
            link.add(pane, materials.glass("sky", 0.5))


CATEGORIES = [
    Entry("bottom_cabinet", base_cabinet, (0.58, 0.80, 0.88), 45.0, 16, fixed=True, rest="upright", vary=0.2),
    Entry("bottom_cabinet_no_top", base_cabinet, (0.56, 0.70, 0.84), 38.0, 6, fixed=True, rest="upright", vary=0.15,
          options={"top": False}),
    Entry("top_cabinet", wall_cabinet, (0.35, 0.70, 0.70), 20.0, 10, fixed=True, rest="upright", vary=0.2),
]  # fmt: skip
