"""Where what flows out of containers and taps falls: into an opening, onto an object, or nowhere.

A stream leaves a rim outwards and falls. Its way is a parabola in three pieces, each a straight fall at the middle of
its piece (`ig2mj.geometry.first_fall`). The first opening that faces upwards or the first object decides. The
object that it comes from is not in its way.

Axes: W worlds, K streams, C containers, O objects, R corners of a rim, B bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.first_fall import FallPieces, Ways, first_met, least_of_all
from ig2mj.geometry.frames import Numbers, dot, numbers
from ig2mj.scene.tables import SceneTables
from ig2mj.states.substances.containers import Containers

MOST = 4
"""Streams that fall at a time in a world."""

GRAVITY = 9.8
"""m/s^2."""

SPEED = 0.2
"""m/s outwards with which a stream leaves a rim."""

LIP = 0.008
"""m outwards from the lowest corner of the rim at which it begins to fall."""

TIMES = (0.0, 0.1, 0.25)
"""s at which the pieces of the way begin."""

FALL = 3.0
"""m down to which a stream is followed."""

UPWARDS = 0.3
"""Least z of the normal of an opening that takes a stream."""

SLACK = 0.005
"""m by which an opening may lie below an object's surface and still be met first: the edge of its own rim."""


class Falling(NamedTuple):
    """What streams depend on.

    Attributes:
      active: there is a stream. start: m, world. aside: x and y of the unit vector outwards, or 0 for a tap. source:
        container that it comes from. origin: object that it comes from, -1: none.
    """

    active: Bool[Array, "W K"]
    start: Numbers
    aside: Numbers
    source: Bool[Array, "W K C"]
    origin: Int[Array, "W K"]


class Landed(NamedTuple):
    """Where streams end: in a container, or on an object (-1: on none) at a place (m, world);
    neither: nowhere."""

    container: Bool[Array, "W K C"]
    object: Int[Array, "W K"]
    pos: Numbers


DEPTHS = np.array([GRAVITY / 2 * t * t for t in TIMES] + [FALL], np.float32)
"""m below its begin at which each piece of the way begins, and where the last ends."""

ASIDE = np.array([LIP + SPEED * 0.5 * (a + b) for a, b in zip(TIMES, (*TIMES[1:], TIMES[-1]), strict=True)], np.float32)
"""m outwards of each piece of the way."""


def land(tables: SceneTables, containers: Containers, falling: Falling, view: PhysicsView) -> Landed:
    """Follows the streams of all worlds."""
    ways = Ways(falling.active, falling.start, falling.aside, falling.origin, ASIDE, DEPTHS)
    solid = first_met(FallPieces.of(tables), view.body_pos, view.body_quat, ways)
    opening = _openings_met(containers, falling, ways, view)  # [W, K, C]
    own = np.arange(opening.shape[-1], dtype=np.int32)
    (first_opening,), (entered,) = least_of_all([jnp.asarray(opening)], own)
    enters = falling.active & jnp.isfinite(first_opening) & (first_opening <= solid.depth + SLACK)
    meets = falling.active & ~enters & (solid.object >= 0)
    into = enters[..., None] & (entered[..., None] == own)
    depth = jnp.where(meets, solid.depth, 0.0)
    out = sum(jnp.where(depth >= d, more, 0.0) for d, more in zip(DEPTHS[1:-1], np.diff(ASIDE), strict=True)) + ASIDE[0]
    place = [*(falling.start[i] + out * falling.aside[i] for i in range(2)), falling.start[2] - depth]
    return Landed(into, jnp.where(meets, solid.object, -1), place)


def _openings_met(containers: Containers, falling: Falling, ways: Ways, view: PhysicsView) -> Float[Array, "W K C"]:
    """How deep each stream has fallen where it enters each opening; inf: it does not."""
    if not len(containers.body):
        return jnp.zeros((*falling.active.shape, 0))
    frames = containers.frames(view).with_axes(1)
    centre, normal = frames.points(numbers(containers.centre)), frames.turned(numbers(containers.normal))
    corners = containers.rim - containers.centre[:, None]  # [C, R, 3]
    edges = np.roll(corners, -1, axis=1) - corners
    outwards = np.cross(edges, np.broadcast_to(containers.normal[:, None], edges.shape))
    limit = np.sum(corners * outwards, axis=-1) + 1e-9
    faces = (normal[2] > UPWARDS) & ~falling.source
    found: Array = np.full(1, np.inf, np.float32)
    for line, above in enumerate(ways.depth[:-1]):
        start = ways.line(line)
        offset = [start[i] - centre[i] for i in range(3)]
        below = dot(offset, normal) / jnp.where(faces, normal[2], 1.0)  # how far down the plane is
        inside = faces & (below >= -1e-6) & (below <= float(ways.depth[line + 1] - above))
        local = frames.local([*offset[:2], offset[2] - below])  # from the centre
        for corner in range(outwards.shape[1]):
            inside &= dot(local, numbers(outwards[:, corner])) <= limit[:, corner]
        found = jnp.minimum(found, jnp.where(inside, below + float(above), jnp.inf))
    return jnp.asarray(found)
