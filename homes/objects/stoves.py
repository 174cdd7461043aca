"""Stoves (hob over an oven), built-in ovens, microwaves, hobs, grills."""

from __future__ import annotations

from ..shapes import materials, textures
from ..shapes.bricks import block, box, cylinder, decal, join, lathe, rod, soft_box
from ..shapes.materials import Material
from .entry import Entry
from .model import ObjectBuilder
from .parts import bow_handle, button, carcass, door, flap, knob, lid


def _body(b: ObjectBuilder) -> Material:
    return b.pick((materials.metal("steel", b.rng), materials.plain("white"), materials.plain("black")))


def burners(b: ObjectBuilder, x: float, y: float, z: float, spots: list[tuple[float, float]], gas: bool) -> None:
    """Rings (electric) or grates (gas) on a hob at height z; only seen, so that a pan stands level on the plate."""
    iron = materials.metal("iron")
    for k, (px, py) in enumerate(spots):
        radius = (0.09, 0.075)[k % 2] * min(1.0, x / 0.55)
        if gas:
            b.add(cylinder(radius * 0.45, 0.004, 12).visual_only().at(px, py, z), iron)
            for a in (0, 90):
                b.add(block((2 * radius, 0.009, 0.004), (0, 0, 0.003)).visual_only().turned("z", a).at(px, py, z), iron)
        else:
            b.add(cylinder(radius, 0.0015, 20).visual_only().at(px, py, z), iron)
            b.add(cylinder(radius * 0.6, 0.0022, 20).visual_only().at(px, py, z), materials.metal("dark_grey"))


def four_spots(x: float, y: float) -> list[tuple[float, float]]:
    return [(sx * 0.22 * x, sy * 0.24 * y) for sx in (-1, 1) for sy in (-1, 1)]


def _cavity(
    b: ObjectBuilder, x: float, y: float, low: float, high: float, body: Material, shift: float, racks: int
) -> None:
    """An oven's hollow body between two heights, with wire racks."""
    height = high - low
    b.add(carcass(x, y, height, 0.04, back=0.04).at(shift, 0, low), body)
    dark = materials.plain("dark_grey")
    b.add(block((0.003, y - 0.08, height - 0.08), (shift - x / 2 + 0.042, 0, (low + high) / 2)).visual_only(), dark)
    for k in range(racks):
        at = low + 0.04 + (k + 1) * (height - 0.08) / (racks + 1)
        b.add(block((x - 0.06, y - 0.08, 0.006), (shift + 0.015, 0, at)).collision_only(), dark)
        for j in range(7):
            yy = (j - 3) * (y - 0.1) / 6.5
            b.add(
                rod((shift - x / 2 + 0.045, yy, at), (shift + x / 2 - 0.02, yy, at), 0.003, 5).visual_only(),
                materials.metal("chrome"),
            )
        for e in (-0.4, 0.45):
            b.add(
                rod((shift + e * x, -y / 2 + 0.04, at), (shift + e * x, y / 2 - 0.04, at), 0.003, 5).visual_only(),
                materials.metal("chrome"),
            )


def _oven_door(b: ObjectBuilder, plane: float, y: float, z: tuple[float, float], body: Material, skin: float) -> None:
    handle = bow_handle(0.75 * y, 0.04, 0.009)
    link = flap(b, "door", plane, y, z, body, handle, materials.metal("chrome"), depth=0.035, skin=skin, angle=1.45)
    pane = block((0.003, 0.7 * y, 0.5 * (z[1] - z[0])), (plane + 0.0365, 0, (z[0] + z[1]) / 2 - 0.02)).visual_only()
    link.add(pane, materials.plain("black", shine=0.8))


def stove(b: ObjectBuilder) -> None:
    """A hob with four rings over an oven with a flap, knobs on the front panel."""
    x, y, z = b.size
    body = _body(b)
    leaf = 0.035
    depth = x - leaf - 0.05
    shift = -(x - depth) / 2
    b.add(block((depth - 0.04, y - 0.02, 0.1), (shift, 0, 0.05)), materials.plain("black"))
    top = z - 0.03
    panel = 0.12
    _cavity(b, depth, y, 0.1, top - panel, body, shift, 2)
    b.add(block((depth, y, panel), (shift, 0, top - panel / 2)), body)
    b.add(
        block((depth + leaf, y, 0.03), (shift + leaf / 2, 0, z - 0.015)),
        b.pick((materials.plain("black", shine=0.8), body)),
    )
    plane = shift + depth / 2
    b.add(block((leaf, y, panel), (plane + leaf / 2, 0, top - panel / 2)), body)
    gas = b.pick((True, False))
    burners(b, depth, y, z, [(px + shift, py) for px, py in four_spots(depth, y)], gas)
    dial = materials.plain("black" if body.name != "black" else "silver")
    for k in range(5):
        b.add(knob(0.02, 0.022).visual_only().at(plane + leaf, (k - 2) * y / 6, top - panel / 2), dial)
    b.point("toggle_button", (plane + leaf + 0.02, 0, top - panel / 2))
    b.point("heat_source", (shift, 0, z + 0.02))
    _oven_door(b, plane, y - 0.004, (0.105, top - panel - 0.005), body, 0.004)


