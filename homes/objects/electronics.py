"""Computers, televisions, telephones' relatives, clocks, scales, loudspeakers."""

from __future__ import annotations

import math

from ..shapes import materials, textures
from ..shapes.bricks import Solid, ball, block, box, cylinder, decal, hull, join, lathe, rod, soft_box, tube
from .entry import Entry
from .model import ObjectBuilder
from .parts import button, knob


def display(b: ObjectBuilder, name: str = "screen") -> materials.Material:
    return materials.picture(name, textures.screen(b.rng), kind="screen", shine=0.9)


def case(b: ObjectBuilder) -> materials.Material:
    return b.pick(
        (
            materials.plain("black"),
            materials.plain("dark_grey"),
            materials.plain("white"),
            materials.plain("silver", "metal", 0.6),
        )
    )


def screen_on_foot(b: ObjectBuilder, *, foot: bool = True) -> None:
    """A monitor or television on its foot; without foot: one for a wall, its back at -x."""
    x, y, z = b.size
    body = b.pick((materials.plain("black"), materials.plain("dark_grey"), materials.plain("silver", "metal", 0.6)))
    stand = 0.16 * z if foot else 0.0
    thick = 0.04 if foot else x
    b.add(soft_box(thick, y, z - stand, 0.01).at(z=stand), body)
    front = thick / 2 + 0.0006
    b.add(decal(0.96 * y, 0.92 * (z - stand)).at(front, 0, (z + stand) / 2), display(b))
    if foot:
        b.add(soft_box(x, 0.36 * y, 0.016, 0.006), body)
        b.add(box(0.03, 0.08 * y + 0.02, stand + 0.03).at(), body)
    button(b, (front, 0.44 * y, stand + 0.025), materials.plain("red"), 0.006)


def laptop(b: ObjectBuilder) -> None:
    """A keyboard base and a screen lid hinged at the rear edge (-x); closed at 0."""
    x, y, z = b.size
    body = b.pick((materials.plain("silver", "metal", 0.6), materials.plain("dark_grey"), materials.plain("black")))
    low = 0.6 * z
    b.add(box(x, y, low), body)
    pad = materials.picture("keyboard", textures.keys((0.2, 0.2, 0.21), (0.07, 0.07, 0.08), 14, 5))
    b.add(decal(0.9 * y, 0.5 * x, "z").at(-0.15 * x, 0, low + 0.0004), pad)
    b.add(box(0.24 * x, 0.3 * y, 0.0003).visual_only().at(0.3 * x, 0, low), materials.plain("grey"))
    link = b.hinge("lid", (-x / 2, 0, low + 0.001), (0, -1, 0), 2.1, True)
    link.add(box(x, y, z - low - 0.001).at(z=low + 0.001), body)
    shown = Solid(decal(0.94 * y, 0.92 * x, "z").turned("x", 180).visuals).at(0, 0, low + 0.0008)
    link.add(shown, display(b))
    link.add(box(0.05, 0.05, 0.0004).visual_only().turned("z", 45).at(0, 0, z), materials.plain("light_grey"))
    b.point("toggle_button", (-0.42 * x, 0.42 * y, low))


def keyboard(b: ObjectBuilder) -> None:
    x, y, z = b.size
    body = case(b)
    b.add(
        hull(
            [(sx * x / 2, sy * y / 2, h) for sx, h in ((1, 0.0), (1, 0.55 * z), (-1, 0.0), (-1, z)) for sy in (-1, 1)]
        ),
        body,
    )
    pad = materials.picture("keys", textures.keys((0.15, 0.15, 0.16), (0.86, 0.86, 0.85), 18, 5))
    slope = math.degrees(math.atan2(0.45 * z, x))
    b.add(decal(0.95 * y, 0.86 * x, "z").turned("y", slope).at(0, 0, 0.775 * z + 0.0006), pad)


