"""Towels, napkins, sheets, carpets, pillows: flat, folded or rolled cloth, rigid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..shapes import materials, textures
from ..shapes.bricks import box, cylinder, join, rod, sheet, soft_box, tube
from ..shapes.materials import Material
from .entry import Entry
from .model import ObjectBuilder

ROLLED = 5
"""Number of the first rolled bath towel. Only the object library has such."""

OF_ITS_KIND = 3
"""Towels that are rolled up."""

FOLDED = 5
"""Number of the first rag and dishtowel that are folded in four; likewise."""

RAG_DENSITY = 40.0
"""kg/m^3 of the box around a rag or dishtowel, spread out or folded."""

ROLLED_DENSITY = 330.0
"""kg/m^3 of a cloth that is tightly rolled up; folded, a category's mean applies to the box around it."""


def cloth(b: ObjectBuilder, kind: str | None = None) -> Material:
    """Cloth with a weave, stripes or checks, by model."""
    name = b.pick(materials.CLOTHS)
    rgb = materials.tint(name, b.rng)
    light = materials.colour("cream")
    kind = kind or b.pick(("plain", "stripes", "checks"))
    if kind == "stripes":
        return materials.picture("stripes", textures.stripes(rgb, light, 4), 0.16, "fabric", 0.05)
    if kind == "checks":
        return materials.picture("checks", textures.checks(light, rgb, 4), 0.12, "fabric", 0.05)
    return materials.fabric(name, b.rng)


def spread(b: ObjectBuilder, *, kind: str | None = None, wipes: bool = False) -> None:
    """A cloth lying flat with small waves; `wipes`: it is a cleaning tool, its underside cleans."""
    x, y, z = b.size
    thick = 0.4 * z
    b.add(sheet(x, y, z - thick, thick, 10, b.rng.uniform(0, 6)), cloth(b, kind))
    if wipes:
        b.area("cleaning_tool_area", (x * 0.98, y * 0.98, 0.4 * z), (0, 0, 0.2 * z))


def folded(b: ObjectBuilder, *, layers: int = 4, kind: str | None = None, wipes: bool = False) -> None:
    """A cloth folded to a stack with round edges; collides as one box."""
    x, y, z = b.size
    look = cloth(b, kind)
    t = z / layers
    pile = [
        soft_box(x - 0.003 * (k % 2), y - 0.004 * (k % 3), t, 0.49 * t).visual_only().at(0.001 * (k % 2), 0, k * t)
        for k in range(layers)
    ]
    b.add(join(pile) + box(x, y, z).collision_only(), look)
    if wipes:
        b.area("cleaning_tool_area", (x * 0.98, y * 0.98, 0.2 * z), (0, 0, 0.1 * z))


def rag(b: ObjectBuilder, **options: Any) -> None:
    """Spread out; from number `FOLDED` on folded in four, so that it goes into a bucket or a box."""
    if b.index < FOLDED:
        spread(b, **options)
        return
    x, y, z = b.size
    b.mass = RAG_DENSITY * x * y * z
    b.size = (x / 2, y / 2, 2 * z)
    folded(b, **options)


def bath_towel(b: ObjectBuilder, **options: Any) -> None:
    """Folded; three from number `ROLLED` on rolled up and standing on end, so that two fingers can take them."""
    if not ROLLED <= b.index < ROLLED + OF_ITS_KIND:
        folded(b, **options)
        return
    x, y, z = b.size
    b.rest = "standing"
    rolled(b, 0.112 * (x + y), 2.1 * z)


def rolled(b: ObjectBuilder, across: float, height: float) -> None:
    """A cloth rolled up, standing on end; its mantle wipes. across: diameter, m."""
    r, thick = across / 2, 0.006
    b.mass = ROLLED_DENSITY * math.pi * r**2 * height
    look = cloth(b, "plain")
    b.add(cylinder(r, height, 24), look)
    turns = [
        (d * math.cos(a), d * math.sin(a), height - 0.001)
        for a in np.linspace(0.5 * math.pi, 7 * math.pi, 40)
        for d in (thick * a / (2 * math.pi) + 0.002,)
        if d < r - 0.004
    ]
    edge = tube(turns, 0.0022, 6, None).visual_only()
    b.add(edge, look)
    b.add(edge.at(z=0.002 - height), look)
    b.add(rod((r - 0.001, 0, 0.002), (r - 0.001, 0, height - 0.002), 0.0028).visual_only(), look)
    b.area("cleaning_tool_area", (1.3 * r, 1.3 * r, height * 0.98), (0, 0, height / 2))


