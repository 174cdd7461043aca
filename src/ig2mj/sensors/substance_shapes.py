"""Where substances are seen in one world: levels of contents, streams, what covers objects, flames. On the host.

Levels are those of `ig2mj.sensors.content_levels`. A stream is a chain of points from the lowest place of the rim down
to the first box or the floor below. Viewers draw them (`ig2mj.viewer.substance_marks`); for cameras there is
`ig2mj.sensors.substance_slots`.

Axes: N shapes, P points.
"""

from __future__ import annotations

import dataclasses
import functools

import jax
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import PhysicsView
from ig2mj.sensors import content_levels
from ig2mj.sensors.substance_slots import spot_radii
from ig2mj.states.model import StateModel
from ig2mj.states.substances import streams
from ig2mj.states.substances.model import NUM_POINTS, SubstanceModel
from ig2mj.states.substances.volume import CONTAINS
from ig2mj.states.world import ExtendedStates


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
    if model.substances is None or not len(model.substances.containers.body):
        return []
    found = jax.tree.map(lambda x: np.asarray(x)[world], _levels(model)(states, view))
    flat = content_levels.rectangles(model)
    return [
        Level(
            container=int(row),
            pos=found.pos[row],
            axes=found.axes[row],
            half=(float(found.half[row, 0]), float(found.half[row, 1])),
            rectangle=bool(flat[row]),
            rgb=(float(found.rgb[row, 0]), float(found.rgb[row, 1]), float(found.rgb[row, 2])),
        )
        for row in np.flatnonzero(found.there)
    ]


@functools.lru_cache(maxsize=8)
def _levels(model: StateModel):
    return jax.jit(functools.partial(content_levels.levels, model))


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
    bits, radii, made = np.asarray(states.coat)[world], spot_radii(model), list[Spots]()
    for row, column in np.argwhere(bits > 0):
        here = (int(bits[row, column]) >> np.arange(NUM_POINTS)) & 1 > 0
        obj, kind = int(found.covered[row]), found.substances[column]
        body, pos, normal = found.body[row][here], found.pos[row][here], found.normal[row][here]
        made.append(Spots(kind.name, obj, body, pos, normal, float(radii[row, column]), kind.colour))
    return made


def burning(states: ExtendedStates, extras: tuple[str, ...], world: int = 0) -> np.ndarray:
    """Objects on fire."""
    return np.flatnonzero(np.asarray(states.on_fire)[world]) if "on_fire" in extras else np.zeros(0, int)
