"""The surfaces of what containers hold: flat shapes inside, horizontal, as high as the contents take of the inside.

The places of surfaces come from tables by tilt, direction of the tilt and share that is full, made once for each shape
of inside from points spread evenly over it. Cameras and viewers show the same surfaces.

Axes: W worlds, C containers, A tilts, B directions, L shares, P points of an inside.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.frames import Numbers, dot, numbers
from ig2mj.states.model import StateModel
from ig2mj.states.substances.containers import DIRECTIONS, FINENESS, TILTS, Containers
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import CONTAINS
from ig2mj.states.world import ExtendedStates

THIN = 0.0015
"""m: half the thickness of a surface."""

SHRINK = 0.96
"""Of a surface's half sizes, so that it does not stand out of walls."""

BEYOND = FINENESS / (FINENESS - 1)
"""By which an inside is wider than the points that are spread over it."""

FULL_BOX = 0.88
"""Share of its bounding rectangle from which a surface is a rectangle, not an ellipse."""

SHARES = 10
"""Columns of the tables: shares that are full, from 0 to 1."""

LEAST = 0.02
"""Share at which the least contents lie."""

SLICE = 18
"""One in so many points, those nearest to a level, make its outline."""


class Levels(NamedTuple):
    """Surfaces of contents.

    Attributes:
      there: the container holds something. pos: m, world. axes: of the shape, as columns, world. half: half sizes, m.
      rgb: 0..1, of the mixture.
    """

    there: Bool[Array, "W C"]
    pos: Float[Array, "W C 3"]
    axes: Float[Array, "W C 3 3"]
    half: Float[Array, "W C 3"]
    rgb: Float[Array, "W C 3"]


class _Tables(NamedTuple):
    """Of all containers of a scene.

    Attributes:
      surface: height, middle and half sizes, m: along the vertical and two horizontal axes from the body's origin.
      axes: two unit vectors in the plane of the opening, at right angles, along which outlines are measured.
      rectangle: whether outlines are rectangles.
    """

    surface: Float[np.ndarray, "C n 5"]
    axes: Float[np.ndarray, "C 2 3"]
    rectangle: Bool[np.ndarray, "C"]


def rectangles(model: StateModel) -> Bool[np.ndarray, "C"]:
    """Which surfaces are rectangles; the others are ellipses."""
    return _tables(of(model).containers).rectangle


def levels(model: StateModel, states: ExtendedStates, view: PhysicsView) -> Levels:
    """The surfaces of all worlds. Pure."""
    found = of(model)
    containers, tables = found.containers, _tables(found.containers)
    frames = containers.frames(view)
    up = frames.up()
    volume = jnp.asarray(states.volume)
    litres = jnp.sum(volume, axis=-1)
    height, x, y, half_x, half_y = _interpolated(containers, tables, up, litres / containers.litres)
    one, other = _horizontal(tables, up)
    place = [a * x + b * y + c * height for a, b, c in zip(one, other, up, strict=True)]
    colours = np.array([s.colour for s in found.substances], np.float32).reshape(-1, 3)
    turned = [frames.turned(axis) for axis in (one, other, up)]
    return Levels(
        there=litres >= CONTAINS,
        pos=jnp.stack(frames.points(place), axis=-1),
        axes=jnp.stack([jnp.stack(axis, axis=-1) for axis in turned], axis=-1),
        half=jnp.stack([SHRINK * half_x, SHRINK * half_y, jnp.full(height.shape, THIN)], axis=-1),
        rgb=volume @ colours / jnp.maximum(litres, 1e-9)[..., None],
    )


def _interpolated(containers: Containers, tables: _Tables, up: Numbers, share: Float[Array, "W C"]) -> Numbers:
    """The five numbers of the surfaces, between the nearest entries of the tables."""
    tilt, turn = containers.tilted(up)
    full = jnp.clip(share, LEAST, 1.0) * (SHARES - 1)
    row, column, level = (
        jnp.clip(jnp.floor(x), 0, most).astype(int)
        for x, most in ((tilt, TILTS - 2), (turn, DIRECTIONS - 1), (full, SHARES - 2))
    )
    table, own = jnp.asarray(tables.surface), np.arange(len(containers.body))
    found: Array = jnp.zeros((*share.shape, 5))
    for a in (0, 1):
        for b in (0, 1):
            for c in (0, 1):
                weight = 1.0
                for place, low, step in ((tilt, row, a), (turn, column, b), (full, level, c)):
                    weight = weight * jnp.where(step, place - low, 1.0 - (place - low))
                at = ((row + a) * DIRECTIONS + jnp.mod(column + b, DIRECTIONS)) * SHARES + level + c
                found = found + weight[..., None] * table[own, at]
    return numbers(found)


