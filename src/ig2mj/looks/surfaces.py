"""Walls, floors and ceilings of rooms as textures: patterns by room type, with the shade of corners and furniture.

Light is soft indoors: corners are darker than the middle of a wall. Renderers that compute no such shade show it from
the textures, all alike.

Axes: R rows (upwards, or along +y), X columns.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.looks.materials import Texture, fractal, mixed, noise, shaded

PER_METRE = 150
"""Texels of walls."""

WALL_WIDTH = 1.2
"""m of a wall after which its pattern repeats."""

FLOOR_PER_METRE, MOST_TEXELS = 110, 900
"""Texels of floors, and of a floor's longest side."""

RGB = tuple[float | int, float | int, float | int]


@dataclasses.dataclass(frozen=True)
class WallStyle:
    """A kind of wall: its pattern, and the colours that it is painted in."""

    pattern: str
    colours: tuple[tuple[RGB, RGB], ...]


CREAM, WHITE, SAND = (0.95, 0.92, 0.85), (0.95, 0.95, 0.94), (0.90, 0.84, 0.73)
SAGE, MIST, BLUSH, SUN = (0.76, 0.82, 0.73), (0.77, 0.84, 0.89), (0.93, 0.82, 0.78), (0.96, 0.89, 0.69)
TEAL, NAVY, TERRA = (0.46, 0.66, 0.66), (0.36, 0.44, 0.58), (0.82, 0.59, 0.47)

STYLES: dict[str, WallStyle] = {
    "living_room": WallStyle("damask", ((CREAM, SAND), (SAGE, CREAM), (MIST, WHITE))),
    "television_room": WallStyle("damask", ((NAVY, MIST), (TEAL, CREAM))),
    "bedroom": WallStyle("stripes", ((MIST, WHITE), (BLUSH, CREAM), (SAGE, CREAM))),
    "childs_room": WallStyle("stars", (((0.72, 0.85, 0.94), (1.0, 0.95, 0.72)), ((0.97, 0.86, 0.88), WHITE))),
    "playroom": WallStyle("stars", (((0.98, 0.90, 0.66), (0.95, 0.55, 0.42)),)),
    "dining_room": WallStyle("wainscot", ((TERRA, CREAM), (TEAL, WHITE), (SAND, WHITE))),
    "corridor": WallStyle("wainscot", ((SUN, WHITE), (SAGE, WHITE), (MIST, WHITE))),
    "lobby": WallStyle("wainscot", ((TERRA, CREAM),)),
    "staircase": WallStyle("wainscot", ((SAND, WHITE),)),
    "library": WallStyle("panels", (((0.45, 0.30, 0.20), (0.42, 0.50, 0.40)),)),
    "home_office": WallStyle("paint", ((TEAL, WHITE), (SAGE, WHITE), (SAND, WHITE))),
    "kitchen": WallStyle("paint", ((CREAM, WHITE), (SUN, WHITE), (MIST, WHITE))),
    "pantry_room": WallStyle("boards", ((CREAM, WHITE),)),
    "closet": WallStyle("boards", ((BLUSH, WHITE), (CREAM, WHITE))),
    "bathroom": WallStyle("tiles", ((WHITE, (0.52, 0.72, 0.78)), ((0.9, 0.95, 0.95), TEAL), (CREAM, TERRA))),
    "utility_room": WallStyle("tiles", ((WHITE, (0.62, 0.76, 0.62)),)),
    "garage": WallStyle("blocks", (((0.78, 0.77, 0.74), (0.62, 0.61, 0.58)),)),
    "storage_room": WallStyle("blocks", (((0.84, 0.82, 0.78), (0.68, 0.66, 0.62)),)),
    "exercise_room": WallStyle("band", ((WHITE, (0.93, 0.52, 0.25)),)),
    "balcony": WallStyle("plaster", (((0.90, 0.87, 0.80), WHITE),)),
}  # fmt: skip
"""By room type; others are painted as a kitchen is."""

FACADE = WallStyle("plaster", (((0.93, 0.90, 0.83), WHITE), ((0.86, 0.80, 0.70), WHITE), ((0.80, 0.84, 0.84), WHITE)))


