"""Small generated pictures: wood grain, tiles, cloth, stone, labels, book covers, screens, paintings.

Every function returns a PIL image; the same random generator state gives the same pixels. Images are quantised to
few colours so that a PNG stays between a few hundred bytes and a few kilobytes.
"""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

RGB = tuple[float, float, float]
SIZE = 64


def _generator(rng: random.Random) -> np.random.Generator:
    return np.random.default_rng(rng.getrandbits(32))


def _smooth(noise: np.ndarray, rounds: int, axis: int) -> np.ndarray:
    for _ in range(rounds):
        noise = (noise + np.roll(noise, 1, axis) + np.roll(noise, -1, axis)) / 3
    return noise


def _image(shade: np.ndarray, rgb: RGB, depth: float) -> Image.Image:
    """A colour whose brightness follows `shade` [h, w], brought to mean 0 and range 1, with contrast `depth`."""
    shade = shade - shade.mean()
    shade = shade / max(float(np.abs(shade).max()), 1e-9)
    pixels = np.asarray(rgb)[None, None] * (1 + depth * shade[..., None])
    return _quantised(Image.fromarray((pixels.clip(0, 1) * 255).astype(np.uint8)))


def _quantised(image: Image.Image, colours: int = 16) -> Image.Image:
    return image.quantize(colours, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)


def wood(rgb: RGB, rng: random.Random) -> Image.Image:
    """Grain along u (columns)."""
    g = _generator(rng)
    fibre = _smooth(g.standard_normal((SIZE, SIZE)), 14, 1)
    rows = np.arange(SIZE)[:, None] / SIZE
    waves = np.sin(
        2 * np.pi * (rows * g.integers(3, 6) + 0.08 * np.sin(2 * np.pi * np.arange(SIZE)[None] / SIZE + 6 * rows))
    )
    return _image(fibre / np.abs(fibre).max() + 0.45 * waves, rgb, 0.2)


def brushed(rgb: RGB, rng: random.Random) -> Image.Image:
    """Brushed metal."""
    return _image(_smooth(_generator(rng).standard_normal((SIZE, SIZE)), 20, 1), rgb, 0.09)


def speckle(rgb: RGB, rng: random.Random, depth: float = 0.25) -> Image.Image:
    """Stone, skin, bread crust: soft blotches with grains."""
    g = _generator(rng)
    blotch = _smooth(_smooth(g.standard_normal((SIZE, SIZE)), 6, 0), 6, 1)
    return _image(blotch / np.abs(blotch).max() + 0.25 * g.standard_normal((SIZE, SIZE)), rgb, depth)