def burner(b: ObjectBuilder) -> None:
    """A hob to be set into a counter or on a table: a flat plate with rings."""
    x, y, z = b.size
    gas = b.pick((True, False))
    b.add(soft_box(x, y, z, 0.01), materials.plain("black", shine=0.8) if not gas else materials.metal("steel", b.rng))
    spots = four_spots(x, y) if y > 0.45 else [(0.0, 0.0)]
    burners(b, x, y, z, spots, gas)
    b.point("heat_source", (0, 0, z + 0.02))
    button(b, (x / 2 - 0.03, 0, z), materials.plain("red"), 0.014, "z")


def oven(b: ObjectBuilder) -> None:
    """A built-in oven: cavity with racks, flap, control panel on top."""
    x, y, z = b.size
    body = _body(b)
    leaf = 0.035
    depth = x - leaf - 0.05
    shift = -(x - depth) / 2
    panel = 0.11
    _cavity(b, depth, y, 0, z - panel, body, shift, 2)
    b.add(block((depth + leaf, y, panel), (shift + leaf / 2, 0, z - panel / 2)), body)
    plane = shift + depth / 2
    for k in (-1, 1):
        b.add(knob(0.02, 0.022).visual_only().at(plane + leaf, k * 0.3 * y, z - panel / 2), materials.plain("silver"))
    face = materials.picture("display", textures.screen(b.rng, (0.02, 0.12, 0.1)), kind="screen")
    b.add(decal(0.25 * y, 0.04).at(plane + leaf + 0.001, 0, z - panel / 2), face)
    b.point("toggle_button", (plane + leaf + 0.01, 0.3 * y, z - panel / 2))
    b.point("heat_source", (shift, 0, (z - panel) / 2))
    _oven_door(b, plane, y - 0.004, (0.004, z - panel - 0.004), body, 0.0065)


def microwave(b: ObjectBuilder) -> None:
    """A hollow box with a turntable, a side-hinged door and a control panel on the right."""
    x, y, z = b.size
    body = _body(b)
    leaf = 0.03
    depth = x - leaf
    shift = -leaf / 2
    wall = 0.015
    panel = 0.22 * y
    for dx, dy in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        b.add(cylinder(0.015, 0.01, 8).visual_only().at(dx * 0.4 * x, dy * 0.42 * y, 0), materials.plain("black"))
    base = 0.01
    b.add(box(0.84 * x, 0.88 * y, base).collision_only(), materials.plain("black"))
    room = y - panel
    height = z - base
    middle = -panel / 2
    b.add(carcass(depth, room, height, wall, back=wall).at(shift, middle, base), body)
    b.add(block((depth, panel, height), (shift, (y - panel) / 2, base + height / 2)), body)
    b.add(
        block(
            (0.002, room - 2 * wall, height - 2 * wall), (shift - depth / 2 + wall + 0.001, middle, base + height / 2)
        ).visual_only(),
        materials.plain("cream"),
    )
    plate = min(depth, room) * 0.42
    b.add(lathe([(plate, 0), (plate, 0.006)]).at(shift, middle, base + wall), materials.glass("glass", 0.6))
    plane = shift + depth / 2
    link = door(
        b,
        "door",
        plane,
        (-y / 2, y / 2 - panel - 0.002),
        (base + 0.004, z),
        body,
        bow_handle(0.6 * z, 0.02, upright=True),
        materials.metal("chrome"),
        depth=leaf - 0.026 + 0.004,
        angle=1.9,
    )
    window = block((0.002, 0.7 * room, 0.6 * height), (plane + leaf - 0.021, middle, base + height / 2)).visual_only()
    link.add(window, materials.plain("black", shine=0.8))
    pad = materials.picture("keypad", textures.keys((0.1, 0.1, 0.11), (0.75, 0.76, 0.78), 3, 5), kind="plastic")
    b.add(decal(0.75 * panel, 0.5 * height).at(plane + 0.001, (y - panel) / 2, base + 0.42 * height), pad)
    shown = materials.picture("display", textures.screen(b.rng, (0.02, 0.2, 0.12)), kind="screen")
    b.add(decal(0.75 * panel, 0.12 * height).at(plane + 0.001, (y - panel) / 2, base + 0.82 * height), shown)
    b.point("toggle_button", (plane + 0.005, (y - panel) / 2, base + 0.15 * height))
    b.point("heat_source", (shift, middle, base + height / 2))