def _horizontal(tables: _Tables, up: Numbers) -> tuple[Numbers, Numbers]:
    """Two horizontal axes [..., C] in the frames of the bodies: the one of `_Tables.axes` that is less steep, made
    horizontal, and one at right angles to it. With the vertical they are right-handed."""
    ways = []
    for axis in (numbers(tables.axes[:, 0]), numbers(tables.axes[:, 1])):
        steep = dot(axis, up)
        flat = [a - u * steep for a, u in zip(axis, up, strict=True)]
        length = jnp.maximum(jnp.sqrt(dot(flat, flat)), 1e-6)
        ways.append((jnp.abs(steep), [f / length for f in flat]))
    (steep, first), (steep_too, second) = ways
    by_first = steep <= steep_too
    one = [jnp.where(by_first, a, b) for a, b in zip(first, _cross(second, up), strict=True)]
    return one, _cross(up, one)


def _cross(one: Numbers, other: Numbers) -> Numbers:
    x, y, z = one
    a, b, c = other
    return [y * c - z * b, z * a - x * c, x * b - y * a]


@functools.lru_cache(maxsize=8)
def _tables(containers: Containers) -> _Tables:
    shapes: dict[bytes, tuple[np.ndarray, np.ndarray, bool]] = {}
    rows = []
    for c, points in enumerate(containers.filling):
        key = points.tobytes() + containers.normal[c].tobytes() + containers.side[c].tobytes()
        if key not in shapes:
            shapes[key] = _of_shape(points, containers.normal[c], containers.side[c], containers.across[c])
        rows.append(shapes[key])
    return _Tables(
        surface=np.array([r[0] for r in rows], np.float32).reshape(len(rows), -1, 5),
        axes=np.array([r[1] for r in rows], np.float32).reshape(-1, 2, 3),
        rectangle=np.array([r[2] for r in rows], bool),
    )


def _of_shape(
    points: Float[np.ndarray, "P 3"], normal: np.ndarray, side: np.ndarray, across: np.ndarray
) -> tuple[np.ndarray, np.ndarray, bool]:
    """`surface`, `axes` and `rectangle` of one inside."""
    height = points @ normal
    middle = points[np.argsort(np.abs(height - np.median(height)), kind="stable")[: max(12, len(points) // SLICE)]]
    turn, rectangle = _least_rectangle(np.stack([middle @ side, middle @ across], axis=-1))
    axes = np.stack([np.cos(turn) * side + np.sin(turn) * across, np.cos(turn) * across - np.sin(turn) * side])
    tables = _Tables(np.zeros((1, 0, 5)), axes[None], np.zeros(1, bool))
    tilt = np.linspace(0, np.pi, TILTS)[:, None, None]
    turns = (np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS))[None, :, None]
    ups = np.cos(tilt) * normal + np.sin(tilt) * (np.cos(turns) * side + np.sin(turns) * across)  # [A, B, 3]
    with jax.ensure_compile_time_eval():  # may be asked for first while an image is traced
        one, other = (np.stack([np.asarray(n) for n in axis], axis=-1) for axis in _horizontal(tables, numbers(ups)))
    frames = np.stack([ups, one, other], axis=-1).reshape(-1, 3, 3)
    surface = np.array([_surfaces(points @ frame) for frame in frames])
    return surface.reshape(-1, 5), axes, rectangle


def _surfaces(points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "L 5"]:
    """The surfaces at all shares. `points`: height and two horizontal coordinates."""
    points = points[np.argsort(points[:, 0], kind="stable")]
    count, wide = len(points), max(1, len(points) // (2 * SLICE))
    rows = []
    for share in np.linspace(0.0, 1.0, SHARES):
        at = round(share * count)
        near = points[max(0, min(at - wide, count - 2 * wide)) : max(at + wide, 2 * wide)]
        exact = points[max(0, at - wide) : at + wide, 0]
        low, high = near[:, 1:].min(0), near[:, 1:].max(0)
        rows.append([exact.mean(), *((low + high) / 2), *(BEYOND * (high - low) / 2)])
    return np.array(rows)


def _least_rectangle(points: Float[np.ndarray, "P 2"]) -> tuple[float, bool]:
    """By how much the least rectangle round points is turned, radians, and whether they fill it."""
    import scipy.spatial  # takes as long as all of this package

    try:
        area = float(scipy.spatial.ConvexHull(points).volume)
    except scipy.spatial.QhullError:
        area = 0.0
    best = (np.inf, 0.0)
    for degrees in range(0, 90, 5):
        angle = np.radians(degrees)
        turned = points @ np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        size = float(np.prod(np.ptp(turned, axis=0)))
        if size < best[0] - 1e-9:
            best = (size, float(angle))
    return best[1], area > FULL_BOX * max(best[0], 1e-12)