def wall_texture(style: WallStyle, height: float | int, seed: int) -> Texture:
    """A wall from the floor to the ceiling (m), `WALL_WIDTH` wide."""
    rng = np.random.default_rng(seed)
    shape = (round(PER_METRE * height), round(PER_METRE * WALL_WIDTH))
    z = ((np.arange(shape[0]) + 0.5) / PER_METRE)[:, None] * np.ones(shape)
    x = ((np.arange(shape[1]) + 0.5) / PER_METRE)[None] * np.ones(shape)
    colours = style.colours[int(rng.integers(len(style.colours)))]
    image = PATTERNS[style.pattern](x, z, colours, rng)
    corner = 0.17 * np.exp(-z / 0.16) + 0.20 * np.exp(-(height - z) / 0.22) + 0.05 * (1 - z / height)
    return np.clip(image * (1.02 - corner)[..., None], 0, 1)


def _paint(x, z, colours, rng) -> Texture:
    return shaded(colours[0], fractal(x.shape, (10, 6), rng), 0.018)


def _plaster(x, z, colours, rng) -> Texture:
    return shaded(colours[0], 0.5 * noise(x.shape, (90, 60), rng) + 0.5 * fractal(x.shape, (8, 4), rng), 0.07)


def _stripes(x, z, colours, rng) -> Texture:
    wide = np.clip(8 * np.sin(2 * np.pi * x / 0.2), -1, 1) * 0.5 + 0.5
    thin = np.exp(-((((x / 0.2 + 0.25) % 0.5 - 0.25) * 0.2 / 0.004) ** 2))
    image = mixed(colours[0], 0.5 * np.asarray(colours[0]) + 0.5 * np.asarray(colours[1]), wide)
    return mixed(image, 0.86 * np.asarray(colours[0]), 0.7 * thin)


def _damask(x, z, colours, rng) -> Texture:
    u, v = x / 0.3, z / 0.42
    u = u + 0.5 * (np.floor(v) % 2)
    a, b = 2 * np.pi * (u % 1 - 0.5), 2 * np.pi * (v % 1 - 0.5)
    flower = np.cos(a) + np.cos(b) + 0.5 * np.cos(2 * a) * np.cos(b) + 0.35 * np.cos(3 * b) * np.cos(a)
    shape = np.clip(6 * np.abs(flower - 0.9) - 0.6, 0, 1)
    return mixed(0.93 * np.asarray(colours[0]) + 0.07 * np.asarray(colours[1]), colours[0], shape)


def _stars(x, z, colours, rng) -> Texture:
    image = shaded(colours[0], fractal(x.shape, (5, 4), rng), 0.03)
    for k in range(26):
        cx, cz, size = rng.uniform(0, WALL_WIDTH), rng.uniform(0.2, z.max()), rng.uniform(0.02, 0.055)
        dx = (x - cx + WALL_WIDTH / 2) % WALL_WIDTH - WALL_WIDTH / 2
        angle, far = np.arctan2(z - cz, dx), np.hypot(dx, z - cz)
        edge = size * (1 + 0.35 * np.cos(5 * angle)) if k % 2 else size * 0.6
        image = mixed(image, colours[1], np.clip((edge - far) / 0.006, 0, 1) * 0.85)
    return image


def _wainscot(x, z, colours, rng) -> Texture:
    return _lower_panels(x, z, _paint(x, z, colours, rng), colours[1], 0.95)


def _panels(x, z, colours, rng) -> Texture:
    wood = shaded(colours[0], fractal(x.shape, (4, 40), rng), 0.18)
    return _lower_panels(x, z, _damask(x, z, (colours[1], colours[1]), rng), wood, 1.1)


