"""Shelves on walls, and what stands on them by room type.

Things are functions that add themselves at a place and return the width in m that they take; 0 where they do not fit.
"""

from __future__ import annotations

from collections.abc import Callable

from ig2mj.looks import mesh
from ig2mj.looks.mesh import Builder, Colour
from ig2mj.looks.ornaments import BLACK, POTS, STEEL, WOODS, OrnamentPlace, Stock, pick, picture, plant

BOOKS: tuple[Colour, ...] = (
    (0.70, 0.22, 0.20), (0.20, 0.36, 0.55), (0.88, 0.72, 0.35), (0.25, 0.45, 0.35), (0.85, 0.82, 0.74),
    (0.40, 0.25, 0.42), (0.20, 0.22, 0.26), (0.82, 0.47, 0.28), (0.55, 0.68, 0.72),
)  # fmt: skip


def wall_shelf(
    build: Builder, place: OrnamentPlace, width: float | int, kind: str, stock: Stock, depth: float | int = 0.19
) -> None:
    """A board on the wall at the place, with what a room of that kind has on it."""
    rng = stock.rng
    build.paint(
        pick(rng, (*WOODS, (0.95, 0.94, 0.92))), *place.put(mesh.box((0, depth / 2, -0.012), (width, depth, 0.024)))
    )
    for x in (-0.38 * width, 0.38 * width):
        build.paint(BLACK, *place.put(mesh.box((x, depth * 0.35, -0.045), (0.015, depth * 0.6, 0.045))))
    x, end = -width / 2 + 0.03, width / 2 - 0.03
    things = ON_SHELVES.get(kind, ON_SHELVES["living_room"])
    while x < end - 0.05:
        used = pick(rng, things)(build, place.at(x, 0.03, 0.0), end - x, stock)
        if used <= 0:
            break
        x += used + float(rng.uniform(0.015, 0.05))


