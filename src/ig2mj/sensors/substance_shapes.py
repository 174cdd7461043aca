"""Where substances are seen in one world: levels of contents, streams, what covers objects, flames. On the host.

A level is a flat shape in the container's inside, at the height below which as much of the inside is as it holds. A
stream is a chain of points from the lowest place of the rim down to the first box or the floor below. Viewers draw both
(`ig2mj.viewer.substance_marks`).

Axes: N shapes, P points.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import quat_rotate
from ig2mj.states.model import StateModel
from ig2mj.states.substances import streams
from ig2mj.states.substances.model import NUM_POINTS, SubstanceModel
from ig2mj.states.substances.volume import CONTAINS
from ig2mj.states.world import ExtendedStates

THIN = 0.0015
"""m: half the thickness of a level."""

SHRINK = 0.96
"""Of a level's half sizes, so that it does not stand out of walls."""

FULL_BOX = 0.88
"""Share of its bounding rectangle from which a level is a rectangle, not an ellipse."""

STREAM_RADIUS = 0.004
"""m."""


@dataclasses.dataclass(frozen=True)
class Level:
    """The surface of a container's contents: half sizes along its axes (m), world pose, colour, and the container."""

    container: int
    pos: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    half: tuple[float, float]
    rectangle: bool
    rgb: tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Stream:
    """Points of a stream from its beginning down, m, world frame, and its colour."""

    points: Float[np.ndarray, "P 3"]
    rgb: tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Spots:
    """Points of one object that a substance covers: places and unit normals in the frames of `body`."""

    substance: str
    object: int
    body: np.ndarray
    pos: Float[np.ndarray, "P 3"]
    normal: Float[np.ndarray, "P 3"]
    radius: float
    rgb: tuple[float, float, float]


def mixed_colour(found: SubstanceModel, litres: Float[np.ndarray, "U"]) -> tuple[float, float, float]:
    """The colour of a mixture, by volume."""
    share = litres / max(float(litres.sum()), 1e-9)
    red, green, blue = (float(v) for v in share @ np.array([s.colour for s in found.substances]))
    return red, green, blue


def levels(model: StateModel, states: ExtendedStates, view: PhysicsView, world: int = 0) -> list[Level]:
    """The surfaces of contents, of containers that hold something."""
    found = model.substances
    if found is None:
        return []
    volume, made = np.asarray(states.volume)[world], list[Level]()
    for row in np.flatnonzero(volume.sum(-1) >= CONTAINS):
        body = found.containers.body[row]
        pos, quat = np.asarray(view.body_pos)[world, body], np.asarray(view.body_quat)[world, body]
        points = pos + np.asarray(quat_rotate(quat, found.containers.filling[row]))
        share = float(np.clip(volume[row].sum() / found.containers.litres[row], 0.02, 1.0))
        height = float(np.quantile(points[:, 2], share))
        distance = np.abs(points[:, 2] - height)
        near = points[distance <= np.sort(distance)[min(len(points) - 1, max(12, len(points) // 14))] + 1e-6, :2]
        turn, middle, half, area = _rectangle(near)
        axes = np.eye(3)
        axes[:2, :2] = turn
        colour = mixed_colour(found, volume[row])
        size = (float(SHRINK * half[0]), float(SHRINK * half[1]))
        made.append(Level(int(row), np.array([*middle, height]), axes, size, area > FULL_BOX, colour))
    return made


def _rectangle(points: Float[np.ndarray, "P 2"]) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """The least rectangle round points: axes as columns, middle, half sizes, and the share that their hull takes."""
    import scipy.spatial  # takes as long as all of this package

    try:
        covered = float(scipy.spatial.ConvexHull(points).volume)
    except scipy.spatial.QhullError:
        covered = 0.0
    best: tuple[float, np.ndarray, np.ndarray, np.ndarray] | None = None
    for angle in np.radians(np.arange(0, 90, 5)):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        local = points @ turn
        low, high = local.min(0), local.max(0)
        area = float(np.prod(high - low))
        if best is None or area < best[0] - 1e-9:
            best = area, turn, turn @ ((low + high) / 2), (high - low) / 2
    assert best is not None
    return best[1], best[2], best[3], covered / max(best[0], 1e-12)


def streams_of(model: StateModel, states: ExtendedStates, view: PhysicsView, world: int = 0) -> list[Stream]:
    """Streams of containers that hold more than they can as they stand, and of their sources."""
    found = model.substances
    if found is None or not len(found.containers.body):
        return []
    containers = found.containers
    volume, stock = np.asarray(states.volume)[world], np.asarray(states.stock)[world]
    free = np.where(np.asarray(states.solid)[world], 0.0, volume)
    openings = containers.openings(view)
    down = np.asarray(openings.normal[2])[world] < 0
    flows = (volume.sum(-1) > np.asarray(containers.holds(view))[world] + CONTAINS) & (free.sum(-1) > 0)
    gives = down & stock.any(-1)
    if not (flows | gives).any():
        return []
    low, high = np.asarray(view.aabb_low)[world], np.asarray(view.aabb_high)[world]
    begins = openings.lowest(), openings.outwards()
    starts, outs = (np.stack([np.asarray(n)[world] for n in vectors], axis=-1) for vectors in begins)
    made = []
    for row in np.flatnonzero(flows | gives):
        amount = np.where(stock[row], 1.0, 0.0) if gives[row] and not flows[row] else free[row]
        others = np.arange(len(low)) != containers.object[row]
        made.append(Stream(_fall(starts[row], outs[row], low[others], high[others]), mixed_colour(found, amount)))
    return made


def _fall(start: np.ndarray, out: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Points of a parabola down to where it enters a box."""
    points = []
    for time in np.linspace(0.0, 0.6, 16):
        aside = (streams.LIP + streams.SPEED * time) * out
        point = start + np.array([aside[0], aside[1], -streams.GRAVITY / 2 * time**2])
        points.append(point)
        if len(points) > 1 and np.any(np.all((point > low + 0.01) & (point < high), axis=1)):
            break
    return np.array(points)


def spots(model: StateModel, states: ExtendedStates, world: int = 0) -> list[Spots]:
    """What covers objects, but for dust and stains."""
    found = model.substances
    if found is None:
        return []
    bits, made = np.asarray(states.coat)[world], list[Spots]()
    for row, column in np.argwhere(bits > 0):
        here = (int(bits[row, column]) >> np.arange(NUM_POINTS)) & 1 > 0
        obj, kind = int(found.covered[row]), found.substances[column]
        size = float(np.median(model.tables.object_bbox[obj]))
        wide = 0.12 if kind.kind != "visual" else 0.08
        radius = float(np.clip(wide * size, 0.006, 0.12))
        body, pos, normal = found.body[row][here], found.pos[row][here], found.normal[row][here]
        made.append(Spots(kind.name, obj, body, pos, normal, radius, kind.colour))
    return made


def burning(states: ExtendedStates, extras: tuple[str, ...], world: int = 0) -> np.ndarray:
    """Objects on fire."""
    return np.flatnonzero(np.asarray(states.on_fire)[world]) if "on_fire" in extras else np.zeros(0, int)
