"""Small things of the decoration as meshes: pictures, plants, lamps, clothes, curtains.

Each function adds to a `Builder` at a place: (pos, turn), with x along the wall, y away from it and z up.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ig2mj.looks import mesh
from ig2mj.looks.drawings import ARTS, GREENS
from ig2mj.looks.materials import Material, fabric
from ig2mj.looks.mesh import Builder, Colour, Triangles

LEAVES: tuple[Colour, ...] = GREENS
POTS: tuple[Colour, ...] = ((0.78, 0.45, 0.32), (0.92, 0.91, 0.88), (0.35, 0.42, 0.46), (0.82, 0.73, 0.58))
CLOTHES: tuple[Colour, ...] = (
    (0.28, 0.34, 0.45), (0.62, 0.30, 0.28), (0.80, 0.74, 0.62), (0.34, 0.44, 0.36), (0.85, 0.68, 0.40),
)  # fmt: skip
WOODS: tuple[Colour, ...] = ((0.66, 0.48, 0.31), (0.45, 0.31, 0.21), (0.80, 0.66, 0.47))
STEEL, BLACK, LINEN = (0.74, 0.75, 0.76), (0.16, 0.16, 0.17), (0.93, 0.89, 0.80)


@dataclasses.dataclass(frozen=True)
class OrnamentPlace:
    """Where, and how turned about the vertical (rad)."""

    pos: np.ndarray
    turn: float | int = 0.0

    def put(self, *parts: Triangles) -> list[Triangles]:
        return [p.moved(self.pos, self.turn) for p in parts]

    def at(self, x: float | int, y: float | int, z: float | int) -> OrnamentPlace:
        """A place in the frame of this one."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        return OrnamentPlace(self.pos + np.array([c * x - s * y, s * x + c * y, z]), self.turn)


@dataclasses.dataclass(frozen=True)
class Stock:
    """Materials that things of one home share. glow: of lamps."""

    art: Material
    glow: Material
    rng: np.random.Generator


def pick(rng: np.random.Generator, choices):
    """One of several."""
    return choices[int(rng.integers(len(choices)))]


# ------------------------------------------------------------------------------------------------ on walls


def picture(build: Builder, place: OrnamentPlace, width: float | int, height: float | int, stock: Stock) -> None:
    """A framed picture, its middle at the place."""
    rng, frame = stock.rng, 0.025
    mount = 0.045 if min(width, height) > 0.3 else 0.02
    colour = pick(rng, (*WOODS, BLACK, (0.93, 0.92, 0.90)))
    for x, z, w, h in (
        (0, height / 2, width, frame),
        (0, -height / 2, width, frame),
        (width / 2, 0, frame, height + frame),
        (-width / 2, 0, frame, height + frame),
    ):
        build.paint(colour, *place.put(mesh.box((x, 0.014, z), (w, 0.024, h), "-y")))
    build.paint((0.96, 0.95, 0.92), *place.put(_facing(width, height, 0.008)))
    column, row = int(rng.integers(ARTS[0])), int(rng.integers(ARTS[1]))
    u, v, e = column / ARTS[0], row / ARTS[1], 0.01
    uv = [
        (u + e, v + e),
        (u + 1 / ARTS[0] - e, v + e),
        (u + 1 / ARTS[0] - e, v + 1 / ARTS[1] - e),
        (u + e, v + 1 / ARTS[1] - e),
    ]
    build.add(stock.art, *place.put(_facing(width - 2 * mount, height - 2 * mount, 0.011, uv)))


def _facing(width: float | int, height: float | int, out: float | int, uv=None) -> Triangles:
    """A rectangle that looks away from the wall."""
    w, h = width / 2, height / 2
    return mesh.quad([(w, out, -h), (-w, out, -h), (-w, out, h), (w, out, h)], uv)


