"""Packed food and drink: cartons with a gable, folding boxes, tins."""

from __future__ import annotations

from ..shapes import materials, textures
from ..shapes.bricks import box, cylinder, decal, hull, lathe, soft_box
from ..shapes.materials import Material
from .entry import Entry
from .model import ObjectBuilder


def printed(b: ObjectBuilder, ground: str | tuple, accent: str | tuple, shape: tuple[int, int] = (64, 96)) -> Material:
    rgb, other = materials.tint(ground, b.rng), materials.tint(accent, b.rng)
    return materials.picture("label", textures.label(rgb, other, b.rng, shape))


def gable_carton(b: ObjectBuilder, *, looks: tuple = (("white", "blue"), ("white", "green"), ("sky", "red"))) -> None:
    """A milk or juice carton: a box whose roof folds to a ridge."""
    x, y, z = b.size
    ground, accent = b.pick(looks)
    card = materials.plain(ground, "paper")
    body, ridge = 0.78 * z, 0.09 * z
    b.add(box(x, y, body), card)
    half_x, half_y = x / 2, y / 2
    roof = [(sx * half_x, sy * half_y, body) for sx in (-1, 1) for sy in (-1, 1)]
    roof += [(0, sy * half_y, z - ridge) for sy in (-1, 1)]
    b.add(hull(roof), card)
    b.add(box(0.004, y, ridge).at(z=z - ridge), card)
    if b.rng.random() < 0.6:
        b.add(
            cylinder(0.014, 0.012, 12).visual_only().turned("y", 45).at(x / 4, 0, (body + z - ridge) / 2 - 0.004),
            materials.plain(accent),
        )
    front = printed(b, ground, accent)
    for side, at in (("x", half_x + 0.0004), ("-x", -half_x - 0.0004)):
        b.add(decal(y * 0.96, body * 0.94, side).at(at, 0, body / 2), front)


def carton_box(b: ObjectBuilder, *, looks: tuple = (("red", "yellow"),)) -> None:
    """An upright folding box with a printed front and back (cereal, crackers, pasta)."""
    x, y, z = b.size
    ground, accent = b.pick(looks)
    b.add(box(x, y, z), materials.plain(ground, "paper"))
    front = printed(b, ground, accent, (64, max(32, min(96, int(64 * z / y)))))
    for side, s in (("x", 1), ("-x", -1)):
        b.add(decal(y * 0.97, z * 0.97, side).at(s * (x / 2 + 0.0004), 0, z / 2), front)


def tin(b: ObjectBuilder, *, looks: tuple = (("red", "cream"),)) -> None:
    """A food tin: a can with rims and a printed band."""
    x, _, z = b.size
    r = x / 2
    ground, accent = b.pick(looks)
    b.add(
        lathe([(r, 0), (r, 0.02 * z), (0.965 * r, 0.03 * z), (0.965 * r, 0.97 * z), (r, 0.98 * z), (r, z)]),
        materials.metal("silver"),
    )
    b.add(cylinder(0.985 * r, 0.88 * z).visual_only().at(z=0.06 * z), materials.plain(ground, "paper"))
    b.add(cylinder(0.99 * r, 0.3 * z).visual_only().at(z=0.35 * z), materials.plain(accent, "paper"))


def stick(b: ObjectBuilder, *, looks: tuple = (("yellow", "white"),)) -> None:
    """A wrapped block lying flat: butter, cheese."""
    x, y, z = b.size
    ground, accent = b.pick(looks)
    b.add(soft_box(x, y, z, 0.12 * z), materials.plain(ground, "paper"))
    b.add(decal(y * 0.9, x * 0.85, "z").at(0, 0, z + 0.0004), printed(b, ground, accent, (96, 48)))


CATEGORIES = [
    Entry("milk", gable_carton, (0.072, 0.072, 0.240), 1.05, 4, rest="standing"),
    Entry("juice", gable_carton, (0.072, 0.072, 0.230), 1.06, 4,
          rest="standing", options={"looks": (("orange", "yellow"), ("red", "green"), ("lime", "yellow"))}),
    Entry("cereal", carton_box, (0.065, 0.190, 0.290), 0.42, 4,
          rest="standing",
          options={"looks": (("yellow", "red"), ("blue", "orange"), ("red", "yellow"), ("green", "cream"))}),
    Entry("cracker_box", carton_box, (0.062, 0.160, 0.210), 0.40, 3,
          rest="standing", options={"looks": (("red", "yellow"), ("navy", "orange"), ("orange", "brown"))}),
    Entry("canned_food", tin, (0.075, 0.075, 0.110), 0.42, 4,
          rest="standing",
          options={"looks": (("red", "cream"), ("green", "yellow"), ("blue", "white"), ("orange", "red"))}),
    Entry("oatmeal", carton_box, (0.085, 0.140, 0.240), 0.55, 3,
          rest="standing", options={"looks": (("tan", "red"), ("blue", "cream"))}),
    Entry("pasta", carton_box, (0.050, 0.110, 0.200), 0.50, 3,
          rest="standing", options={"looks": (("blue", "yellow"), ("green", "cream"), ("red", "cream"))}),
    Entry("butter", stick, (0.065, 0.100, 0.038), 0.25, 3,
          options={"looks": (("yellow", "blue"), ("silver", "green"), ("cream", "red"))}),
]  # fmt: skip