def _lower_panels(x, z, above, colour, height) -> Texture:
    """Panels with a rail on top, below; something else above."""
    below = np.ones((*x.shape, 3)) * np.asarray(colour)
    u, w = (x % 0.6) - 0.3, z - 0.5 * (height + 0.06)
    inner = np.minimum(0.22 - np.abs(u), 0.5 * height - 0.17 - np.abs(w))
    groove = np.exp(-((inner / 0.012) ** 2))
    below = below * (1 - 0.22 * groove)[..., None]
    rail = np.clip(1 - np.abs(z - height) / 0.03, 0, 1) > 0
    image = np.where((z < height)[..., None], below, above)
    image = np.where(rail[..., None], 1.04 * below, image)
    return image * (1 - 0.25 * np.exp(-(((z - height + 0.035) / 0.012) ** 2)))[..., None]


def _boards(x, z, colours, rng) -> Texture:
    gap = np.exp(-(((x % 0.1 - 0.05) / 0.004) ** 2))
    return shaded(colours[0], fractal(x.shape, (3, 30), rng), 0.04) * (1 - 0.25 * gap)[..., None]


def _tiles(x, z, colours, rng) -> Texture:
    top = 1.95
    row = np.floor(z / 0.15)
    brick = x + 0.15 * (row % 2)
    tone = rng.uniform(-1, 1, (64, 8))[row.astype(int) % 64, (np.floor(brick / 0.3).astype(int)) % 4]
    tile = shaded(colours[0], tone, 0.025)
    border = (z > 1.35) & (z < 1.5)
    tile = np.where(border[..., None], shaded(colours[1], tone, 0.10), tile)
    joint = np.minimum(np.minimum(brick % 0.3, 0.3 - brick % 0.3), np.minimum(z % 0.15, 0.15 - z % 0.15))
    tile = mixed(tile, (0.80, 0.80, 0.79), np.clip((0.004 - joint) / 0.003, 0, 1))
    paint = _paint(x, z, (tuple(0.5 * np.asarray(colours[0]) + 0.5), colours[1]), rng)
    return np.where((z < top)[..., None], tile, paint)


def _blocks(x, z, colours, rng) -> Texture:
    row = np.floor(z / 0.2)
    along = x + 0.2 * (row % 2)
    joint = np.minimum(np.minimum(along % 0.4, 0.4 - along % 0.4), np.minimum(z % 0.2, 0.2 - z % 0.2))
    image = shaded(colours[0], 0.5 * noise(x.shape, (120, 60), rng) + 0.5 * fractal(x.shape, (6, 4), rng), 0.08)
    return mixed(image, colours[1], np.clip((0.006 - joint) / 0.004, 0, 1))


def _band(x, z, colours, rng) -> Texture:
    image = _paint(x, z, colours, rng)
    return np.where(((z > 1.0) & (z < 1.18))[..., None], np.asarray(colours[1]), image)


PATTERNS: dict[str, Callable[..., Texture]] = {
    "paint": _paint, "plaster": _plaster, "stripes": _stripes, "damask": _damask, "stars": _stars,
    "wainscot": _wainscot, "panels": _panels, "boards": _boards, "tiles": _tiles, "blocks": _blocks, "band": _band,
}  # fmt: skip

FLOORS: dict[str, str] = {
    "bathroom": "small_tiles", "kitchen": "tiles", "utility_room": "tiles", "pantry_room": "tiles",
    "garage": "concrete", "storage_room": "concrete",
    "balcony": "decking", "exercise_room": "cork", "lobby": "checks", "bedroom": "carpet",
    "childs_room": "carpet", "playroom": "cork", "dining_room": "herringbone", "library": "herringbone",
    "living_room": "planks", "staircase": "planks",
}  # fmt: skip
"""Room type -> floor; others have planks."""

OAK, WALNUT, HONEY, ASH = (0.72, 0.55, 0.37), (0.49, 0.34, 0.23), (0.80, 0.62, 0.40), (0.79, 0.70, 0.57)
FLOOR_COLOURS: dict[str, tuple[RGB, ...]] = {
    "planks": (OAK, HONEY, WALNUT, ASH),
    "herringbone": (OAK, WALNUT),
    "tiles": ((0.87, 0.84, 0.78), (0.78, 0.52, 0.38), (0.72, 0.75, 0.77)),
    "small_tiles": ((0.85, 0.87, 0.88), (0.55, 0.63, 0.67), (0.86, 0.80, 0.70)),
    "checks": ((0.93, 0.91, 0.86),),
    "concrete": ((0.62, 0.61, 0.59),),
    "cork": ((0.76, 0.60, 0.42),),
    "carpet": ((0.80, 0.74, 0.65), (0.70, 0.74, 0.78), (0.78, 0.68, 0.62)),
    "decking": ((0.62, 0.46, 0.32),),
}