def kitchen_roll(b: ObjectBuilder) -> None:
    """A roll of paper towel standing on end; it wipes with its mantle."""
    x, _, z = b.size
    r = x / 2
    b.add(
        cylinder(r, z, 20), materials.picture("tissue", textures.tiles((0.96, 0.96, 0.95), (0.90, 0.92, 0.95), 3), 0.1)
    )
    b.add(cylinder(0.36 * r, z + 0.0006, 12).visual_only().at(z=-0.0003), materials.plain("cardboard", "paper"))
    b.add(cylinder(0.3 * r, z + 0.001, 12).visual_only().at(z=-0.0005), materials.plain("brown", "paper"))
    b.area("cleaning_tool_area", (1.3 * r, 1.3 * r, z * 0.98), (0, 0, z / 2))


def pillow(b: ObjectBuilder) -> None:
    """A cushion, thick in the middle."""
    x, y, z = b.size
    solid = soft_box(x, y, z, 0.49 * z, 3)
    mesh = solid.visuals[0]
    u, v = 2 * mesh.vertices[:, 0] / x, 2 * mesh.vertices[:, 1] / y
    mesh.vertices[:, 2] = z / 2 + (mesh.vertices[:, 2] - z / 2) * (1 - 0.6 * (u**4).clip(0, 1)) * (
        1 - 0.6 * (v**4).clip(0, 1)
    )
    b.add(solid.visual_only(), cloth(b))
    b.add(
        box(0.94 * x, 0.94 * y, 0.55 * z).collision_only().at(z=0.225 * z) + box(0.7 * x, 0.7 * y, z).collision_only(),
        materials.plain("white", "fabric"),
    )


def carpet(b: ObjectBuilder) -> None:
    """A rug with a border."""
    x, y, z = b.size
    rgb = materials.tint(b.pick(("dark_red", "navy", "beige", "grey", "teal")), b.rng)
    b.add(box(x, y, z), materials.picture("pile", textures.weave(rgb, b.rng), 0.1, "fabric", 0.02))
    frame = materials.plain(materials.tint("cream", b.rng), "fabric", 0.02)
    for s in (-1, 1):
        b.add(box(0.05, y * 0.9, 0.001).visual_only().at(s * 0.42 * x, 0, z), frame)
        b.add(box(x * 0.84 + 0.05, 0.05, 0.001).visual_only().at(0, s * 0.45 * y, z), frame)
    b.add(box(0.35 * x, 0.35 * y, 0.0012).visual_only().turned("z", 45).at(z=z), frame)


def mat(b: ObjectBuilder) -> None:
    """A bath or door mat."""
    x, y, z = b.size
    look = materials.picture(
        "knit",
        textures.knit(materials.tint(b.pick(("grey", "teal", "brown", "rose")), b.rng), b.rng),
        0.08,
        "fabric",
        0.02,
    )
    b.add(soft_box(x, y, z, 0.4 * z), look)


CATEGORIES = [
    Entry("dishtowel", rag, (0.450, 0.300, 0.014), 0.08, FOLDED, extra=1, vary=0.1, options={"wipes": True}),
    Entry("hand_towel", folded, (0.200, 0.280, 0.040), 0.18, 5, extra=3, options={"wipes": True}),
    Entry("bath_towel", bath_towel, (0.300, 0.360, 0.090), 0.55, ROLLED, extra=6, options={"wipes": True, "layers": 5}),
    Entry("rag", rag, (0.320, 0.280, 0.018), 0.05, FOLDED, extra=1, vary=0.12, options={"wipes": True}),
    Entry("dinner_napkin", folded, (0.190, 0.190, 0.008), 0.035, 3, options={"wipes": True, "layers": 3}),
    Entry("paper_towel", kitchen_roll, (0.120, 0.120, 0.260), 0.25, 3, rest="standing", uniform=True),
    Entry("sheet", folded, (0.320, 0.420, 0.070), 0.80, 4, options={"layers": 6}),
    Entry("pillow", pillow, (0.420, 0.580, 0.150), 0.70, 5),
    Entry("carpet", carpet, (2.000, 1.400, 0.012), 9.0, 5, fixed=True, rest="upright", vary=0.15),
    Entry("mat", mat, (0.500, 0.750, 0.018), 1.2, 4, rest="upright"),
]  # fmt: skip
