"""What is drawn on framed pictures and on rugs.

Axes: R rows (upwards), X columns.
"""

from __future__ import annotations

import numpy as np

from ig2mj.looks.materials import Texture, fractal, mixed, shaded

ARTS = (4, 2)
"""Columns and rows of pictures in the texture of all pictures."""

GREENS = ((0.24, 0.46, 0.24), (0.33, 0.55, 0.28), (0.20, 0.40, 0.27), (0.42, 0.60, 0.34))
"""Of leaves."""


def art_texture(seed: int, size: int = 128) -> Texture:
    """All pictures of a home: landscapes, a sea, abstract shapes, leaves."""
    rng = np.random.default_rng(seed)
    makers = [_hills, _sea, _blocks_of_colour, _circles, _leaf, _hills, _waves, _moon]
    order = rng.permutation(len(makers))
    rows = [
        np.concatenate([makers[order[r * ARTS[0] + c]](rng, size) for c in range(ARTS[0])], 1) for r in range(ARTS[1])
    ]
    return np.clip(np.concatenate(rows, 0), 0, 1)


def _grid(size: int) -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[:size, :size] / size
    return x, y


def _hills(rng, size) -> Texture:
    x, y = _grid(size)
    image = mixed((0.95, 0.85, 0.70), (0.55, 0.72, 0.85), y)
    image = mixed(image, (1.0, 0.93, 0.75), np.clip((0.09 - np.hypot(x - rng.uniform(0.3, 0.7), y - 0.78)) * 60, 0, 1))
    for k in range(4):
        ridge = (
            0.62
            - 0.15 * k
            + 0.07 * np.sin(2 * np.pi * (x * rng.uniform(0.8, 2) + rng.uniform()))
            + 0.03 * np.sin(9 * x + k)
        )
        image = mixed(image, (0.46 - 0.09 * k, 0.58 - 0.08 * k, 0.52 - 0.09 * k), np.clip((ridge - y) * 80, 0, 1))
    return image


def _sea(rng, size) -> Texture:
    x, y = _grid(size)
    image = mixed((0.98, 0.80, 0.62), (0.45, 0.62, 0.80), (y - 0.45) * 1.8)
    water = mixed((0.12, 0.30, 0.42), (0.36, 0.58, 0.66), y / 0.45 + 0.3 * fractal((size, size), (20, 4), rng))
    image = np.where((y < 0.45)[..., None], water, image)
    sail = (np.abs(x - 0.55) < (0.70 - y) * 0.35) & (y > 0.42) & (y < 0.70)
    return np.where(sail[..., None], np.array([0.97, 0.95, 0.92]), image)


def _blocks_of_colour(rng, size) -> Texture:
    x, y = _grid(size)
    image = np.ones((size, size, 3)) * np.array([0.94, 0.91, 0.85])
    for colour in ((0.82, 0.34, 0.25), (0.20, 0.33, 0.48), (0.92, 0.72, 0.32), (0.25, 0.42, 0.38)):
        a, b, w, h = rng.uniform(0.05, 0.6), rng.uniform(0.05, 0.6), rng.uniform(0.18, 0.35), rng.uniform(0.18, 0.4)
        image = np.where(((x > a) & (x < a + w) & (y > b) & (y < b + h))[..., None], np.array(colour), image)
    return image


def _circles(rng, size) -> Texture:
    x, y = _grid(size)
    image = np.ones((size, size, 3)) * np.array([0.90, 0.86, 0.79])
    for colour in ((0.76, 0.52, 0.42), (0.45, 0.52, 0.50), (0.86, 0.70, 0.50), (0.28, 0.30, 0.34)):
        far = np.hypot(x - rng.uniform(0.25, 0.75), y - rng.uniform(0.25, 0.75))
        image = mixed(image, colour, np.clip((rng.uniform(0.1, 0.26) - far) * 90, 0, 1) * 0.92)
    return image