def floor_texture(
    kind: str,
    low: Float[np.ndarray, "2"],
    high: Float[np.ndarray, "2"],
    seed: int,
    shadows: Sequence[tuple[np.ndarray, np.ndarray, float | int]] = (),
    sun: Sequence[Float[np.ndarray, "n 2"]] = (),
    sides: Sequence[bool] = (True, True, True, True),
) -> Texture:
    """A floor from corner to corner (m), all of it once.

    Args:
      kind: a value of `FLOORS`. shadows: low and high corner, and height above the floor, of what stands there.
      sun: outlines of patches of sunlight. sides: which of -x, +x, -y, +y have a wall.
    """
    rng = np.random.default_rng(seed)
    size = high - low
    fine = min(FLOOR_PER_METRE, MOST_TEXELS / float(size.max()))
    shape = (max(8, round(fine * size[1])), max(8, round(fine * size[0])))
    y = (low[1] + (np.arange(shape[0]) + 0.5) * size[1] / shape[0])[:, None] * np.ones(shape)
    x = (low[0] + (np.arange(shape[1]) + 0.5) * size[0] / shape[1])[None] * np.ones(shape)
    choices = FLOOR_COLOURS[kind]
    image = _FLOOR_PATTERNS[kind](x, y, choices[int(rng.integers(len(choices)))], rng)
    light = np.ones(shape)
    for there, distance in zip(sides, (x - low[0], high[0] - x, y - low[1], high[1] - y), strict=True):
        if there:
            light -= 0.20 * np.exp(-distance / 0.18)
    for a, b, above in shadows:
        out = np.hypot(*(np.maximum(np.maximum(a[k] - c, c - b[k]), 0) for k, c in enumerate((x, y))))
        inner = np.minimum(np.minimum(x - a[0], b[0] - x), np.minimum(y - a[1], b[1] - y))
        strength = 0.42 / (1 + 2.5 * above)
        light *= 1 - strength * np.exp(-out / (0.05 + 0.25 * above)) * np.clip(0.55 + inner / 0.3, 0.5, 1.0)
    image = image * np.clip(light, 0.35, 1)[..., None]
    if sun:
        bright = _outlines(shape, low, size, sun)
        image = image * (1 + 0.42 * bright[..., None] * np.array([1.0, 0.93, 0.78]))
    return np.clip(image, 0, 1)


def _outlines(shape: tuple[int, int], low: np.ndarray, size: np.ndarray, outlines: Sequence[np.ndarray]) -> np.ndarray:
    """How far each texel is within one of the outlines, 0..1, with soft edges."""
    from PIL import Image, ImageDraw, ImageFilter

    canvas = Image.new("L", (shape[1], shape[0]))
    pen = ImageDraw.Draw(canvas)
    for outline in outlines:
        texels = (np.asarray(outline) - low) / size * np.array([shape[1], shape[0]])
        pen.polygon([(float(a), float(b)) for a, b in texels], fill=255)
    return np.asarray(canvas.filter(ImageFilter.GaussianBlur(2.5)), float) / 255


def _planks(x, y, rgb, rng) -> Texture:
    return _boards_of(x, y, rgb, rng, 0.14, 1.3)


def _decking(x, y, rgb, rng) -> Texture:
    return _boards_of(x, y, rgb, rng, 0.11, 2.2, 0.006)