def weave(rgb: RGB, rng: random.Random) -> Image.Image:
    """Plain cloth."""
    g = _generator(rng)
    i, j = np.indices((32, 32))
    return _image(((i + j) % 2) * 0.7 + ((i // 2 + j // 2) % 2) * 0.4 + 0.3 * g.standard_normal((32, 32)), rgb, 0.13)


def stripes(rgb: RGB, other: RGB, bands: int = 4) -> Image.Image:
    image = Image.new("RGB", (SIZE, 8), _byte(rgb))
    draw = ImageDraw.Draw(image)
    width = SIZE / bands / 2
    for k in range(bands):
        draw.rectangle([2 * k * width, 0, (2 * k + 1) * width - 1, 8], fill=_byte(other))
    return _quantised(image, 4)


def checks(rgb: RGB, other: RGB, cells: int = 4) -> Image.Image:
    i, j = np.indices((SIZE, SIZE)) * cells // SIZE
    mixed = ((i % 2).astype(float) + (j % 2)) / 2
    pixels = np.asarray(rgb) * (1 - mixed[..., None]) + np.asarray(other) * mixed[..., None]
    return _quantised(Image.fromarray((pixels * 255).astype(np.uint8)), 4)


def tiles(rgb: RGB, grout: RGB, count: int = 4) -> Image.Image:
    """Square tiles with joints."""
    image = Image.new("RGB", (SIZE, SIZE), _byte(rgb))
    draw = ImageDraw.Draw(image)
    for k in range(count):
        at = k * SIZE // count
        draw.line([at, 0, at, SIZE], fill=_byte(grout), width=2)
        draw.line([0, at, SIZE, at], fill=_byte(grout), width=2)
    return _quantised(image, 4)


def planks(rgb: RGB, rng: random.Random, count: int = 4) -> Image.Image:
    """A floor of boards along u, each with its own shade."""
    pixels = np.asarray(wood(rgb, rng).convert("RGB"), float)
    height = SIZE // count
    for k in range(count):
        pixels[k * height : (k + 1) * height] *= rng.uniform(0.85, 1.1)
        pixels[k * height] *= 0.55
        joint = rng.randrange(SIZE)
        pixels[k * height : (k + 1) * height, joint] *= 0.6
    return _quantised(Image.fromarray(pixels.clip(0, 255).astype(np.uint8)), 24)


def knit(rgb: RGB, rng: random.Random) -> Image.Image:
    i, j = np.indices((32, 32))
    return _image(np.sin(i * np.pi / 4 + np.abs(j % 8 - 4)) + 0.2 * _generator(rng).standard_normal((32, 32)), rgb, 0.2)


def wicker(rgb: RGB) -> Image.Image:
    i, j = np.indices((32, 32))
    over = ((i // 8 + j // 8) % 2).astype(float)
    shade = np.where(over > 0, np.sin((i % 8) / 8 * np.pi), np.sin((j % 8) / 8 * np.pi))
    return _image(shade, rgb, 0.4)


def print_lines(draw: ImageDraw.ImageDraw, box: tuple[int, int, int, int], rows: int, fill, rng: random.Random) -> None:
    """Grey lines that read as text from afar, inside a pixel box."""
    left, top, right, bottom = box
    step = (bottom - top) / max(rows, 1)
    for k in range(rows):
        y = int(top + k * step)
        end = int(left + (right - left) * rng.uniform(0.6, 1.0))
        draw.rectangle([left, y, end, y + max(1, int(step * 0.4))], fill=fill)


def label(rgb: RGB, accent: RGB, rng: random.Random, shape: tuple[int, int] = (64, 96)) -> Image.Image:
    """The front of a package: a coloured field, a badge, a name bar, small print. shape: (width, height) pixels."""
    w, h = shape
    image = Image.new("RGB", shape, _byte(rgb))
    draw = ImageDraw.Draw(image)
    style = rng.randrange(4)
    if style == 0:
        draw.ellipse([w * 0.14, h * 0.42, w * 0.86, h * 0.85], fill=_byte(accent))
    elif style == 1:
        draw.polygon([(0, h * 0.9), (w, h * 0.5), (w, h), (0, h)], fill=_byte(accent))
    elif style == 2:
        draw.rectangle([0, h * 0.45, w, h * 0.8], fill=_byte(accent))
    else:
        for k in range(5):
            x, y = rng.uniform(0.1, 0.8) * w, rng.uniform(0.45, 0.85) * h
            draw.ellipse([x, y, x + w * 0.2, y + w * 0.2], fill=_byte(accent))
            del k
    draw.rectangle([w * 0.1, h * 0.12, w * 0.9, h * 0.3], fill=(250, 250, 245))
    draw.rectangle([w * 0.18, h * 0.17, w * rng.uniform(0.6, 0.82), h * 0.25], fill=_byte(accent))
    print_lines(draw, (int(w * 0.2), int(h * 0.88), int(w * 0.8), h - 2), 2, (250, 250, 245), rng)
    return _quantised(image, 8)


def cover(rgb: RGB, rng: random.Random) -> Image.Image:
    """A book's cover."""
    w, h = 48, 64
    image = Image.new("RGB", (w, h), _byte(rgb))
    draw = ImageDraw.Draw(image)
    light = tuple(min(255, int(255 * c * 0.6 + 100)) for c in rgb)
    if rng.random() < 0.5:
        draw.rectangle([4, 4, w - 5, h - 5], outline=light, width=1)
    draw.rectangle([9, 10, w - 10, 15], fill=(245, 235, 205))
    draw.rectangle([13, 18, w - 14, 21], fill=(245, 235, 205))
    if rng.random() < 0.6:
        draw.ellipse([14, 28, w - 15, 47], fill=light)
    else:
        draw.polygon([(10, 50), (24, 28), (38, 50)], fill=light)
    draw.rectangle([16, h - 11, w - 17, h - 9], fill=(245, 235, 205))
    return _quantised(image, 8)


def paper(rng: random.Random, rows: int = 14, rgb: RGB = (0.96, 0.95, 0.92), head: bool = True) -> Image.Image:
    """A printed page."""
    w, h = 48, 64
    image = Image.new("RGB", (w, h), _byte(rgb))
    draw = ImageDraw.Draw(image)
    if head:
        draw.rectangle([5, 4, w - 12, 8], fill=(40, 40, 45))
    print_lines(draw, (5, 13, w - 5, h - 4), rows, (130, 130, 135), rng)
    return _quantised(image, 6)


def painting(rng: random.Random) -> Image.Image:
    """A landscape: sky, a sun, hills; or coloured fields."""
    w, h = 64, 48
    if rng.random() < 0.6:
        sky = np.array([rng.uniform(0.5, 0.9), rng.uniform(0.6, 0.85), rng.uniform(0.7, 0.95)])
        fade = np.linspace(1, 0.6, h)[:, None, None]
        image = Image.fromarray((np.broadcast_to(sky * fade, (h, w, 3)) * 255).astype(np.uint8))
        draw = ImageDraw.Draw(image)
        x = rng.uniform(8, 50)
        draw.ellipse([x, 6, x + 9, 15], fill=(250, 220, 140))
        for k, base in enumerate((24, 31, 38)):
            phase = rng.uniform(0, 6)
            line = [(i, base + 4 * np.sin(i / (9 + 3 * k) + phase)) for i in range(w + 1)]
            green = (int(70 + 30 * k), int(110 + 25 * k - 20 * (k % 2)), int(60 + 15 * k))
            draw.polygon([*line, (w, h), (0, h)], fill=green)
    else:
        image = Image.new("RGB", (w, h), _byte((0.93, 0.9, 0.84)))
        draw = ImageDraw.Draw(image)
        for _ in range(6):
            x, y = rng.uniform(0, 45), rng.uniform(0, 30)
            fill = _byte((rng.uniform(0.2, 0.9), rng.uniform(0.15, 0.7), rng.uniform(0.1, 0.7)))
            box = [x, y, x + rng.uniform(8, 28), y + rng.uniform(6, 22)]
            (draw.rectangle if rng.random() < 0.6 else draw.ellipse)(box, fill=fill)
    return _quantised(image)


def screen(rng: random.Random, rgb: RGB = (0.05, 0.06, 0.08)) -> Image.Image:
    """A dark display with a faint gloss."""
    w, h = 48, 32
    i, j = np.indices((h, w))
    gloss = 0.12 * ((i + j * 0.6) < rng.uniform(18, 30))
    pixels = np.asarray(rgb)[None, None] + gloss[..., None] * np.array([0.7, 0.8, 1.0])
    return _quantised(Image.fromarray((pixels.clip(0, 1) * 255).astype(np.uint8)), 4)


def keys(rgb: RGB, key: RGB, columns: int, rows: int) -> Image.Image:
    """Rows of keys (keyboard, calculator, remote)."""
    w, h = 8 * columns, 8 * rows
    image = Image.new("RGB", (w, h), _byte(rgb))
    draw = ImageDraw.Draw(image)
    for i in range(columns):
        for j in range(rows):
            draw.rectangle([8 * i + 1, 8 * j + 1, 8 * i + 6, 8 * j + 6], fill=_byte(key))
    return _quantised(image, 4)


def dial(rgb: RGB = (0.97, 0.97, 0.95), ink: RGB = (0.1, 0.1, 0.12), hands: bool = True) -> Image.Image:
    """A clock's or a scale's face."""
    n = 64
    image = Image.new("RGB", (n, n), _byte(rgb))
    draw = ImageDraw.Draw(image)
    for k in range(12):
        a = k * np.pi / 6
        c, s = np.cos(a), np.sin(a)
        draw.line([32 + 24 * c, 32 + 24 * s, 32 + 29 * c, 32 + 29 * s], fill=_byte(ink), width=2)
    if hands:
        draw.line([32, 32, 32, 10], fill=_byte(ink), width=2)
        draw.line([32, 32, 46, 40], fill=_byte(ink), width=3)
    else:
        draw.line([32, 32, 20, 14], fill=(200, 30, 30), width=2)
    return _quantised(image, 6)


def custom(
    draw_on: Callable[[ImageDraw.ImageDraw], None], shape: tuple[int, int], rgb: RGB, colours: int = 8
) -> Image.Image:
    """A picture of one's own: `draw_on` paints over a field of colour `rgb`; shape: (width, height) pixels."""
    image = Image.new("RGB", shape, _byte(rgb))
    draw_on(ImageDraw.Draw(image))
    return _quantised(image, colours)


def _byte(rgb: RGB) -> tuple[int, int, int]:
    r, g, b = (max(0, min(255, int(255 * c))) for c in rgb)
    return (r, g, b)