def _leaf(rng, size) -> Texture:
    x, y = _grid(size)
    image = np.ones((size, size, 3)) * np.array([0.95, 0.94, 0.89])
    image = mixed(
        image, (0.28, 0.40, 0.30), np.clip((0.008 - np.abs(x - 0.5 - 0.06 * np.sin(3 * y))) * 200, 0, 1) * (y < 0.9)
    )
    for k in range(9):
        side, base = (1 if k % 2 else -1), 0.12 + 0.085 * k
        u = (x - 0.5) * side * 0.9 + (y - base) * 0.5
        v = (y - base) * 0.9 - (x - 0.5) * side * 0.5
        inside = (0.14 * np.sin(np.clip(u / (0.36 - 0.02 * k), 0, 1) * np.pi) * 0.5 - np.abs(v)) * 90
        image = mixed(image, GREENS[k % 4], np.clip(inside, 0, 1))
    return image


def _waves(rng, size) -> Texture:
    x, y = _grid(size)
    band = np.floor(7 * (y + 0.08 * np.sin(2 * np.pi * (x * 1.5 + y)))).astype(int) % 4
    colours = np.array([(0.93, 0.90, 0.82), (0.32, 0.52, 0.60), (0.84, 0.62, 0.42), (0.22, 0.34, 0.45)])
    return colours[band]


def _moon(rng, size) -> Texture:
    x, y = _grid(size)
    image = mixed((0.30, 0.38, 0.52), (0.10, 0.14, 0.26), y)
    image = mixed(image, (0.97, 0.95, 0.86), np.clip((0.16 - np.hypot(x - 0.6, y - 0.62)) * 80, 0, 1))
    ridge = 0.25 + 0.06 * np.sin(9 * x) + 0.04 * np.sin(23 * x)
    return mixed(image, (0.06, 0.09, 0.14), np.clip((ridge - y) * 80, 0, 1))


def rug_texture(kind: str, seed: int, aspect: float | int, size: int = 128) -> Texture:
    """A rug, all of it once. kind: "border", "kilim" or "round"."""
    rng = np.random.default_rng(seed)
    shape = (size, max(32, round(size * aspect)))
    v, u = np.meshgrid(np.arange(shape[0]) / shape[0], np.arange(shape[1]) / shape[1], indexing="ij")
    a, b = v * 1.0, u * aspect
    sets = (
        ((0.62, 0.26, 0.22), (0.92, 0.85, 0.70), (0.20, 0.26, 0.36)),
        ((0.30, 0.42, 0.50), (0.93, 0.90, 0.82), (0.80, 0.58, 0.36)),
        ((0.86, 0.80, 0.70), (0.45, 0.50, 0.46), (0.72, 0.46, 0.34)),
    )
    ground, light, dark = sets[int(rng.integers(3))]
    edge = np.minimum(np.minimum(a, 1 - a), np.minimum(b, aspect - b))
    if kind == "kilim":
        band = np.floor(b / 0.125).astype(int)
        zig = np.abs(((a * 8) % 1) - 0.5) * 0.1
        stripe = np.floor((b + zig) / 0.0625).astype(int) % 4
        image = np.array([ground, light, dark, light])[stripe]
        image = image * (0.96 + 0.04 * (band % 2))[..., None]
    else:
        image = np.ones((*shape, 3)) * np.array(ground)
        lozenge = np.abs(a - 0.5) / 0.34 + np.abs(b - aspect / 2) / (0.38 * aspect)
        image = np.where((lozenge < 1)[..., None], np.array(light), image)
        image = np.where((lozenge < 0.8)[..., None], np.array(dark), image)
        image = np.where((lozenge < 0.45)[..., None], np.array(light), image)
        dots = np.cos(2 * np.pi * a * 9) * np.cos(2 * np.pi * b * 9)
        image = np.where(((dots > 0.72) & (lozenge > 1.05) & (edge > 0.1))[..., None], np.array(light), image)
        image = np.where(((edge > 0.035) & (edge < 0.085))[..., None], np.array(light), image)
        image = np.where(((edge > 0.05) & (edge < 0.07))[..., None], np.array(dark), image)
    return shaded(image, fractal(shape, (60, 60), rng, 2), 0.10)