def _boards_of(x, y, rgb, rng, width, length, gap=0.0022) -> Texture:
    row = np.floor(y / width).astype(int)
    along = x + rng.uniform(0, length, 97)[row % 97]
    board = np.floor(along / length).astype(int)
    tone = rng.uniform(-1, 1, (97, 31))[row % 97, board % 31]
    grain = noise(x.shape, (max(4, x.shape[0] // 3), max(3, x.shape[1] // 60)), rng)
    image = shaded(shaded(rgb, tone, 0.11), grain, 0.08)
    joint = np.minimum(np.minimum(y % width, width - y % width), np.minimum(along % length, length - along % length))
    return image * (1 - 0.45 * np.clip((gap + 0.003 - joint) / 0.004, 0, 1))[..., None]


def _herringbone(x, y, rgb, rng) -> Texture:
    w, n = 0.09, 5
    u, v = np.floor((x + y) / np.sqrt(2) / w).astype(int), np.floor((y - x) / np.sqrt(2) / w).astype(int)
    across = (u - v) % (2 * n) < n
    first = np.where(across, (u - (u - v) % (2 * n)) * 131 + v * 7, (v - (v - u) % (2 * n)) * 57 + u * 13)
    tone = rng.uniform(-1, 1, 997)[first % 997]
    fu, fv = ((x + y) / np.sqrt(2) / w) % 1, ((y - x) / np.sqrt(2) / w) % 1
    side = np.where(across, np.minimum(fv, 1 - fv), np.minimum(fu, 1 - fu)) * w
    grain = noise(x.shape, (max(4, x.shape[0] // 6), max(4, x.shape[1] // 6)), rng)
    return shaded(shaded(rgb, tone, 0.16), grain, 0.06) * (1 - 0.4 * np.clip((0.005 - side) / 0.004, 0, 1))[..., None]


def _square_tiles(x, y, rgb, rng, size, grout) -> Texture:
    i, j = np.floor(x / size).astype(int), np.floor(y / size).astype(int)
    tone = rng.uniform(-1, 1, (61, 61))[i % 61, j % 61]
    joint = np.minimum(np.minimum(x % size, size - x % size), np.minimum(y % size, size - y % size))
    image = shaded(shaded(rgb, tone, 0.05), fractal(x.shape, (8, 8), rng, 4), 0.05)
    return mixed(image, 0.72 * np.asarray(rgb) + 0.06, np.clip((grout - joint) / 0.003, 0, 1))


def _tiles_of_floor(x, y, rgb, rng) -> Texture:
    return _square_tiles(x, y, rgb, rng, 0.4, 0.005)


def _small_tiles(x, y, rgb, rng) -> Texture:
    return _square_tiles(x, y, rgb, rng, 0.15, 0.004)


def _checks(x, y, rgb, rng) -> Texture:
    image = _square_tiles(x, y, rgb, rng, 0.4, 0.003)
    dark = (np.floor(x / 0.4) + np.floor(y / 0.4)) % 2 == 0
    return np.where(dark[..., None], image * np.array([0.30, 0.32, 0.35]), image)


def _concrete(x, y, rgb, rng) -> Texture:
    return shaded(rgb, 0.6 * fractal(x.shape, (4, 4), rng, 5) + 0.4 * noise(x.shape, (90, 90), rng), 0.10)


def _cork(x, y, rgb, rng) -> Texture:
    return shaded(rgb, noise(x.shape, (max(4, x.shape[0] // 3), max(4, x.shape[1] // 3)), rng), 0.13)


def _carpet(x, y, rgb, rng) -> Texture:
    fine = rng.uniform(-1, 1, x.shape)
    return shaded(rgb, 0.6 * fine + 0.4 * fractal(x.shape, (7, 7), rng, 3), 0.09)


_FLOOR_PATTERNS: dict[str, Callable[..., Texture]] = {
    "planks": _planks, "herringbone": _herringbone, "tiles": _tiles_of_floor, "small_tiles": _small_tiles,
    "checks": _checks, "concrete": _concrete, "cork": _cork, "carpet": _carpet, "decking": _decking,
}  # fmt: skip


def ceiling_texture(size: int = 64) -> Texture:
    """White, darker towards its edges; one for every room, all of it once."""
    y, x = np.mgrid[:size, :size] / (size - 1)
    edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    return np.clip(np.array([0.97, 0.965, 0.95]) * (1 - 0.16 * np.exp(-edge / 0.06))[..., None], 0, 1)