def coat_hooks(build: Builder, place: OrnamentPlace, width: float | int, stock: Stock) -> None:
    """A board with hooks, coats and a bag, its middle at the place."""
    build.paint(pick(stock.rng, WOODS), *place.put(mesh.box((0, 0.012, 0), (width, 0.024, 0.09), "-y")))
    count = max(2, int(width / 0.2))
    for k in range(count):
        x = -width / 2 + (k + 0.5) * width / count
        build.paint(
            BLACK,
            *place.put(
                mesh.box((x, 0.045, 0), (0.014, 0.05, 0.014)), mesh.box((x, 0.068, 0.015), (0.014, 0.012, 0.04))
            ),
        )
        if k != count // 2:
            coat(build, place.at(x, 0.07, -0.01), stock)
        else:
            scarf = pick(stock.rng, CLOTHES)
            build.paint(
                scarf,
                *place.put(
                    mesh.box((x - 0.03, 0.06, -0.3), (0.07, 0.025, 0.56)),
                    mesh.box((x + 0.045, 0.06, -0.24), (0.07, 0.025, 0.44)),
                ),
            )


def coat(build: Builder, place: OrnamentPlace, stock: Stock, length: float | None = None) -> None:
    """Hangs down from the place."""
    colour = pick(stock.rng, CLOTHES)
    h = length or float(stock.rng.uniform(0.62, 0.85))
    rings = [(0.09, -h), (0.1, -h * 0.55), (0.085, -0.22), (0.075, -0.1), (0.03, -0.03), (0, 0)]
    body = mesh.lathe(rings, sides=12)
    flat = Triangles(body.vertices * np.array([1.05, 0.6, 1]), body.normals, body.uv, body.faces)
    build.paint(colour, *place.put(flat))
    dark = (0.8 * colour[0], 0.8 * colour[1], 0.8 * colour[2])
    for s in (-1, 1):
        build.paint(dark, *place.put(mesh.rod((0.07 * s, 0, -0.09), (0.105 * s, 0.01, -0.52 * h - 0.1), 0.03)))
    build.paint(dark, *place.put(mesh.box((0, 0.061, -h * 0.5), (0.006, 0.004, h * 0.8))))


