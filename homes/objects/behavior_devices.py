"""Vessels, machines and instruments that BEHAVIOR-1K names and iGibson does not have (`ig2mj.knowledge.further`)."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import ball, block, box, prism, rod, soft_box, tube
from ..shapes.turned import cylinder, lathe
from ..shapes.vessels import tray, turned_vessel
from .behavior_things import look
from .entry import Entry
from .model import ObjectBuilder
from .parts import button


def horn(b: ObjectBuilder, *, long: float = 0.75) -> None:
    """A brass instrument lying on its side: a bell, a bent tube."""
    x, y, z = b.size
    brass = look(b, ("gold", "brass"), "metal", 0.7)
    r = 0.16 * z
    way = [(-0.5 * x + r, 0.3), (0.3 * x, 0.3), (0.42 * x, 0.1), (0.3 * x, -0.1), (-0.4 * x * long, -0.1)]
    path = [(at, side * y, z / 2) for at, side in way]
    b.add(tube(path, r, 8, hulls=0), brass)
    bell = lathe([(0.9 * r, 0), (1.2 * r, 0.5 * z), (0.5 * z, z)], 16, split=[0.5 * z])
    b.add(bell.visual_only().turned("y", 90).at(0.5 * x - z, -0.3 * y + 0.1 * y, z / 2), brass)
    for k in range(3):
        b.add(
            cylinder(0.6 * r, 0.34 * z, 8).visual_only().at((0.06 * k - 0.06) * x, 0.1 * y, z / 2),
            look(b, ("silver",), "metal"),
        )
    b.add(box(x, y, z).collision_only(), brass)


def violin(b: ObjectBuilder) -> None:
    """A violin lying on its back, its scroll towards +x."""
    x, y, z = b.size
    wood = look(b, ((0.55, 0.26, 0.12), (0.46, 0.22, 0.10)), "wood", 0.6)
    for at, wide, long in ((-0.36, 1.0, 0.28), (-0.2, 0.62, 0.16), (-0.06, 0.82, 0.24)):
        b.add(
            prism(
                [
                    (0.5 * long * x * math.cos(a), 0.5 * wide * y * math.sin(a))
                    for a in (k * math.pi / 8 for k in range(16))
                ],
                0.6 * z,
            ).at(at * x),
            wood,
        )
    b.add(block((0.46 * x, 0.12 * y, 0.3 * z), (0.23 * x, 0, 0.6 * z)), materials.plain("ebony", "wood"))
    b.add(box(0.05 * x, 0.14 * y, 0.75 * z).at(0.475 * x), wood)
    b.add(
        block((0.01 * x, 0.22 * y, 0.35 * z), (-0.2 * x, 0, 0.75 * z)).visual_only(), materials.plain("cream", "wood")
    )


def cage(b: ObjectBuilder) -> None:
    """A bird cage: a floor, bars and a dome; nothing goes in or out."""
    x, _, z = b.size
    wire = look(b, ("gold", "white", "black"), "metal")
    r, up = x / 2, 0.68 * z
    b.add(cylinder(r, 0.05 * z, 20), look(b, ("brown", "grey"), "plastic"))
    for k in range(14):
        a = 2 * math.pi * k / 14
        c, s = 0.96 * r * math.cos(a), 0.96 * r * math.sin(a)
        b.add(rod((c, s, 0.04 * z), (c, s, up), 0.006 * z, 4).visual_only(), wire)
        b.add(rod((c, s, up), (0.1 * c, 0.1 * s, 0.94 * z), 0.006 * z, 4).visual_only(), wire)
    b.add(ball(0.1 * x, 0.1 * x, 0.08 * z, 8).visual_only().at(0, 0, 0.92 * z), wire)
    b.add(rod((-0.8 * r, 0, 0.35 * z), (0.8 * r, 0, 0.35 * z), 0.012 * z, 6).visual_only(), look(b, ("oak",), "wood"))
    b.add(lathe([(r, 0.05 * z), (r, up), (0.2 * r, z)], 12).collision_only(), wire)


def cooker(b: ObjectBuilder) -> None:
    """A rice cooker or crock pot: a deep pot in a case with a switch; a glass lid lies against its side."""
    x, y, z = b.size
    r = 0.5 * min(x, y)
    shell = look(b, ("white", "black", "red", "steel"), "metal")
    b.add(turned_vessel([(0.8 * r, 0), (0.96 * r, 0.15 * z), (r, z)], 0.014, 7, 24, floor=0.02), shell)
    for s in (-1, 1):
        b.add(
            block((0.22 * r, 0.5 * (y - 2 * r) + 0.05 * r, 0.12 * z), (0, s * 0.97 * r, 0.8 * z)).visual_only(),
            look(b, ("black",)),
        )
    button(b, (0.97 * r, 0.0, 0.35 * z), look(b, ("red", "orange")))
    b.point("heat_source", (0.0, 0.0, 0.4 * z))


def hollow(
    b: ObjectBuilder, *, profile: tuple, colours: tuple, kind: str = "plastic", wall: float = 0.004, alpha: float = 1.0
) -> None:
    """A hollow turned thing, open above: a funnel's, a flask's, a shade's. profile: (radius / r, height / z)."""
    x, _, z = b.size
    surface = materials.glass(alpha=alpha) if alpha < 1 else look(b, colours, kind)
    b.add(turned_vessel([(u * x / 2, v * z) for u, v in profile], wall, 7, 20), surface)


