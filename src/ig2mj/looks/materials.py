"""Materials of the decoration: a texture made by code, and how it reflects light.

Every texture is a function of its colours and of one seed, so that a home looks the same whenever it is loaded.
Textures are float arrays [R, X, 3] of 0..1, the lowest row first.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float, UInt8

Texture = Float[np.ndarray, "R X 3"]


@dataclasses.dataclass(frozen=True, eq=False)
class Material:
    """A material. Two are the same only if they are the same object.

    Attributes:
      name: unique in a home. image: its texture, as floats or bytes; None: the plain colour.
      rgba: multiplied into the texture. emission: part of its own colour that it shows without any light.
    """

    name: str
    image: Texture | UInt8[np.ndarray, "R X 3"] | None = None
    rgba: tuple[float | int, float | int, float | int, float | int] = (1.0, 1.0, 1.0, 1.0)
    specular: float | int = 0.0
    shininess: float | int = 0.0
    emission: float | int = 0.0


def texels(image: Texture | UInt8[np.ndarray, "R X 3"] | None) -> UInt8[np.ndarray, "R X 3"] | None:
    """A texture as bytes."""
    if image is None or image.dtype == np.uint8:
        return image
    return np.round(np.clip(image, 0, 1) * 255).astype(np.uint8)


def noise(shape: tuple[int, int], cells: tuple[int, int], rng: np.random.Generator) -> Float[np.ndarray, "R X"]:
    """Smooth noise of -1..1 that continues at its edges: values at `cells` lattice points, interpolated."""
    lattice = rng.uniform(-1, 1, cells)
    out = lattice
    for axis in (0, 1):
        place = np.arange(shape[axis]) * cells[axis] / shape[axis]
        low = place.astype(int)
        share = place - low
        share = share * share * (3 - 2 * share)
        share = share[:, None] if axis == 0 else share[None]
        out = (1 - share) * out.take(low % cells[axis], axis) + share * out.take((low + 1) % cells[axis], axis)
    return out


def fractal(shape: tuple[int, int], cells: tuple[int, int], rng: np.random.Generator, octaves: int = 3) -> np.ndarray:
    """Noise of several sizes, each half as strong as the one before."""
    total = np.zeros(shape)
    for k in range(octaves):
        total += noise(shape, (min(cells[0] << k, shape[0]), min(cells[1] << k, shape[1])), rng) / (1 << k)
    return total / (2 - 2.0 ** (1 - octaves))


def shaded(rgb: np.ndarray | tuple[float | int, ...], shade: Float[np.ndarray, "R X"], depth: float | int) -> Texture:
    """A colour whose brightness follows `shade` (-1..1)."""
    return np.clip(np.asarray(rgb, float) * (1 + depth * shade[..., None]), 0, 1)


def mixed(
    a: np.ndarray | tuple[float | int, ...], b: np.ndarray | tuple[float | int, ...], share: np.ndarray
) -> Texture:
    """(1 - share) a + share b, for every texel."""
    share = np.clip(share, 0, 1)[..., None]
    return (1 - share) * np.asarray(a, float) + share * np.asarray(b, float)


def fabric(rgb: tuple[float | int, ...], seed: int, size: int = 96) -> Texture:
    """Woven cloth."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:size, :size]
    weave = np.where((x // 2 + y // 2) % 2 == 0, np.sin(np.pi * (x % 2 + 0.5) / 2), 0.4)
    return shaded(rgb, 0.5 * (weave - 0.7) + 0.5 * fractal((size, size), (6, 6), rng), 0.14)


def wood(rgb: tuple[float | int, ...], seed: int, shape: tuple[int, int] = (64, 256)) -> Texture:
    """Grain along u."""
    rng = np.random.default_rng(seed)
    grain = fractal(shape, (24, 3), rng, 3)
    rings = np.sin(14 * np.pi * (np.arange(shape[0])[:, None] / shape[0] + 0.05 * noise(shape, (2, 4), rng)))
    return shaded(rgb, 0.7 * grain + 0.3 * rings, 0.22)


def stone(rgb: tuple[float | int, ...], seed: int, size: int = 128) -> Texture:
    """Marble-like: clouds and veins."""
    rng = np.random.default_rng(seed)
    cloud = fractal((size, size), (3, 3), rng, 5)
    vein = 1 - np.abs(fractal((size, size), (2, 2), rng, 5)) * 9
    return shaded(shaded(rgb, cloud, 0.10), -np.clip(vein, 0, 1), 0.16)


def metal(rgb: tuple[float | int, ...], seed: int, size: int = 96) -> Texture:
    """Brushed along u."""
    rng = np.random.default_rng(seed)
    return shaded(rgb, noise((size, size), (size, 3), rng), 0.10)


def glass(rgb: tuple[float | int, ...], seed: int, size: int = 64) -> Texture:
    """What is seen in a pane or a mirror: light bands across."""
    y, x = np.mgrid[:size, :size] / size
    band = np.sin(2 * np.pi * (1.2 * (x + y) + np.random.default_rng(seed).uniform()))
    return shaded(rgb, band, 0.07)


def grass(seed: int, size: int = 256) -> Texture:
    """A lawn, 4 m wide."""
    rng = np.random.default_rng(seed)
    blades = noise((size, size), (size // 2, size // 2), rng)
    patches = fractal((size, size), (5, 5), rng)
    return shaded(mixed((0.36, 0.52, 0.24), (0.50, 0.60, 0.30), 0.5 + 0.5 * patches), blades, 0.22)


def sky(night: bool, shape: tuple[int, int] = (128, 512)) -> Texture:
    """From the horizon (row 0) to the zenith, around once."""
    rng = np.random.default_rng(7)
    up = np.linspace(0, 1, shape[0])[:, None] * np.ones(shape)
    if night:
        base = mixed((0.10, 0.13, 0.24), (0.02, 0.03, 0.08), up**0.6)
        stars = (rng.uniform(size=shape) > 0.9985) & (up > 0.15)
        return np.clip(base + 0.7 * stars[..., None], 0, 1)
    base = mixed((0.87, 0.92, 0.96), (0.42, 0.65, 0.91), up**0.7)
    cloud = fractal(shape, (4, 10), rng, 5) + 0.05
    return mixed(base, (1.0, 1.0, 1.0), np.clip(2.2 * cloud, 0, 1) * np.clip(6 * up - 0.4, 0, 1) * (1 - up) * 0.9)
