"""What stands in free corners by room type. Each function adds to a `Builder` at a place on the floor."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ig2mj.looks import mesh
from ig2mj.looks.mesh import Builder, Colour
from ig2mj.looks.ornaments import BLACK, LINEN, STEEL, WOODS, OrnamentPlace, Stock, pick
from ig2mj.looks.shelves import BOOKS

WICKER: tuple[Colour, ...] = ((0.72, 0.57, 0.38), (0.60, 0.45, 0.30), (0.84, 0.76, 0.62))
BRIGHT: tuple[Colour, ...] = ((0.86, 0.30, 0.27), (0.28, 0.52, 0.75), (0.96, 0.78, 0.30), (0.42, 0.66, 0.42))


def sacks(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """Flour, and potatoes on top of a crate's worth of onions."""
    for x, y, h in ((-0.06, -0.03, 0.46), (0.08, 0.06, 0.34)):
        profile = [(0.11, 0), (0.135, 0.25 * h), (0.125, 0.7 * h), (0.07, 0.88 * h), (0.09, h)]
        build.paint(
            pick(stock.rng, (LINEN, WICKER[0], (0.80, 0.70, 0.55))), *place.at(x, y, 0).put(mesh.lathe(profile))
        )
        build.paint((0.45, 0.32, 0.22), *place.at(x, y, 0).put(mesh.lathe([(0.074, 0.86 * h), (0.074, 0.9 * h)])))