def barrel(b: ObjectBuilder) -> None:
    """A barrel with hoops, open above."""
    x, _, z = b.size
    r = x / 2
    wood = look(b, ("oak", "walnut"), "wood")
    b.add(turned_vessel([(0.88 * r, 0), (0.98 * r, 0.5 * z), (0.9 * r, z)], 0.02, 7, 20, floor=0.03), wood)
    for h in (0.12, 0.36, 0.64, 0.88):
        band = r * (0.99 - 0.4 * (h - 0.5) ** 2)
        ring = [(band * math.cos(a), band * math.sin(a), h * z) for a in (k * math.pi / 8 for k in range(16))]
        b.add(tube(ring, 0.012, 4, hulls=0, closed=True), materials.plain("iron", "metal"))


def box_without_lid(b: ObjectBuilder, *, colours: tuple) -> None:
    """A litter box: a tray."""
    x, y, z = b.size
    b.add(tray(x, y, z, 0.006, 0.008), look(b, colours))


def camera(b: ObjectBuilder, *, foot: bool = False) -> None:
    """A digital camera, or a webcam on a foot: a body and a lens towards +x."""
    x, y, z = b.size
    body, low = look(b, ("black", "silver", "dark_grey")), 0.4 * z if foot else 0.0
    b.add(soft_box(0.6 * x, y, z - low, 0.1 * z).at(-0.2 * x, 0, low), body)
    lens = cylinder(0.32 * min(y, z - low), 0.45 * x, 16).turned("y", 90)
    b.add(lens.at(0.05 * x, 0, low + 0.5 * (z - low)), look(b, ("dark_grey", "black")))
    if foot:
        b.add(box(0.8 * x, 0.8 * y, 0.12 * z), body)
        b.add(rod((-0.2 * x, 0, 0.1 * z), (-0.2 * x, 0, 0.45 * z), 0.08 * z, 6), body)


def teeth(b: ObjectBuilder) -> None:
    """A denture or retainer: a bow with teeth."""
    x, y, z = b.size
    gum = look(b, ("pink", "rose"))
    path = [
        (0.4 * x * math.sin(a) - 0.1 * x, 0.42 * y * math.cos(a), 0.3 * z) for a in (k * math.pi / 8 for k in range(9))
    ]
    b.add(tube(path, 0.3 * z, 8, hulls=4), gum)
    for px, py, _ in path:
        b.add(
            ball(0.14 * x, 0.12 * y, 0.6 * z, 6).visual_only().at(px, py, 0.4 * z), materials.plain("white", "organic")
        )
    b.add(box(0.8 * x, 0.96 * y, z).collision_only(), gum)