def grill(b: ObjectBuilder) -> None:
    """A kettle or box barbecue: fire tub on legs with a grate and a lid."""
    x, y, z = b.size
    iron = materials.plain(b.pick(("black", "dark_red", "dark_green")), "metal", 0.6)
    steel = materials.metal("chrome")
    rack = 0.72 * z
    tub = 0.24
    for sx in (-1, 1):
        for sy in (-1, 1):
            b.add(
                rod((sx * 0.42 * x, sy * 0.3 * y, 0), (sx * 0.36 * x, sy * 0.27 * y, rack - tub + 0.02), 0.014), steel
            )
    walls = join(
        [
            block((x, 0.6 * y, 0.012), (0, 0, rack - tub)),
            block((0.012, 0.6 * y, tub), (x / 2 - 0.006, 0, rack - tub / 2)),
            block((0.012, 0.6 * y, tub), (-x / 2 + 0.006, 0, rack - tub / 2)),
            block((x, 0.012, tub), (0, 0.3 * y, rack - tub / 2)),
            block((x, 0.012, tub), (0, -0.3 * y, rack - tub / 2)),
        ]
    )
    b.add(walls, iron)
    b.add(block((x - 0.03, 0.6 * y - 0.03, 0.008), (0, 0, rack - 0.035)).collision_only(), steel)
    for k in range(9):
        yy = (k - 4) * 0.066 * y
        b.add(rod((-x / 2 + 0.012, yy, rack - 0.031), (x / 2 - 0.012, yy, rack - 0.031), 0.004, 5).visual_only(), steel)
    for s in (-1, 1):
        b.add(block((0.7 * x, 0.17 * y, 0.02), (0, s * 0.4 * y, rack - 0.05)), materials.wood("teak", b.rng))
    b.add(block((0.01, 0.14, 0.05), (x / 2 + 0.003, 0, rack - 0.12)).visual_only(), steel)
    button(b, (x / 2 + 0.01, 0.0, rack - 0.12), materials.plain("red"))
    b.point("heat_source", (0, 0, rack - 0.02))
    dome = join(
        [
            block((x, 0.6 * y, 0.012), (0, 0, rack + 0.2)),
            block((0.012, 0.6 * y, 0.2), (-x / 2 + 0.006, 0, rack + 0.104)),
            block((0.012, 0.6 * y, 0.2), (x / 2 - 0.006, 0, rack + 0.104)),
            block((x, 0.012, 0.2), (0, 0.3 * y, rack + 0.104)),
            block((x, 0.012, 0.2), (0, -0.3 * y, rack + 0.104)),
        ]
    )
    link = lid(b, "lid", dome, iron, -x / 2, rack + 0.004, angle=1.75, openable=False)
    link.add(bow_handle(0.3 * y).at(x / 2, 0, rack + 0.06), steel)


def toaster(b: ObjectBuilder) -> None:
    """Two slots between three walls, a lever in front."""
    x, y, z = b.size
    body = b.pick(
        (materials.metal("chrome", b.rng), materials.plain("red"), materials.plain("cream"), materials.plain("mint"))
    )
    black = materials.plain("black")
    slot = 0.03
    wall = (y - 2 * slot) / 3
    for k in (-1, 0, 1):
        b.add(soft_box(x - 0.04, wall, z - 0.01, 0.01).at(-0.01, k * (wall + slot), 0.01), body)
    for s in (-1, 1):
        b.add(block((0.02, y, z - 0.015), (s * (x / 2 - 0.025) - 0.01 + 0.005, 0, z / 2 + 0.005)), body)
    b.add(block((x - 0.05, y - 0.02, 0.03), (-0.01, 0, 0.015)), black)
    b.add(soft_box(0.03, 0.035, 0.014).at(x / 2 - 0.015, 0, 0.55 * z), black)
    b.point("toggle_button", (x / 2, 0, 0.55 * z))


CATEGORIES = [
    Entry("stove", stove, (0.66, 0.70, 0.91), 48.0, 8, fixed=True, rest="upright", vary=0.06),
    Entry("burner", burner, (0.52, 0.60, 0.055), 9.0, 5, rest="upright", fixed=True, vary=0.06),
    Entry("oven", oven, (0.58, 0.60, 0.60), 30.0, 6, fixed=True, rest="upright", vary=0.05),
    Entry("microwave", microwave, (0.38, 0.50, 0.29), 13.0, 8, fixed=True, rest="upright", vary=0.08),
    Entry("grill", grill, (0.50, 1.10, 1.05), 35.0, 4, fixed=True, rest="upright", vary=0.06),
    Entry("toaster", toaster, (0.30, 0.19, 0.19), 1.6, 4, rest="upright", vary=0.06),
]