def cartons(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A stack, taped."""
    z = 0.0
    for size in (0.32, 0.28, 0.22):
        h, turn = float(stock.rng.uniform(0.6, 0.8)) * size, float(stock.rng.uniform(-0.2, 0.2))
        at = OrnamentPlace(place.at(0, 0, z).pos, place.turn + turn)
        build.paint((0.74, 0.58, 0.40), *at.put(mesh.box((0, 0, h / 2), (size, size, h), "-z")))
        build.paint((0.87, 0.77, 0.60), *at.put(mesh.box((0, 0, h / 2), (0.05, size + 0.002, h + 0.002), "-z")))
        z += h


def tyres(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """Four, one on the other."""
    for k in range(4):
        rings = [(0.12, 0.01), (0.17, 0.0), (0.2, 0.03), (0.2, 0.14), (0.17, 0.17), (0.12, 0.16), (0.12, 0.01)]
        build.paint((0.13, 0.13, 0.135), *place.at(0, 0, 0.17 * k).put(mesh.lathe(rings, sides=18)))
        build.paint(
            (0.20, 0.20, 0.21), *place.at(0, 0, 0.17 * k).put(mesh.lathe([(0.201, 0.06), (0.201, 0.11)], sides=18))
        )


def toys(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A chest of toys with a ball before it."""
    build.paint(pick(stock.rng, BRIGHT), *place.put(mesh.box((0, 0, 0.13), (0.34, 0.26, 0.26), "+z -z")))
    build.paint((0.95, 0.93, 0.88), *place.put(mesh.box((0, 0, 0.255), (0.36, 0.28, 0.03), "+z")))
    for k in range(9):
        x, y = float(stock.rng.uniform(-0.13, 0.13)), float(stock.rng.uniform(-0.09, 0.09))
        part = mesh.ball(0.055, (x, y, 0.26), 10) if k % 2 else mesh.box((x, y, 0.27), (0.07, 0.07, 0.07))
        build.paint(BRIGHT[k % 4], *place.put(part))


def ball(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A large one for gymnastics."""
    build.paint(pick(stock.rng, BRIGHT), *place.put(mesh.ball(0.2, (0, 0, 0.2), 20)))


def dumbbells(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A rack of them, and a rolled mat."""
    for k in range(3):
        z, y = 0.1 + 0.17 * k, -0.04 + 0.02 * k
        build.paint(BLACK, *place.put(mesh.box((0, y, z - 0.06), (0.36, 0.1, 0.02))))
        build.paint(STEEL, *place.put(mesh.rod((-0.1, y, z), (0.1, y, z), 0.013)))
        for x in (-0.1, 0.1):
            build.paint(pick(stock.rng, (BLACK, (0.30, 0.32, 0.36))), *place.put(mesh.ball(0.055, (x, y, z), 12)))
    for x in (-0.17, 0.17):
        build.paint(BLACK, *place.put(mesh.box((x, -0.02, 0.25), (0.03, 0.06, 0.5), "-z")))


def laundry(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A basket with washing."""
    wall = [(0.14, 0), (0.18, 0.42), (0.165, 0.42), (0.15, 0.36)]
    build.paint(pick(stock.rng, WICKER), *place.put(mesh.lathe(wall, sides=16)))
    for k in range(4):
        x, y = 0.07 * math.cos(1.6 * k), 0.07 * math.sin(1.6 * k)
        cloth = pick(stock.rng, (LINEN, (0.55, 0.70, 0.76), (0.86, 0.62, 0.58), (0.62, 0.70, 0.56)))
        build.paint(cloth, *place.put(mesh.ball((0.1, 0.09, 0.06), (x, y, 0.4 + 0.02 * k), 10)))


def paper_basket(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """With crumpled paper."""
    build.paint(BLACK, *place.put(mesh.lathe([(0.1, 0), (0.13, 0.3), (0.125, 0.3), (0.12, 0.25)], sides=14)))
    for k in range(4):
        build.paint(
            (0.95, 0.94, 0.91), *place.put(mesh.ball(0.05, (0.05 * math.cos(2 * k), 0.05 * math.sin(2 * k), 0.26), 6))
        )


def globe(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """On a stand of wood."""
    wood = pick(stock.rng, WOODS[:2])
    for k in range(3):
        x, y = 0.14 * math.cos(2.1 * k), 0.14 * math.sin(2.1 * k)
        build.paint(wood, *place.put(mesh.rod((x, y, 0), (0.2 * x, 0.2 * y, 0.6), 0.014)))
    build.paint(
        wood, *place.put(mesh.lathe([(0.2, 0.72), (0.2, 0.745), (0.17, 0.745), (0.17, 0.72), (0.2, 0.72)], sides=20))
    )
    build.paint((0.35, 0.55, 0.70), *place.put(mesh.ball(0.16, (0, 0, 0.76), 18)))
    for k in range(7):
        turn, up = 2.4 * k, math.sin(1.9 * k)
        out = np.array([math.cos(turn) * math.cos(up), math.sin(turn) * math.cos(up), math.sin(up)])
        build.paint((0.78, 0.70, 0.46), *place.put(mesh.ball(0.055, 0.115 * out + np.array([0, 0, 0.76]), 8)))


def piled_books(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A pile on the floor."""
    z = 0.0
    for _ in range(11):
        h, turn = float(stock.rng.uniform(0.025, 0.05)), float(stock.rng.uniform(-0.35, 0.35))
        at = OrnamentPlace(place.at(0, 0, z).pos, place.turn + turn)
        build.paint(pick(stock.rng, BOOKS), *at.put(mesh.box((0, 0, h / 2), (0.25, 0.18, h - 0.002))))
        build.paint((0.93, 0.90, 0.82), *at.put(mesh.box((0.003, 0, h / 2), (0.25, 0.172, h - 0.008), "-x -z +z")))
        z += h


def umbrellas(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """In a stand."""
    build.paint(
        pick(stock.rng, (BLACK, WICKER[1], (0.30, 0.40, 0.44))),
        *place.put(mesh.lathe([(0.1, 0), (0.11, 0.5), (0.1, 0.5)], sides=14)),
    )
    for k in range(3):
        x, y = 0.05 * math.cos(2.1 * k), 0.05 * math.sin(2.1 * k)
        build.paint(pick(stock.rng, BRIGHT), *place.put(mesh.rod((x, y, 0.1), (1.6 * x, 1.6 * y, 0.74), 0.022)))
        build.paint(WOODS[1], *place.put(mesh.rod((1.6 * x, 1.6 * y, 0.74), (1.7 * x, 1.7 * y, 0.86), 0.012)))


def cushions(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """For the floor, piled."""
    for k in range(3):
        colour = pick(stock.rng, ((0.80, 0.52, 0.36), (0.36, 0.50, 0.56), (0.86, 0.76, 0.52), (0.60, 0.34, 0.36)))
        build.paint(colour, *place.put(mesh.ball((0.2, 0.2, 0.075), (0.01 * k, 0, 0.07 + 0.12 * k), 16)))


def speaker(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A tall loudspeaker."""
    build.paint((0.20, 0.17, 0.15), *place.put(mesh.box((0, 0, 0.46), (0.22, 0.24, 0.92), "-z")))
    round_ = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    for z, r in ((0.24, 0.085), (0.5, 0.085), (0.74, 0.05)):
        cone = mesh.lathe([(r, 0.0), (r * 0.8, 0.008), (0, 0.002)], sides=16).turned(round_.T)
        for side in (0.122,):
            build.paint((0.08, 0.08, 0.085), *place.at(0, side, z).put(cone))


Thing = Callable[[Builder, OrnamentPlace, Stock], None]
IN_CORNERS: dict[str, tuple[Thing, ...]] = {
    "pantry_room": (sacks, cartons),
    "storage_room": (cartons, cartons),
    "garage": (tyres, cartons),
    "playroom": (toys, cushions),
    "childs_room": (toys,),
    "exercise_room": (dumbbells, ball),
    "utility_room": (laundry,),
    "bathroom": (laundry,),
    "closet": (cartons, laundry),
    "home_office": (paper_basket,),
    "library": (globe, piled_books),
    "corridor": (umbrellas,),
    "lobby": (umbrellas,),
    "television_room": (speaker, cushions),
}
"""Room type -> what stands in its free corners; plants take those that are left."""
