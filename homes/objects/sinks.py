"""Sinks with a tap: on a cabinet, on a pedestal, or as a bare basin for a counter."""

from __future__ import annotations

import numpy as np

from ..shapes import materials
from ..shapes.bricks import Solid, arc, block, cylinder, join, lathe, tube
from .entry import Entry
from .model import ObjectBuilder
from .parts import bow_handle, carcass, door

RIM = 0.05


def tap(height: float, reach: float) -> Solid:
    """A swan-neck tap on z = 0 at the origin, its mouth at (reach, 0, ...)."""
    r = reach / 2
    neck = (
        [(0, 0, 0), (0, 0, height - r)]
        + [p + np.array([r, 0, height - r]) for p in arc(r, 150, 0, 6)]
        + [(reach, 0, height - r - 0.02)]
    )
    return cylinder(0.024, 0.02, 12).visual_only() + tube(neck, 0.012, 8, hulls=2)


def basin(x: float, y: float, depth: float, z: float) -> Solid:
    """A rectangular basin whose rim is at height z: rim plates all round, four walls and a floor."""
    w = 0.015
    inner_x, inner_y = x - 2 * RIM - 0.06, y - 2 * RIM
    cx = 0.03
    return join(
        [
            block((RIM, y, 0.02), ((x - RIM) / 2, 0, z - 0.01)),
            block((RIM + 0.06, y, 0.02), (-(x - RIM - 0.06) / 2, 0, z - 0.01)),
            block((inner_x, RIM, 0.02), (cx, (y - RIM) / 2, z - 0.01)),
            block((inner_x, RIM, 0.02), (cx, -(y - RIM) / 2, z - 0.01)),
            block((inner_x + 2 * w, inner_y + 2 * w, w), (cx, 0, z - depth - w / 2)),
            block((w, inner_y + 2 * w, depth - 0.02), (cx + (inner_x + w) / 2, 0, z - 0.02 - (depth - 0.02) / 2)),
            block((w, inner_y + 2 * w, depth - 0.02), (cx - (inner_x + w) / 2, 0, z - 0.02 - (depth - 0.02) / 2)),
            block((inner_x, w, depth - 0.02), (cx, (inner_y + w) / 2, z - 0.02 - (depth - 0.02) / 2)),
            block((inner_x, w, depth - 0.02), (cx, -(inner_y + w) / 2, z - 0.02 - (depth - 0.02) / 2)),
        ]
    )


def fittings(b: ObjectBuilder, x: float, z: float, depth: float, height: float = 0.26) -> None:
    """Tap, drain, lever and the three annotated points of a sink whose rim is at height z."""
    chrome = materials.metal("chrome")
    rear = -x / 2 + 0.055
    reach = 0.42 * x
    b.add(tap(height, reach).at(rear, 0, z), chrome)
    b.add(cylinder(0.022, 0.003, 12).visual_only().at(0.03, 0, z - depth), materials.metal("iron"))
    b.add(block((0.05, 0.016, 0.012), (rear + 0.02, 0.06, z + 0.06)).visual_only(), chrome)
    b.add(cylinder(0.012, 0.06, 8).visual_only().at(rear, 0.06, z), chrome)
    b.point("toggle_button", (rear + 0.03, 0.06, z + 0.065))
    b.point("water_source", (rear + reach, 0, z + height - reach / 2 - 0.025))
    b.point("water_sink", (0.03, 0, z - depth))


def sink(b: ObjectBuilder) -> None:
    """plan by model: kitchen sink over a cabinet with doors; washbasin on a pedestal; washbasin over a cabinet."""
    x, y, z = b.size
    plan = b.pick(("kitchen", "pedestal", "vanity"))
    rim = z - 0.26
    depth = 0.17
    if plan == "pedestal":
        white = materials.plain("porcelain", "ceramic", 0.8)
        y = min(y, 0.62)
        b.add(basin(x, y, depth, rim), white)
        b.add(lathe([(0.15, 0), (0.10, 0.06), (0.085, 0.5 * rim), (0.15, rim - depth - 0.015)]), white)
        apron = block((x, 0.015, 0.12), (0, (y - 0.015) / 2, rim - 0.08)) + block(
            (x, 0.015, 0.12), (0, -(y - 0.015) / 2, rim - 0.08)
        )
        b.add(apron + block((0.015, y - 0.03, 0.12), ((x - 0.015) / 2, 0, rim - 0.08)), white)
    else:
        look = b.pick((materials.metal("steel", b.rng), materials.plain("porcelain", "ceramic", 0.8)))
        body = (
            materials.plain(b.rng.choice(materials.PAINTS), "wood")
            if b.rng.random() < 0.5
            else materials.wood("oak", b.rng)
        )
        b.add(basin(x, y, depth, rim), look)
        body_x = x - 0.04
        b.add(carcass(body_x, y - 0.02, rim - 0.02, top=False).at(-0.01), body)
        plane = -0.01 + body_x / 2
        for k, (span, left) in enumerate((((0.002, y / 2 - 0.013), True), ((0.013 - y / 2, -0.002), False))):
            door(
                b,
                f"door_{k}",
                plane,
                span,
                (0.03, rim - 0.03),
                body,
                bow_handle(0.12, upright=True),
                materials.metal("steel"),
                left=left,
                handle_z=rim - 0.16,
            )
    fittings(b, x, rim, depth)


CATEGORIES = [
    Entry("sink", sink, (0.52, 0.76, 1.12), 24.0, 10, fixed=True, rest="upright", vary=0.06),
]