def books(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    """A row of books; returns the width that it takes."""
    rng, x = stock.rng, 0.0
    for _ in range(int(rng.integers(4, 10))):
        thick, tall, deep = (
            float(rng.uniform(0.016, 0.042)),
            float(rng.uniform(0.15, 0.24)),
            float(rng.uniform(0.11, 0.15)),
        )
        if x + thick > room:
            break
        colour = pick(rng, BOOKS)
        build.paint(
            colour, *place.put(mesh.box((x + thick / 2, deep / 2, tall / 2), (thick - 0.002, deep, tall), "-z"))
        )
        band = mesh.box((x + thick / 2, deep + 0.0006, tall * 0.78), (thick - 0.004, 0.001, 0.016), "-y +z -z")
        build.paint((0.90, 0.84, 0.66), *place.put(band))
        x += thick
    return x


def small_plant(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.16:
        return 0.0
    plant(build, place.at(0.08, 0.06, 0.0), 0.24, stock, trailing=bool(stock.rng.integers(2)))
    return 0.16


def vase(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.12:
        return 0.0
    h = float(stock.rng.uniform(0.14, 0.22))
    profile = [(0.03, 0), (0.055, 0.3 * h), (0.05, 0.55 * h), (0.022, 0.82 * h), (0.03, h), (0.024, h - 0.004)]
    build.paint(pick(stock.rng, POTS), *place.at(0.06, 0.06, 0).put(mesh.lathe(profile, sides=14)))
    return 0.12


def standing_frame(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.2:
        return 0.0
    picture(build, place.at(0.09, 0.01, 0.105), 0.15, 0.19, stock)
    return 0.19


def jar(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.11:
        return 0.0
    h = float(stock.rng.uniform(0.10, 0.17))
    inside = pick(
        stock.rng, ((0.82, 0.66, 0.40), (0.62, 0.36, 0.20), (0.93, 0.89, 0.78), (0.55, 0.60, 0.34), (0.75, 0.28, 0.20))
    )
    at = place.at(0.055, 0.06, 0)
    build.paint(inside, *at.put(mesh.lathe([(0.045, 0), (0.047, 0.02), (0.047, h - 0.02), (0.036, h)], sides=14)))
    build.paint(
        pick(stock.rng, (STEEL, WOODS[0], (0.75, 0.30, 0.25))),
        *at.put(mesh.lathe([(0.039, h), (0.039, h + 0.022), (0, h + 0.022)], sides=14)),
    )
    return 0.11


def bottle(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.08:
        return 0.0
    h = float(stock.rng.uniform(0.15, 0.21))
    colour = pick(
        stock.rng, ((0.86, 0.55, 0.62), (0.42, 0.65, 0.72), (0.95, 0.94, 0.90), (0.58, 0.72, 0.52), (0.90, 0.76, 0.45))
    )
    at = place.at(0.04, 0.055, 0)
    build.paint(
        colour,
        *at.put(
            mesh.lathe([(0.03, 0), (0.034, 0.01), (0.034, 0.62 * h), (0.014, 0.76 * h), (0.014, 0.84 * h)], sides=12)
        ),
    )
    build.paint((0.97, 0.97, 0.96), *at.put(mesh.lathe([(0.018, 0.84 * h), (0.018, h), (0, h)], sides=12)))
    return 0.08


def folded_towels(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.3:
        return 0.0
    for k in range(3):
        colour = pick(stock.rng, ((0.94, 0.93, 0.90), (0.55, 0.72, 0.75), (0.88, 0.74, 0.66), (0.72, 0.78, 0.70)))
        build.paint(colour, *place.put(mesh.box((0.14, 0.08, 0.025 + 0.05 * k), (0.26, 0.15, 0.046))))
    return 0.28


def toy(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    """A teddy bear, or blocks."""
    rng = stock.rng
    if room < 0.18:
        return 0.0
    if rng.integers(2):
        fur, at = pick(rng, ((0.66, 0.46, 0.28), (0.80, 0.64, 0.46), (0.93, 0.90, 0.85))), place.at(0.08, 0.06, 0)
        build.paint(fur, *at.put(mesh.ball((0.06, 0.05, 0.07), (0, 0, 0.07)), mesh.ball(0.048, (0, 0.01, 0.165))))
        for s in (-1, 1):
            build.paint(
                fur,
                *at.put(
                    mesh.ball(0.02, (0.036 * s, 0, 0.205)),
                    mesh.ball((0.022, 0.04, 0.022), (0.045 * s, 0.045, 0.025)),
                    mesh.ball((0.018, 0.02, 0.04), (0.066 * s, 0.01, 0.095)),
                ),
            )
            build.paint(BLACK, *at.put(mesh.ball(0.006, (0.016 * s, 0.054, 0.175))))
        build.paint((0.93, 0.86, 0.74), *at.put(mesh.ball((0.02, 0.014, 0.016), (0, 0.052, 0.155))))
        return 0.16
    for k, (x, z) in enumerate(((0.03, 0.03), (0.095, 0.03), (0.06, 0.09))):
        build.paint(
            ((0.86, 0.30, 0.27), (0.28, 0.52, 0.75), (0.96, 0.78, 0.30))[k],
            *place.put(mesh.box((x, 0.06, z), (0.058, 0.058, 0.058))),
        )
    return 0.14


def box_file(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.1:
        return 0.0
    colour = pick(stock.rng, ((0.30, 0.42, 0.55), (0.85, 0.82, 0.76), (0.72, 0.35, 0.30), (0.35, 0.36, 0.38)))
    build.paint(colour, *place.put(mesh.box((0.04, 0.08, 0.14), (0.075, 0.15, 0.28))))
    build.paint((0.97, 0.96, 0.93), *place.put(mesh.box((0.04, 0.1555, 0.17), (0.045, 0.001, 0.08), "-y")))
    return 0.085


def carton(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.27:
        return 0.0
    h = float(stock.rng.uniform(0.14, 0.22))
    build.paint((0.74, 0.58, 0.40), *place.put(mesh.box((0.13, 0.08, h / 2), (0.24, 0.15, h))))
    build.paint((0.86, 0.76, 0.58), *place.put(mesh.box((0.13, 0.0802, h / 2), (0.05, 0.151, h + 0.001))))
    return 0.26


def paint_can(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.17:
        return 0.0
    at, colour = place.at(0.08, 0.08, 0), pick(stock.rng, ((0.30, 0.50, 0.62), (0.80, 0.45, 0.25), (0.88, 0.80, 0.52)))
    build.paint(
        STEEL,
        *at.put(
            mesh.lathe([(0.07, 0), (0.07, 0.03)], sides=16),
            mesh.lathe([(0.07, 0.12), (0.07, 0.15), (0, 0.15)], sides=16),
        ),
    )
    build.paint(colour, *at.put(mesh.lathe([(0.0695, 0.03), (0.0695, 0.12)], sides=16)))
    return 0.17


def basket(build: Builder, place: OrnamentPlace, room: float | int, stock: Stock) -> float:
    if room < 0.27:
        return 0.0
    build.paint((0.72, 0.58, 0.40), *place.put(mesh.box((0.13, 0.08, 0.07), (0.25, 0.15, 0.14), "+z")))
    build.paint((0.40, 0.30, 0.20), *place.put(mesh.box((0.13, 0.08, 0.125), (0.23, 0.13, 0.002))))
    return 0.27


Item = Callable[[Builder, OrnamentPlace, float | int, Stock], float | int]
ON_SHELVES: dict[str, tuple[Item, ...]] = {
    "living_room": (books, books, small_plant, vase, standing_frame),
    "television_room": (books, vase, standing_frame),
    "bedroom": (books, small_plant, standing_frame),
    "library": (books, books, books, vase),
    "home_office": (box_file, box_file, books, small_plant),
    "childs_room": (toy, toy, books),
    "playroom": (toy, toy, books),
    "dining_room": (vase, jar, small_plant),
    "kitchen": (jar, jar, small_plant, bottle),
    "pantry_room": (jar, jar, basket, carton),
    "bathroom": (bottle, bottle, folded_towels, small_plant),
    "utility_room": (bottle, bottle, basket, folded_towels),
    "garage": (paint_can, carton, paint_can),
    "storage_room": (carton, carton, basket, paint_can),
    "closet": (carton, basket, folded_towels),
    "exercise_room": (folded_towels, bottle),
}
