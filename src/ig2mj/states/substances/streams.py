"""Where what flows out of containers and taps falls: into an opening, onto an object, or nowhere.

A stream leaves a rim outwards and falls. Its way is a parabola in three pieces, each a straight fall at the middle of
its piece (`ig2mj.geometry.first_fall`). The first opening that faces upwards or the first object decides. The
object that it comes from is not in its way.

Axes: W worlds, K streams, S = 3 pieces of the way, C containers, O objects, R corners of a rim, B bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.first_fall import FallPieces, Ways, first_met
from ig2mj.geometry.poses import quat_to_matrix
from ig2mj.scene.tables import SceneTables
from ig2mj.states.substances.containers import Containers, Openings

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
      active: there is a stream. start: m, world. aside: unit vector outwards, or 0 for a tap. source: container that it
        comes from. origin: object that it comes from, -1: none.
    """

    active: Bool[Array, "W K"]
    start: Float[Array, "W K 3"]
    aside: Float[Array, "W K 2"]
    source: Bool[Array, "W K C"]
    origin: Int[Array, "W K"]
    openings: Openings
    body_pos: Float[Array, "W B 3"]
    body_quat: Float[Array, "W B 4"]


class Landed(NamedTuple):
    """Where streams end: in a container, or on an object (-1: on none) at a place (m, world); neither: nowhere."""

    container: Bool[Array, "W K C"]
    object: Int[Array, "W K"]
    pos: Float[Array, "W K 3"]


def falling_from(
    active: Bool[Array, "W K"],
    start: Float[Array, "W K 3"],
    aside: Float[Array, "W K 2"],
    source: Bool[Array, "W K C"],
    origin: Int[Array, "W K"],
    openings: Openings,
    view: PhysicsView,
) -> Falling:
    """Streams in a view."""
    return Falling(
        active, start, aside, source, origin, openings, jnp.asarray(view.body_pos), jnp.asarray(view.body_quat)
    )


def land(tables: SceneTables, containers: Containers, falling: Falling) -> Landed:
    """Follows the streams of all worlds."""
    depths = np.array([GRAVITY / 2 * t * t for t in TIMES] + [FALL], np.float32)
    middles = np.array([0.5 * (a + b) for a, b in zip(TIMES, (*TIMES[1:], TIMES[-1]), strict=True)], np.float32)
    out = (LIP + SPEED * middles)[:, None] * falling.aside[:, :, None, :]
    pos = jnp.concatenate(
        [falling.start[:, :, None, :2] + out, falling.start[:, :, None, 2:] - depths[:-1, None]], axis=-1
    )  # [W, K, S, 3]
    lengths = jnp.broadcast_to(jnp.asarray(np.diff(depths)), pos.shape[:-1])
    ways = Ways(falling.active, pos, lengths, depths[:-1], falling.origin)
    solid = first_met(FallPieces.of(tables), falling.body_pos, falling.body_quat, ways)
    opening = _openings_met(containers, falling, pos, lengths, depths)  # [W, K, C]
    first_opening = jnp.min(opening, axis=-1, initial=jnp.inf)
    enters = falling.active & jnp.isfinite(first_opening) & (first_opening <= solid.depth + SLACK)
    meets = falling.active & ~enters & (solid.object >= 0)
    own = np.arange(opening.shape[-1])
    into = enters[..., None] & (jnp.argmin(opening, axis=-1)[..., None] == own) if len(own) else falling.source
    depth = jnp.where(meets, solid.depth, 0.0)
    piece = jnp.sum(depth[..., None] >= depths[1:-1], axis=-1)[..., None] == np.arange(len(TIMES))
    aside = jnp.sum(jnp.where(piece[..., None], pos[..., :2], 0.0), axis=2)
    place = jnp.concatenate([aside, falling.start[..., 2:] - depth[..., None]], axis=-1)
    return Landed(into, jnp.where(meets, solid.object, -1), place)


def _openings_met(
    containers: Containers,
    falling: Falling,
    pos: Float[Array, "W K S 3"],
    lengths: Float[Array, "W K S"],
    depths: Float[np.ndarray, "S1"],
) -> Float[Array, "W K C"]:
    """How deep each stream has fallen where it enters each opening; inf: it does not."""
    if not len(containers.body):
        return jnp.zeros((*pos.shape[:2], 0))
    centre, normal = falling.openings.centre[:, None, None], falling.openings.normal[:, None, None]  # [W, 1, 1, C, 3]
    at = pos[:, :, :, None]
    faces = normal[..., 2] > UPWARDS
    offset = at - centre
    below = jnp.sum(offset * normal, axis=-1) / jnp.where(faces, normal[..., 2], 1.0)  # how far down the plane is
    crosses = faces & (below >= -1e-6) & (below <= lengths[..., None])
    hit = [offset[..., 0], offset[..., 1], offset[..., 2] - below]  # from the centre, world axes
    axes = quat_to_matrix(falling.body_quat[:, containers.body])[:, None, None]
    local = [sum(axes[..., i, j] * hit[i] for i in range(3)) for j in range(3)]
    corners = containers.rim - containers.centre[:, None]  # [C, R, 3]
    edges = np.roll(corners, -1, axis=1) - corners
    outwards = np.cross(edges, np.broadcast_to(containers.normal[:, None], edges.shape))
    limit = np.sum(corners * outwards, axis=-1) + 1e-9
    inside = crosses & ~falling.source[:, :, None]
    for corner in range(outwards.shape[1]):  # a few products each: no product of matrices
        inside &= sum(local[i] * outwards[:, corner, i] for i in range(3)) <= limit[:, corner]
    return jnp.min(jnp.where(inside, below + depths[:-1, None], jnp.inf), axis=2)