def mouse(b: ObjectBuilder) -> None:
    x, y, z = b.size
    body = case(b)
    b.add(ball(x, y, 2 * z, 14).visual_only().at(z=-z), body)
    b.add(
        hull(
            [
                (0.5 * x * math.cos(a) * k, 0.5 * y * math.sin(a) * k, h * z)
                for a in (j * math.pi / 4 for j in range(8))
                for k, h in ((1, 0), (0.9, 0.45), (0.4, 1))
            ]
        ).collision_only(),
        body,
    )
    b.add(
        cylinder(0.06 * x, 0.006, 10).visual_only().at(z=-0.003).turned("x", 90).at(0.25 * x, 0, 0.87 * z),
        materials.plain("grey"),
    )
    b.point("toggle_button", (0.3 * x, 0.15 * y, 0.85 * z))


def box_device(b: ObjectBuilder, *, lamps: bool = True, vents: bool = True, on: bool = True) -> None:
    """A modem, hard drive, computer case, game console: a box with lamps on its front (+x) and a button."""
    x, y, z = b.size
    body = case(b)
    b.add(soft_box(x, y, z, 0.1 * min(x, y, z), 1), body)
    front = x / 2
    if lamps:
        for k in range(4):
            b.add(
                box(0.002, 0.008, 0.006).visual_only().at(front, (k - 1.5) * 0.12 * y, 0.7 * z),
                materials.plain("lime" if k else "orange"),
            )
    if vents:
        for k in range(5):
            b.add(
                box(0.5 * x, 0.02 * y, 0.001).visual_only().at(-0.1 * x, (k - 2) * 0.1 * y, z), materials.plain("black")
            )
    if on:
        button(b, (front, 0.38 * y, 0.35 * z), materials.plain("sky"), min(0.008, 0.2 * z))


def router(b: ObjectBuilder) -> None:
    """A flat box with two aerials."""
    x, y, z = b.size
    body = case(b)
    low = 0.2 * z
    b.add(soft_box(x, y, low, 0.3 * low, 1), body)
    for s in (-1, 1):
        b.add(rod((-0.45 * x, s * 0.42 * y, 0.6 * low), (-0.47 * x, s * 0.45 * y, z), 0.005), materials.plain("black"))
    for k in range(4):
        b.add(box(0.002, 0.008, 0.004).visual_only().at(x / 2, (k - 1.5) * 0.1 * y, 0.5 * low), materials.plain("lime"))
    b.point("toggle_button", (x / 2, 0.4 * y, low / 2))


def tower(b: ObjectBuilder) -> None:
    """A processor board's case or the board itself: a green board with chips."""
    x, y, z = b.size
    b.add(box(x, y, 0.2 * z), materials.plain((0.10, 0.36, 0.20)))
    b.add(box(0.3 * x, 0.3 * y, 0.5 * z).at(0.1 * x, 0, 0.2 * z), materials.metal("silver"))
    for px, py in ((-0.3, -0.2), (-0.3, 0.1), (-0.3, 0.3), (0.3, 0.32), (0.35, -0.3)):
        b.add(box(0.16 * x, 0.1 * y, 0.3 * z).at(px * x, py * y, 0.2 * z).visual_only(), materials.plain("black"))
    b.add(box(0.06 * x, 0.8 * y, 0.8 * z).at(-0.46 * x, 0, 0.2 * z), materials.plain("dark_grey"))
    b.point("toggle_button", (0.1 * x, 0, 0.7 * z))


def printer(b: ObjectBuilder, *, phone: bool = False) -> None:
    """A printer or a fax: body, paper at the rear, tray in front, panel; a fax has a handset."""
    x, y, z = b.size
    body = b.pick((materials.plain("white"), materials.plain("dark_grey"), materials.plain("cream")))
    main = 0.7 * z
    b.add(soft_box(0.8 * x, y, main, 0.02).at(-0.1 * x), body)
    b.add(box(0.24 * x, 0.6 * y, 0.02).at(0.38 * x, 0, 0.15 * z), materials.plain("black"))
    b.add(
        block((0.006, 0.55 * y, 0.32 * z), (0, 0, 0)).turned("y", -15).at(-0.4 * x, 0, 0.86 * z),
        materials.plain("paper", "paper"),
    )
    pad = materials.picture("panel", textures.keys((0.3, 0.3, 0.32), (0.8, 0.8, 0.8), 6, 3))
    b.add(decal(0.4 * y, 0.2 * x, "z").at(0.12 * x, 0.22 * y, main + 0.0005), pad)
    if phone:
        b.add(soft_box(0.6 * x, 0.16 * y, 0.18 * z).at(-0.1 * x, -0.4 * y, main), materials.plain("black"))
    b.add(cylinder(0.01, 0.003, 10).visual_only().at(0.2 * x, -0.2 * y, main), materials.plain("lime"))
    b.point("toggle_button", (0.2 * x, -0.2 * y, main))


