"""Lamps and candles."""

from __future__ import annotations

from ..shapes import materials
from ..shapes.bricks import ball, cylinder, lathe, rod, sleeve, tube
from ..shapes.materials import Material
from .entry import Entry
from .model import ObjectBuilder
from .parts import button


def table_lamp(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    look = _foot(b)
    low = 0.55 * z
    if b.pick((True, False)):
        b.add(
            lathe([(0.5 * r, 0), (0.5 * r, 0.03 * z), (0.1 * r, 0.06 * z), (0.09 * r, 0.6 * z)], split=[0.05 * z]), look
        )
    else:
        b.add(
            lathe(
                [(0.35 * r, 0), (0.55 * r, 0.15 * z), (0.5 * r, 0.3 * z), (0.12 * r, 0.5 * z), (0.1 * r, 0.6 * z)],
                split=[0.4 * z],
            ),
            look,
        )
    _shade(b, r, 0.65 * r, low, z)
    button(b, (0.2 * r, 0, 0.5 * z), materials.plain("black"), 0.008)


def floor_lamp(b: ObjectBuilder) -> None:
    """A standing lamp with a shade, or a bent reading lamp."""
    x, _, z = b.size
    r = x / 2
    look = _foot(b)
    b.add(lathe([(0.75 * r, 0), (0.72 * r, 0.025), (0.06, 0.04)], 24), look)
    b.add(cylinder(0.012, 0.8 * z - 0.03, 10).at(z=0.03), look)
    if b.pick((True, False)):
        _shade(b, r, 0.7 * r, 0.78 * z, z)
    else:
        path = [(0.0, 0, 0.8 * z), (0.05, 0, 0.9 * z), (0.4 * r, 0, 0.97 * z), (0.8 * r, 0, 0.93 * z)]
        b.add(tube(path, 0.011, 8, hulls=2), look)
        b.add(
            lathe([(0.5 * r, 0), (0.4 * r, 0.05), (0.08 * r, 0.11)], 20)
            .turned("y", -12)
            .at(0.82 * r, 0, 0.93 * z - 0.12),
            look,
        )
    button(b, (0.012, 0, 0.7 * z), materials.plain("black"), 0.008)


def candle(b: ObjectBuilder) -> None:
    """A pillar candle on a dish, or a taper in a holder."""
    x, _, z = b.size
    r = x / 2
    wax = materials.plain(materials.tint(b.pick(("cream", "red", "white", "sky")), b.rng), "organic", 0.4)
    top = 0.9 * z
    if b.pick((True, False)):
        b.add(lathe([(r, 0), (r, 0.03 * z)]), materials.metal("brass"))
        b.add(lathe([(0.8 * r, 0.03 * z), (0.8 * r, top)]), wax)
    else:
        b.add(
            lathe([(r, 0), (0.95 * r, 0.04 * z), (0.25 * r, 0.1 * z), (0.4 * r, 0.25 * z)], split=[0.06 * z]),
            materials.metal("silver"),
        )
        b.add(lathe([(0.32 * r, 0.2 * z), (0.28 * r, top)], 12), wax)
    b.add(rod((0, 0, top), (0, 0, z), 0.0015, 5).visual_only(), materials.plain("black", "fabric"))
    b.point("heat_source", (0, 0, z))
    b.point("toggle_button", (0, 0, z))


def _foot(b: ObjectBuilder) -> Material:
    return b.pick(
        (
            materials.metal("brass"),
            materials.metal("iron"),
            materials.wood("walnut", b.rng),
            materials.metal("chrome"),
            materials.plain("porcelain", "ceramic", 0.8),
            materials.plain("teal", "ceramic", 0.8),
        )
    )


def _shade(b: ObjectBuilder, bottom: float, top: float, low: float, high: float) -> None:
    look = materials.glow(b.pick(("cream", "white", "tan", "rose")))
    skin = sleeve([(bottom, low), (top, high)], 24) + sleeve([(top * 0.99, high), (bottom * 0.99, low)], 24)
    b.add(skin, look)
    b.add(lathe([(bottom, low), (top, high)], 10).collision_only(), look)
    b.add(ball(0.06, 0.06, 0.09, 10).visual_only().at(0, 0, (low + high) / 2 - 0.045), materials.glow("yellow"))


CATEGORIES = [
    Entry("table_lamp", table_lamp, (0.300, 0.300, 0.480), 1.8, 6, rest="upright", uniform=True),
    Entry("floor_lamp", floor_lamp, (0.420, 0.420, 1.600), 6.0, 6, rest="upright", uniform=True),
    Entry("candle", candle, (0.085, 0.085, 0.160), 0.30, 5, rest="upright"),
]  # fmt: skip
