"""Pans, pots, kettles: hollow, with handles; lids that lift."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import Solid, arc, lathe, rod, soft_box, tube
from ..shapes.materials import Material
from ..shapes.vessels import turned_vessel
from .entry import Entry
from .model import ObjectBuilder


def _metal(b: ObjectBuilder) -> Material:
    return b.pick(
        (
            materials.metal("steel", b.rng),
            materials.metal("iron"),
            materials.metal("copper", b.rng),
            materials.plain("dark_red", "metal", 0.6),
        )
    )


def _grip(length: float, width: float, thick: float, rise: float) -> Solid:
    """A pan's handle from the origin to +x, rising by `rise`."""
    return (
        soft_box(length, width, thick, 0.4 * thick).at(length / 2).turned("y", -math.degrees(math.atan2(rise, length)))
    )


def frying_pan(b: ObjectBuilder) -> None:
    """A low pan with a long handle along +x."""
    x, y, z = b.size
    r = y / 2
    deep = 0.75 * z
    centre = -x / 2 + r
    look = _metal(b)
    b.add(turned_vessel([(0.78 * r, 0), (0.93 * r, 0.5 * deep), (r, deep)], 0.004, 6, floor=0.005).at(centre), look)
    reach = x - 2 * r
    b.add(
        _grip(reach + 0.008, 0.026, 0.016, 0.15 * reach).at(centre + r - 0.006, 0, deep - 0.02),
        materials.plain("black"),
    )


def saucepan(b: ObjectBuilder) -> None:
    """A deeper pot with one long handle."""
    x, y, z = b.size
    r = y / 2
    centre = -x / 2 + r
    look = _metal(b)
    b.add(turned_vessel([(0.96 * r, 0), (r, 0.08 * z), (r, z)], 0.003, 6, floor=0.006).at(centre), look)
    b.add(_grip(x - 2 * r + 0.004, 0.022, 0.014, 0.01).at(centre + r - 0.003, 0, 0.78 * z), materials.plain("black"))


def cauldron(b: ObjectBuilder) -> None:
    """A round-bellied pot on three feet with a bail."""
    x, _, z = b.size
    r = x / 2
    iron = materials.metal("iron")
    deep = 0.86 * z
    pot = turned_vessel(
        [(0.62 * r, 0), (0.92 * r, 0.2 * deep), (r, 0.5 * deep), (0.95 * r, 0.8 * deep), (0.88 * r, deep)], 0.008, 7
    )
    b.add(pot.at(z=0.05 * z), iron)
    for k in range(3):
        a = 2 * math.pi * k / 3
        b.add(
            rod(
                (0.5 * r * math.cos(a), 0.5 * r * math.sin(a), 0),
                (0.6 * r * math.cos(a), 0.6 * r * math.sin(a), 0.12 * z),
                0.012,
            ),
            iron,
        )
    bail = [p * (1, 1, 0.35) + (0, 0, 0.88 * z) for p in arc(0.9 * r, 0, 180, 9, "yz")]
    b.add(tube(bail, 0.006, 6, hulls=0), iron)


def kettle(b: ObjectBuilder) -> None:
    """A closed kettle: body, spout, handle over the top, knob."""
    x, y, z = b.size
    r = y / 2
    look = b.pick(
        (materials.metal("steel", b.rng), materials.plain("red", "metal", 0.7), materials.plain("mint", "metal", 0.7))
    )
    body = 0.68 * z
    profile = [(0.92 * r, 0), (r, 0.15 * body), (0.9 * r, 0.6 * body), (0.45 * r, body)]
    shift = -x / 2 + r
    b.add(lathe(profile, split=[0.6 * body]).at(shift), look)
    b.add(lathe([(0.02, 0), (0.012, 0.4 * z)], 10).turned("y", 40).at(shift + 0.72 * r, 0, 0.25 * z), look)
    b.add(
        tube([p * (1, 1, 1.0) + (shift, 0, body - 0.01) for p in arc(0.31 * z, 15, 165, 9)], 0.008, 8, hulls=3),
        materials.plain("black"),
    )
    b.add(lathe([(0.014, 0), (0.014, 0.02)], 10).at(shift, 0, body), materials.plain("black"))


OPEN = 4
"""Number of the first teapot that is hollow; only the object library has such."""


def teapot(b: ObjectBuilder) -> None:
    """Closed and solid; from number `OPEN` on hollow, without its lid."""
    if b.index >= OPEN:
        open_teapot(b)
        return
    x, y, z = b.size
    r = y / 2
    look = materials.plain(b.pick(("porcelain", "sky", "terracotta", "dark_green")), "ceramic", 0.7)
    body = 0.82 * z
    b.add(
        lathe(
            [(0.55 * r, 0), (0.95 * r, 0.25 * body), (r, 0.5 * body), (0.75 * r, 0.82 * body), (0.4 * r, body)],
            split=[0.6 * body],
        ),
        look,
    )
    b.add(lathe([(0.1 * r, 0), (0.16 * r, 0.08 * z), (0.09 * r, 0.18 * z)], 10).at(z=body), look)
    spout = [(0.8 * r, 0, 0.3 * z), (1.05 * r, 0, 0.42 * z), (x / 2 - 0.012, 0, 0.72 * z)]
    b.add(tube(spout, 0.012, 8, hulls=1), look)
    b.add(
        tube([p * (1.2, 1, 1.1) + (-0.85 * r, 0, 0.48 * z) for p in arc(0.24 * z, 100, 260, 8)], 0.007, 8, hulls=2),
        look,
    )


def open_teapot(b: ObjectBuilder) -> None:
    """A hollow teapot without its lid: a wide mouth, a spout and a handle."""
    x, y, z = b.size
    r = y / 2
    look = materials.plain(b.pick(("porcelain", "sky", "terracotta", "dark_green")), "ceramic", 0.7)
    b.add(turned_vessel([(0.84 * r, 0), (0.98 * r, 0.3 * z), (r, 0.55 * z), (0.9 * r, z)], 0.005, 5), look)
    spout = [(0.9 * r, 0, 0.3 * z), (1.1 * r, 0, 0.42 * z), (x / 2 - 0.012, 0, 0.82 * z)]
    b.add(tube(spout, 0.012, 8, hulls=1), look)
    b.add(
        tube([p * (1.2, 1, 1.1) + (-0.92 * r, 0, 0.52 * z) for p in arc(0.24 * z, 100, 260, 8)], 0.007, 8, hulls=1),
        look,
    )


CATEGORIES = [
    Entry("frying_pan", frying_pan, (0.450, 0.260, 0.060), 1.20, 6, rest="upright"),
    Entry("saucepan", saucepan, (0.360, 0.180, 0.110), 1.10, 5, rest="upright"),
    Entry("cauldron", cauldron, (0.360, 0.360, 0.360), 6.00, 3, extra=5, rest="upright", uniform=True, two_hands=True),
    Entry("kettle", kettle, (0.230, 0.180, 0.230), 1.00, 4, rest="upright", uniform=True),
    Entry("teapot", teapot, (0.230, 0.150, 0.150), 0.70, OPEN, extra=1, rest="upright", uniform=True),
]