def scanner(b: ObjectBuilder) -> None:
    """A flat bed with a lid (one collision hull)."""
    x, y, z = b.size
    b.add(soft_box(x, y, 0.6 * z, 0.01), materials.plain("dark_grey"))
    b.add(
        soft_box(0.94 * x, y, 0.4 * z, 0.01).at(-0.03 * x, 0, 0.6 * z),
        b.pick((materials.plain("light_grey"), materials.plain("white"))),
    )
    button(b, (x / 2 - 0.012, 0.3 * y, 0.6 * z), materials.plain("lime"), 0.006, "z")


def alarm(b: ObjectBuilder) -> None:
    """A twin-bell alarm clock."""
    x, y, z = b.size
    look = materials.plain(b.pick(("red", "mint", "black", "sky")), "metal", 0.6)
    metal = materials.metal("silver")
    r = 0.40 * min(y, z)
    middle = r + 0.09 * z
    b.add(cylinder(r, x, 20).turned("y", 90).at(-x / 2, 0, middle), look)
    b.add(decal(1.3 * r, 1.3 * r).at(x / 2 + 0.0005, 0, middle), materials.picture("dial", textures.dial()))
    # Felt as a foot as deep as the drum, so that the clock does not roll over its two thin legs.
    b.add(box(0.9 * x, 1.3 * r, 0.3 * middle).collision_only(), metal)
    for s in (-1, 1):
        b.add(rod((0, s * 0.55 * r, 0.3 * middle), (0, s * 0.85 * r, 0), 0.06 * r + 0.001, 6).visual_only(), metal)
        b.add(ball(0.6 * r, 0.6 * r, 0.4 * r, 10).turned("x", -s * 35).at(0, s * 0.55 * r, middle + 0.75 * r), metal)
    arch = [
        (0, 0.62 * r * math.cos(a), middle + r + (z - middle - r - 0.003) * math.sin(a))
        for a in (k * math.pi / 6 for k in range(7))
    ]
    b.add(tube(arch, 0.003, 5, hulls=0) + block((0.02, 0.7 * r, 0.006), (0, 0, z - 0.004)).collision_only(), metal)
    b.point("toggle_button", (0, 0, z))