def shower_head(b: ObjectBuilder) -> None:
    """A hand shower lying on its side: a grip and a round head."""
    x, y, z = b.size
    chrome = look(b, ("chrome", "white"), "metal", 0.7)
    b.add(rod((-x / 2, 0, 0.3 * z), (0.25 * x, 0, 0.3 * z), 0.28 * z, 10), chrome)
    b.add(cylinder(0.5 * y, 0.6 * z, 18).at(0.5 * x - 0.5 * y, 0, 0), chrome)


def fan(b: ObjectBuilder) -> None:
    """A table fan: a foot, a post, a cage with blades towards +x, and a switch."""
    x, y, z = b.size
    body = look(b, ("white", "black", "sky"))
    b.add(cylinder(0.48 * x, 0.08 * z, 20), body)
    b.add(rod((0, 0, 0.06 * z), (0, 0, 0.5 * z), 0.04 * z, 8), body)
    r, mid = 0.5 * y, z - 0.5 * y
    wheel = cylinder(r, 0.4 * x, 20).turned("y", 90).at(-0.2 * x, 0, mid)
    b.add(wheel.collision_only(), body)
    for k in range(10):
        a = 2 * math.pi * k / 10
        tip = (0.2 * x, 0.98 * r * math.cos(a), mid + 0.98 * r * math.sin(a))
        b.add(rod((0.2 * x, 0, mid), tip, 0.006 * z, 4).visual_only(), body)
    for k in range(4):
        a = math.pi * k / 2 + 0.4
        b.add(
            block(
                (0.04 * x, 0.5 * r, 0.5 * r), (0, 0.45 * r * math.cos(a), mid + 0.45 * r * math.sin(a))
            ).visual_only(),
            look(b, ("sky", "grey")),
        )
    rim = [(0.2 * x, r * math.cos(a), mid + r * math.sin(a)) for a in (k * math.pi / 10 for k in range(20))]
    b.add(tube(rim, 0.01 * z, 5, hulls=0, closed=True), body)
    button(b, (0.4 * x, 0, 0.08 * z), look(b, ("red", "blue")), facing="z")


def appliance(b: ObjectBuilder, *, colours: tuple, round_speaker: bool = False) -> None:
    """A box with a switch on its front: a dehumidifier, a radio."""
    x, y, z = b.size
    b.add(soft_box(x, y, z, 0.08 * min(x, z)), look(b, colours))
    grey = look(b, ("dark_grey", "black"))
    if round_speaker:
        b.add(cylinder(0.32 * z, 0.004, 18).visual_only().turned("y", 90).at(x / 2 - 0.002, -0.22 * y, 0.5 * z), grey)
    else:
        for k in range(5):
            b.add(block((0.004, 0.7 * y, 0.02 * z), (x / 2, 0, (0.25 + 0.08 * k) * z)).visual_only(), grey)
    button(b, (x / 2, 0.3 * y, 0.82 * z), look(b, ("red", "silver")))


def blower(b: ObjectBuilder) -> None:
    """A hand blower lying on its side: a nozzle towards +x, a grip, a switch."""
    x, y, z = b.size
    shell = look(b, ("red", "black", "teal"))
    r = 0.42 * z
    b.add(rod((-x / 2, 0.25 * y, z / 2), (x / 2, 0.25 * y, z / 2), r, 12), shell)
    b.add(rod((-0.2 * x, 0.2 * y, z / 2), (-0.26 * x, -0.42 * y, z / 2), 0.28 * z, 10), look(b, ("black", "dark_grey")))
    button(b, (-0.23 * x, -0.1 * y, z / 2 + 0.28 * z), look(b, ("silver", "red")), facing="z")