def shoes(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A pair, toes away from the wall."""
    colour = pick(stock.rng, ((0.30, 0.22, 0.16), (0.85, 0.84, 0.82), (0.20, 0.28, 0.42), (0.62, 0.22, 0.22), BLACK))
    for x in (-0.055, 0.055):
        build.paint((0.90, 0.89, 0.86), *place.put(mesh.box((x, 0.13, 0.01), (0.08, 0.25, 0.02), "-z")))
        build.paint(
            colour,
            *place.put(
                mesh.ball((0.042, 0.09, 0.05), (x, 0.17, 0.02)), mesh.ball((0.04, 0.06, 0.085), (x, 0.06, 0.02))
            ),
        )
        build.paint((0.08, 0.08, 0.08), *place.put(mesh.ball((0.026, 0.035, 0.006), (x, 0.055, 0.1))))


def towel_rail(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """Its rail at the place, with a towel."""
    build.paint(STEEL, *place.put(mesh.rod((-0.3, 0.06, 0), (0.3, 0.06, 0), 0.009)))
    for x in (-0.3, 0.3):
        build.paint(STEEL, *place.put(mesh.rod((x, 0, 0), (x, 0.065, 0), 0.009)))
    for x, w in ((-0.12, 0.3), (0.18, 0.2)):
        colour = pick(stock.rng, ((0.94, 0.93, 0.90), (0.50, 0.70, 0.74), (0.90, 0.72, 0.62), (0.70, 0.78, 0.66)))
        build.paint(
            colour,
            *place.put(
                mesh.box((x, 0.075, -0.22), (w, 0.014, 0.45)),
                mesh.box((x, 0.045, -0.17), (w, 0.014, 0.35)),
                mesh.box((x, 0.06, 0.011), (w, 0.04, 0.014)),
            ),
        )
        dark = (0.85 * colour[0], 0.85 * colour[1], 0.85 * colour[2])
        build.paint(dark, *place.put(mesh.box((x, 0.0755, -0.38), (w, 0.015, 0.03))))


def utensil_rail(build: Builder, place: OrnamentPlace, width: float | int, stock: Stock) -> None:
    """A rail with ladles and pans."""
    build.paint(STEEL, *place.put(mesh.rod((-width / 2, 0.035, 0), (width / 2, 0.035, 0), 0.007)))
    x, k = -width / 2 + 0.06, 0
    while x < width / 2 - 0.08:
        if k % 3 == 2:
            pan = mesh.lathe([(0, -0.01), (0.075, -0.01), (0.08, 0.02)], sides=16)
            matrix = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
            build.paint(
                BLACK,
                *place.at(x, 0.03, -0.22).put(pan.turned(matrix)),
                *place.put(mesh.box((x, 0.035, -0.08), (0.018, 0.01, 0.16))),
            )
            x += 0.2
        else:
            build.paint(
                pick(stock.rng, (STEEL, WOODS[0])),
                *place.put(mesh.box((x, 0.035, -0.12), (0.012, 0.008, 0.24))),
                *place.at(x, 0.035, -0.255).put(mesh.ball((0.032, 0.012, 0.042))),
            )
            x += 0.1
        k += 1


def clothes_rail(
    build: Builder, place: OrnamentPlace, width: float | int, stock: Stock, lengths: tuple[float, float] = (0.55, 0.9)
) -> None:
    """A rail on the wall with clothes on it, which hang down by `lengths` m, from and to."""
    build.paint(STEEL, *place.put(mesh.rod((-width / 2, 0.16, 0), (width / 2, 0.16, 0), 0.012)))
    for x in (-width / 2 + 0.03, width / 2 - 0.03):
        build.paint(STEEL, *place.put(mesh.rod((x, 0, 0), (x, 0.16, 0), 0.01)))
    x = -width / 2 + 0.12
    while x < width / 2 - 0.1:
        spot = OrnamentPlace(place.at(x, 0.16, -0.02).pos, place.turn + math.pi / 2)
        coat(build, spot, stock, float(stock.rng.uniform(*lengths)))
        x += float(stock.rng.uniform(0.1, 0.16))


def bunting(build: Builder, place: OrnamentPlace, width: float | int, stock: Stock) -> None:
    """Flags on a string along the wall, hanging from both ends of `width`."""
    count = max(4, int(width / 0.16))
    for k in range(count):
        x0, x1 = -width / 2 + k * width / count, -width / 2 + (k + 0.9) * width / count
        z0, z1 = (0.16 * ((2 * x / width) ** 2 - 1) for x in (x0, x1))
        colour = ((0.90, 0.40, 0.36), (0.98, 0.80, 0.36), (0.40, 0.68, 0.78), (0.55, 0.75, 0.50))[k % 4]
        m = (x0 + x1) / 2
        build.paint(
            colour,
            *place.put(
                mesh.quad(
                    [(x1, 0.02, z1), (x0, 0.02, z0), (m, 0.02, (z0 + z1) / 2 - 0.14), (m, 0.02, (z0 + z1) / 2 - 0.14)],
                    None,
                )
            ),
        )


def wall_bars(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A ladder along the wall for gymnastics, its foot at the place."""
    for x in (-0.42, 0.42):
        build.paint(WOODS[2], *place.put(mesh.box((x, 0.05, 1.05), (0.04, 0.1, 2.1), "-y")))
    for k in range(11):
        build.paint(WOODS[0], *place.put(mesh.rod((-0.42, 0.08, 0.2 + 0.18 * k), (0.42, 0.08, 0.2 + 0.18 * k), 0.016)))


def garden_tools(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A rake, a shovel and a broom on hooks."""
    build.paint(WOODS[1], *place.put(mesh.box((0, 0.012, 0.1), (0.9, 0.024, 0.07), "-y")))
    for k, x in enumerate((-0.3, 0.0, 0.3)):
        build.paint(WOODS[0], *place.put(mesh.rod((x, 0.05, 0.15), (x, 0.05, -1.05), 0.013)))
        head = ((0.24, 0.02, 0.05), (0.17, 0.02, 0.24), (0.3, 0.05, 0.14))[k]
        colour = (STEEL, (0.55, 0.57, 0.58), (0.85, 0.66, 0.30))[k]
        build.paint(colour, *place.put(mesh.box((x, 0.05, -1.05), head)))


def sconce(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A lamp on the wall."""
    build.paint(
        (0.72, 0.60, 0.38),
        *place.put(mesh.box((0, 0.01, 0), (0.06, 0.02, 0.12), "-y"), mesh.rod((0, 0.02, 0), (0, 0.1, 0.02), 0.008)),
    )
    build.add(
        stock.glow,
        *place.at(0, 0.1, 0.02).put(
            mesh.lathe([(0.075, 0), (0.05, 0.13)], sides=14), mesh.lathe([(0, 0.005), (0.07, 0.005)], sides=14)
        ),
    )


def pinned_papers(build: Builder, place: OrnamentPlace, stock: Stock) -> None:
    """A cork board with notes."""
    build.paint((0.76, 0.58, 0.38), *place.put(mesh.box((0, 0.01, 0), (0.8, 0.02, 0.52), "-y")))
    for k in range(6):
        x, z = (
            -0.28 + 0.28 * (k % 3) + float(stock.rng.uniform(-0.05, 0.05)),
            (-0.12 if k < 3 else 0.12) + float(stock.rng.uniform(-0.03, 0.03)),
        )
        build.paint(
            pick(stock.rng, ((0.98, 0.97, 0.92), (0.98, 0.90, 0.55), (0.72, 0.86, 0.92), (0.97, 0.78, 0.76))),
            *place.at(x, 0, z).put(_facing(0.15, 0.17, 0.022)),
        )
        build.paint((0.85, 0.25, 0.22), *place.put(mesh.ball(0.008, (x, 0.024, z + 0.07), 6)))


# ---------------------------------------------------------------------------------------------- on the floor


def plant(build: Builder, place: OrnamentPlace, height: float | int, stock: Stock, trailing: bool = False) -> None:
    """A plant in a pot that stands at the place, `height` m high with its leaves."""
    rng = stock.rng
    pot = 0.30 * height if height > 0.5 else 0.42 * height
    wide = 0.42 * pot + (0.03 if height > 0.5 else 0.02)
    profile = [
        (0.72 * wide, 0),
        (wide, 0.9 * pot),
        (1.06 * wide, 0.9 * pot),
        (1.06 * wide, pot),
        (0.9 * wide, pot),
        (0.9 * wide, 0.94 * pot),
        (0, 0.94 * pot),
    ]
    colour = pick(rng, POTS)
    build.paint(colour, *place.put(mesh.lathe(profile[:5], sides=14)))
    build.paint((0.28, 0.20, 0.14), *place.put(mesh.lathe(profile[5:], sides=14)))
    count = 16 if height > 0.5 else 10
    for k in range(count):
        turn = 2 * math.pi * (k / count + float(rng.uniform(0, 0.05))) * 2.4
        steep = float(rng.uniform(0.55, 1.35)) if not trailing else float(rng.uniform(-0.1, 0.8))
        length = (height - pot) * float(rng.uniform(0.7, 1.05)) * (0.75 if trailing else 1)
        part = place.at(0, 0, 0.94 * pot)
        green = pick(rng, LEAVES)
        build.paint(
            green,
            *OrnamentPlace(part.pos, part.turn + turn).put(
                leaf(length, 0.16 * length + 0.012, steep, 1.3 if not trailing else 1.9)
            ),
        )


def leaf(length: float | int, width: float | int, steep: float | int, bend: float | int) -> Triangles:
    """A blade that rises from the origin towards +x, both sides."""
    steps, pos, angle = 4, np.zeros(2), steep
    spine, half = [pos], [0.25 * width]
    for k in range(steps):
        pos = pos + length / steps * np.array([math.cos(angle), math.sin(angle)])
        angle -= bend / steps
        spine.append(pos)
        half.append(width * math.sin(math.pi * min(0.97, (k + 1.6) / (steps + 1.4))) * 0.5)
    half[-1] = 0.02 * width
    parts = []
    for (a, wa), (b, wb) in zip(zip(spine, half, strict=True), list(zip(spine, half, strict=True))[1:], strict=False):
        corners = np.array([(a[0], -wa, a[1]), (b[0], -wb, b[1]), (b[0], wb, b[1]), (a[0], wa, a[1])])
        parts += [mesh.quad(corners), mesh.quad(corners[::-1])]
    return mesh.joined(parts)


# ---------------------------------------------------------------------------------------- at the ceiling, at windows


def pendant(build: Builder, place: OrnamentPlace, drop: float | int, kind: str, stock: Stock) -> None:
    """A lamp that hangs `drop` m below the ceiling at the place."""
    rng = stock.rng
    if kind == "globe":
        shade = mesh.ball(0.15, (0, 0, -drop - 0.12), 16)
        build.add(stock.glow, *place.put(shade))
    elif kind == "dome":
        build.add(
            stock.glow, *place.put(mesh.lathe([(0, -0.11), (0.10, -0.095), (0.16, -0.05), (0.17, -0.01)], sides=18))
        )
        build.paint(STEEL, *place.put(mesh.lathe([(0.175, -0.025), (0.18, -0.02), (0.18, 0.0)], sides=18)))
        return
    elif kind == "tube":
        build.add(stock.glow, *place.put(mesh.box((0, 0, -0.055), (1.1, 0.07, 0.03))))
        build.paint((0.90, 0.90, 0.90), *place.put(mesh.box((0, 0, -0.025), (1.16, 0.11, 0.04))))
        return
    elif kind == "cone":
        colour = pick(rng, ((0.20, 0.22, 0.24), (0.76, 0.58, 0.34), (0.86, 0.84, 0.80), (0.28, 0.42, 0.42)))
        build.paint(
            colour, *place.put(mesh.lathe([(0.19, -drop - 0.16), (0.12, -drop - 0.05), (0.03, -drop)], sides=18))
        )
        build.add(
            stock.glow,
            *place.put(mesh.lathe([(0, -drop - 0.155), (0.18, -drop - 0.15)], sides=18)),
            *place.put(mesh.ball(0.05, (0, 0, -drop - 0.15), 10)),
        )
    else:  # drum
        build.add(
            stock.glow,
            *place.put(
                mesh.lathe(
                    [(0, -drop - 0.19), (0.2, -drop - 0.19), (0.22, -drop - 0.19), (0.2, -drop + 0.01)], sides=20
                )
            ),
        )
    build.paint(
        BLACK,
        *place.put(mesh.rod((0, 0, -drop), (0, 0, 0), 0.006, 6), mesh.lathe([(0.05, -0.03), (0.05, 0)], sides=12)),
    )


def curtains(
    build: Builder, place: OrnamentPlace, width: float | int, top: float | int, bottom: float | int, cloth: Material
) -> None:
    """Two curtains on a rod, to both sides of `width` m; `top` and `bottom` are heights above the place."""
    reach = width / 2 + 0.22
    build.paint(
        BLACK,
        *place.put(
            mesh.rod((-reach - 0.06, 0.085, top + 0.03), (reach + 0.06, 0.085, top + 0.03), 0.011),
            mesh.ball(0.02, (-reach - 0.07, 0.085, top + 0.03), 8),
            mesh.ball(0.02, (reach + 0.07, 0.085, top + 0.03), 8),
        ),
    )
    for side in (-1, 1):
        folds, wide = 5, 0.34
        x = np.linspace(reach - wide, reach, 4 * folds + 1) * side
        y = 0.085 + 0.032 * np.sin(np.linspace(0, 2 * np.pi * folds, len(x)))
        order = range(len(x) - 1)
        parts = []
        for k in order:
            a, b = (k, k + 1) if side < 0 else (k + 1, k)
            corners = [(x[b], y[b], bottom), (x[a], y[a], bottom), (x[a], y[a], top + 0.03), (x[b], y[b], top + 0.03)]
            uv = [(4 * x[b], 3 * bottom), (4 * x[a], 3 * bottom), (4 * x[a], 3 * top), (4 * x[b], 3 * top)]
            front = mesh.quad(corners, uv)
            parts += [front, mesh.quad(corners[::-1], uv[::-1])]
        build.add(cloth, *place.put(*parts))


def blind(
    build: Builder, place: OrnamentPlace, width: float | int, top: float | int, drop: float | int, colour: Colour
) -> None:
    """A roller blind, a part of its way down."""
    build.paint(
        (0.90, 0.90, 0.89),
        *place.put(mesh.rod((-width / 2 - 0.05, 0.045, top), (width / 2 + 0.05, 0.045, top), 0.025, 10)),
    )
    build.paint(colour, *place.put(mesh.box((0, 0.06, top - drop / 2), (width + 0.06, 0.004, drop))))
    build.paint((0.80, 0.79, 0.76), *place.put(mesh.box((0, 0.06, top - drop), (width + 0.06, 0.014, 0.02))))


def cloth(name: str, rgb: Colour, seed: int, light: float | int = 0.06) -> Material:
    """A curtain's: some light comes through."""
    return Material(name, fabric(rgb, seed), emission=light)