def calculator(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(soft_box(x, y, z, 0.4 * z, 1), case(b))
    b.add(
        decal(0.86 * y, 0.58 * x, "z").at(0.14 * x, 0, z + 0.0004),
        materials.picture("keys", textures.keys((0.2, 0.2, 0.2), (0.85, 0.85, 0.85), 4, 5)),
    )
    b.add(
        decal(0.86 * y, 0.2 * x, "z").at(-0.32 * x, 0, z + 0.0004),
        materials.picture("lcd", textures.screen(b.rng, (0.55, 0.62, 0.5))),
    )
    b.point("toggle_button", (-0.1 * x, 0.35 * y, z))


def headset(b: ObjectBuilder) -> None:
    """Headphones lying with the bow upright: two cups and a bow."""
    x, y, z = b.size
    look = materials.plain(b.pick(("black", "white", "red")))
    r = 0.42 * x
    for s in (-1, 1):
        b.add(cylinder(r, 0.2 * y, 16).turned("x", 90).at(0, s * y / 2 + (0.2 * y if s < 0 else 0.0), r), look)
        b.add(
            cylinder(0.8 * r, 0.04 * y, 16)
            .visual_only()
            .turned("x", 90)
            .at(0, s * 0.3 * y + (0.04 * y if s < 0 else 0), r),
            materials.plain("dark_grey", "fabric"),
        )
    bow = [
        (0, 0.44 * y * math.cos(a), r + (z - r - 0.008) * math.sin(a)) for a in (k * math.pi / 10 for k in range(11))
    ]
    b.add(tube(bow, 0.007, 6, hulls=4), look)
    if b.pick((True, False)):
        b.add(
            tube(
                [(0, -0.45 * y, 0.6 * r), (0.5 * x, -0.35 * y, 0.3 * r), (0.6 * x, -0.1 * y, 0.3 * r)],
                0.003,
                5,
                hulls=0,
            ),
            look,
        )
    b.point("toggle_button", (0, 0.5 * y, r))


def loudspeaker(b: ObjectBuilder, *, pair: bool = False) -> None:
    """A box with cones; a speaker system has a middle unit between two boxes."""
    x, y, z = b.size
    body = b.pick((materials.plain("black"), materials.wood("walnut", b.rng), materials.plain("dark_grey")))
    cone = materials.plain("iron", "rubber")
    widths = [(0.0, y)] if not pair else [(-0.38 * y, 0.22 * y), (0.38 * y, 0.22 * y)]
    for yy, w in widths:
        b.add(box(x, w, z).at(0, yy), body)
        for h, k in ((0.3, 0.4), (0.72, 0.26)):
            r = k * min(w, 0.6 * z)
            b.add(
                lathe([(r, 0), (0.9 * r, 0.008), (0.3 * r, 0.002)], 18)
                .visual_only()
                .turned("y", 90)
                .at(x / 2, yy, h * z),
                cone,
            )
    if pair:
        b.add(box(0.9 * x, 0.5 * y, 0.45 * z), body)
        b.add(knob(0.02, 0.015).visual_only().at(0.45 * x, 0, 0.22 * z), materials.metal("silver"))
    b.point("toggle_button", (x / 2, 0.0, 0.1 * z))


def bulb(b: ObjectBuilder) -> None:
    x, _, z = b.size
    r = x / 2
    b.add(lathe([(0.35 * r, 0), (0.38 * r, 0.3 * z)], 12), materials.metal("silver"))
    b.add(
        lathe([(0.38 * r, 0.3 * z), (0.7 * r, 0.48 * z), (r, 0.7 * z), (0.75 * r, 0.92 * z), (0.1 * r, z)], 16),
        materials.glass("cream", 0.8),
    )
    b.point("toggle_button", (0, 0, 0))


def scale(b: ObjectBuilder, *, analog: bool = False) -> None:
    """A kitchen scale: with a dial and a pan, or a flat digital one."""
    x, y, z = b.size
    look = b.pick((materials.plain("white"), materials.plain("red"), materials.metal("steel", b.rng)))
    if analog:
        b.point("toggle_button", (0.4 * x, 0.3 * y, 0.35 * z))
        b.add(
            hull(
                [
                    (sx * w * x / 2, sy * w * y / 2, h)
                    for w, h in ((1, 0), (0.7, 0.7 * z))
                    for sx in (-1, 1)
                    for sy in (-1, 1)
                ]
            ),
            look,
        )
        tilt = math.degrees(math.atan2(0.15 * x, 0.7 * z))
        b.add(
            decal(0.5 * z, 0.5 * z).turned("y", -tilt).at(0.425 * x + 0.002, 0, 0.35 * z),
            materials.picture("dial", textures.dial(hands=False)),
        )
        b.add(
            lathe([(0.1 * x, 0.7 * z), (0.45 * x, 0.85 * z), (0.5 * x, z), (0.46 * x, 0.9 * z)], 20),
            materials.metal("silver"),
        )
    else:
        b.add(soft_box(x, y, z, 0.3 * z), look)
        b.add(
            decal(0.3 * y, 0.16 * x, "z").at(0.38 * x, 0, z + 0.0004),
            materials.picture("lcd", textures.screen(b.rng, (0.5, 0.6, 0.5))),
        )
        b.add(cylinder(0.36 * x, 0.002, 20).visual_only().at(-0.1 * x, 0, z), materials.glass("glass", 0.6))
        b.point("toggle_button", (0.4 * x, 0.3 * y, z))


def cartridge(b: ObjectBuilder) -> None:
    x, y, z = b.size
    b.add(box(x, y, 0.8 * z), materials.plain("black"))
    b.add(box(0.5 * x, y, 0.2 * z).at(-0.2 * x, 0, 0.8 * z), materials.plain(b.pick(("sky", "pink", "yellow"))))


def game(b: ObjectBuilder) -> None:
    """A boxed video game: a case with a cover."""
    x, y, z = b.size
    ground = b.pick(("blue", "green", "red"))
    b.add(box(x, y, z), materials.plain(ground))
    b.add(
        decal(0.94 * y, 0.94 * x, "z").at(z=z + 0.0003),
        materials.picture("cover", textures.label(materials.colour("black"), materials.colour(ground), b.rng)),
    )
    b.point("toggle_button", (0.3 * x, 0.3 * y, z))


def cord(b: ObjectBuilder) -> None:
    """A coiled cable with a plug."""
    x, y, z = b.size
    look = materials.plain(b.pick(("black", "white", "orange")), "rubber")
    r = min(x - 0.03, y) / 2
    solids = []
    for k in range(2):
        path = [
            (r * (0.93 - 0.16 * k) * math.cos(a), r * (0.93 - 0.16 * k) * math.sin(a), z * (0.3 + 0.35 * k))
            for a in (j * math.pi / 8 for j in range(16))
        ]
        solids.append(tube(path, 0.26 * z, 6, hulls=7 if k == 0 else 0, closed=True))
    b.add(join(solids).at(-0.015), look)
    b.add(soft_box(0.04, 0.024, z).at(x / 2 - 0.02), look)


CATEGORIES = [
    Entry("monitor", screen_on_foot, (0.200, 0.550, 0.430), 4.5, 5, rest="upright"),
    Entry("standing_tv", screen_on_foot, (0.260, 1.150, 0.740), 14.0, 5, rest="upright", fixed=True, vary=0.12),
    Entry("wall_mounted_tv", screen_on_foot, (0.060, 1.200, 0.690), 13.0, 5, rest="upright", fixed=True, vary=0.12,
          options={"foot": False}),
    Entry("laptop", laptop, (0.230, 0.330, 0.020), 1.6, 5, rest="upright"),
    Entry("keyboard", keyboard, (0.150, 0.440, 0.028), 0.65, 4, rest="upright"),
    Entry("mouse", mouse, (0.108, 0.062, 0.036), 0.09, 4, rest="upright"),
    Entry("modem", box_device, (0.150, 0.190, 0.035), 0.35, 3, rest="upright"),
    Entry("hard_drive", box_device, (0.115, 0.078, 0.016), 0.18, 3, options={"vents": False}),
    Entry("cpu_board", tower, (0.240, 0.240, 0.040), 0.7, 2),
    Entry("router", router, (0.150, 0.220, 0.150), 0.4, 3, rest="upright"),
    Entry("printer", printer, (0.380, 0.440, 0.300), 6.5, 5, rest="upright", two_hands=True),
    Entry("facsimile", printer, (0.340, 0.360, 0.220), 4.0, 3, rest="upright", options={"phone": True}),
    Entry("scanner", scanner, (0.280, 0.430, 0.060), 2.4, 3, rest="upright"),
    Entry("alarm", alarm, (0.060, 0.110, 0.140), 0.28, 4, rest="upright"),
    Entry("calculator", calculator, (0.150, 0.085, 0.016), 0.13, 3),
    Entry("headset", headset, (0.090, 0.180, 0.190), 0.25, 4, rest="upright"),
    Entry("loudspeaker", loudspeaker, (0.220, 0.200, 0.330), 4.5, 4, rest="upright"),
    Entry("speaker_system", loudspeaker, (0.200, 0.900, 0.300), 9.0, 3, rest="upright", options={"pair": True}),
    Entry("light_bulb", bulb, (0.062, 0.062, 0.110), 0.06, 3, uniform=True),
    Entry("digital_scale", scale, (0.220, 0.180, 0.026), 0.6, 3, rest="upright"),
    Entry("kitchen_analog_scale", scale, (0.200, 0.200, 0.230), 1.3, 3, rest="upright", uniform=True,
          options={"analog": True}),
    Entry("ink_cartridge", cartridge, (0.070, 0.020, 0.042), 0.04, 2),
    Entry("video_game", game, (0.190, 0.135, 0.015), 0.12, 3),
    Entry("cord", cord, (0.190, 0.160, 0.016), 0.25, 3),
]  # fmt: skip