CATEGORIES = [
    Entry("trombone", horn, (0.900, 0.240, 0.160), 1.50, 2),
    Entry("cornet", horn, (0.340, 0.150, 0.110), 1.00, 2),
    Entry("sax", horn, (0.650, 0.220, 0.130), 2.20, 2, options={"long": 1.0}),
    Entry("violin", violin, (0.590, 0.210, 0.065), 0.45, 2),
    Entry("birdcage", cage, (0.340, 0.340, 0.520), 1.80, 2, rest="upright", uniform=True),
    Entry("crock_pot", cooker, (0.300, 0.330, 0.200), 3.00, 2, rest="upright", uniform=True),
    Entry("rice_cooker", cooker, (0.240, 0.270, 0.220), 2.20, 2, rest="upright", uniform=True),
    Entry(
        "funnel",
        hollow,
        (0.130, 0.130, 0.120),
        0.06,
        2,
        uniform=True,
        options={"colours": ("red", "sky"), "profile": ((0.14, 0), (0.16, 0.4), (1.0, 1.0))},
    ),
    Entry(
        "erlenmeyer_flask",
        hollow,
        (0.105, 0.105, 0.180),
        0.16,
        2,
        rest="standing",
        uniform=True,
        options={"colours": ("glass",), "alpha": 0.4, "profile": ((0.94, 0), (1.0, 0.06), (0.35, 0.72), (0.35, 1.0))},
    ),
    Entry(
        "canteen",
        hollow,
        (0.120, 0.120, 0.200),
        0.30,
        2,
        rest="standing",
        uniform=True,
        options={
            "colours": ("green", "steel"),
            "kind": "metal",
            "profile": ((0.9, 0), (1.0, 0.1), (1.0, 0.7), (0.5, 0.88), (0.45, 1.0)),
        },
    ),
    Entry(
        "lampshade",
        hollow,
        (0.320, 0.320, 0.220),
        0.35,
        2,
        rest="standing",
        uniform=True,
        options={"colours": ("cream", "beige"), "kind": "fabric", "profile": ((0.6, 0), (1.0, 1.0))},
    ),
    Entry(
        "paper_coffee_filter",
        hollow,
        (0.130, 0.130, 0.050),
        0.002,
        2,
        uniform=True,
        options={"colours": ("white", "tan"), "kind": "paper", "wall": 0.002, "profile": ((0.5, 0), (1.0, 1.0))},
    ),
    Entry("beer_barrel", barrel, (0.400, 0.400, 0.520), 12.0, 2, rest="upright", uniform=True),
    Entry(
        "litter_box",
        box_without_lid,
        (0.460, 0.360, 0.140),
        0.90,
        2,
        rest="upright",
        options={"colours": ("blue", "grey")},
    ),
    Entry("digital_camera", camera, (0.080, 0.120, 0.080), 0.45, 2, rest="standing"),
    Entry("webcam", camera, (0.060, 0.070, 0.080), 0.12, 2, rest="standing", options={"foot": True}),
    Entry("denture", teeth, (0.055, 0.060, 0.024), 0.03, 2),
    Entry("retainer", teeth, (0.050, 0.055, 0.014), 0.01, 2),
    Entry("showerhead", shower_head, (0.240, 0.100, 0.050), 0.30, 2),
    Entry("electric_fan", fan, (0.200, 0.300, 0.420), 2.20, 2, rest="upright"),
    Entry(
        "dehumidifier",
        appliance,
        (0.230, 0.330, 0.480),
        9.0,
        2,
        rest="upright",
        options={"colours": ("white", "light_grey")},
    ),
    Entry(
        "radio_receiver",
        appliance,
        (0.090, 0.260, 0.150),
        1.10,
        2,
        rest="standing",
        options={"colours": ("brown", "cream", "red"), "round_speaker": True},
    ),
    Entry("hand_blower", blower, (0.240, 0.200, 0.080), 0.55, 2),
]
