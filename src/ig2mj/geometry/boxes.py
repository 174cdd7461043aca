"""Axis-aligned boxes: of posed pieces, of objects, and what can be asked of them. Metres, world axes.

Two rules give an object's box. Tight: the smallest box around its pieces. iGibson's: per link the box of the link's
whole shape in the link's frame, turned into the world (a box around a turned box, so it is looser), plus Bullet's
margin (spec/states.md 4.2 and section 24).

An object without pieces has the empty box, low = inf and high = -inf: no point is in it and its gap to any box is inf.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ig2mj.geometry.poses import AnyArray, length, quat_rotate, quat_to_matrix
from ig2mj.scene.tables import PieceKind

Boxes = tuple[Float[Array, "*b 3"], Float[Array, "*b 3"]]

BULLET_MARGIN_SINGLE, BULLET_MARGIN_COMPOUND = 0.003, 0.004
"""Metres by which pybullet's box stands off one hull, and off a compound of hulls (spec/states.md section 24)."""


def piece_boxes(
    kind: Int[AnyArray, "*#b"],
    size: Float[AnyArray, "*#b 3"],
    vertices: Float[AnyArray, "*#b V 3"],
    pos: Float[AnyArray, "*#b 3"],
    quat: Float[AnyArray, "*#b 4"],
) -> Boxes:
    """Smallest boxes (low, high) around posed pieces; `vertices` count for polyhedra only."""
    turned = quat_rotate(quat[..., None, :], vertices)
    low, high = jnp.min(turned, axis=-2), jnp.max(turned, axis=-2)
    reach = _round_reach(kind, size, quat)
    hull = (kind == PieceKind.POLYHEDRON)[..., None]
    return jnp.add(pos, jnp.where(hull, low, -reach)), jnp.add(pos, jnp.where(hull, high, reach))


def rotated_boxes(
    center: Float[AnyArray, "*#b 3"],
    half: Float[AnyArray, "*#b 3"],
    pos: Float[AnyArray, "*#b 3"],
    quat: Float[AnyArray, "*#b 4"],
    margin: Float[AnyArray, "*#b"] | float = 0.0,
) -> Boxes:
    """Boxes (low, high) around local boxes that are posed in the world; `margin` is added on every side."""
    middle = jnp.add(pos, quat_rotate(quat, center))
    reach = jnp.sum(jnp.abs(quat_to_matrix(quat)) * half[..., None, :], axis=-1) + jnp.asarray(margin)[..., None]
    return middle - reach, middle + reach


def link_boxes(
    piece_body: Int[np.ndarray, "K"],
    piece_kind: Int[np.ndarray, "K"],
    piece_size: Float[np.ndarray, "K 3"],
    piece_vertices: Float[np.ndarray, "K V 3"],
    piece_pos: Float[np.ndarray, "K 3"],
    piece_quat: Float[np.ndarray, "K 4"],
) -> tuple[Int[np.ndarray, "N"], Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"], Float[np.ndarray, "N"]]:
    """iGibson's local boxes, one for each body that has pieces: (body, centre, half size, Bullet's margin).

    Host side, once per scene; `rotated_boxes` turns them into world boxes. Poses of pieces are those in their bodies.
    """
    low, high = (np.asarray(a) for a in piece_boxes(piece_kind, piece_size, piece_vertices, piece_pos, piece_quat))
    body, group, count = np.unique(piece_body, return_inverse=True, return_counts=True)
    box_low, box_high = np.full((len(body), 3), np.inf, np.float32), np.full((len(body), 3), -np.inf, np.float32)
    np.minimum.at(box_low, group, low)
    np.maximum.at(box_high, group, high)
    margin = np.where(count > 1, BULLET_MARGIN_COMPOUND, BULLET_MARGIN_SINGLE).astype(np.float32)
    return body, (box_low + box_high) / 2, (box_high - box_low) / 2, margin


def union_boxes(
    low: Float[AnyArray, "*b K 3"], high: Float[AnyArray, "*b K 3"], owner: Int[np.ndarray, "K"], num_owners: int
) -> tuple[Float[Array, "*b O 3"], Float[Array, "*b O 3"]]:
    """Boxes around all boxes of each owner; `owner` is known before tracing and -1 belongs to nobody."""
    members = [np.flatnonzero(owner == o) for o in range(num_owners)]
    slots = np.full((num_owners, max((len(m) for m in members), default=0)), len(owner))
    for row, m in zip(slots, members, strict=True):
        row[: len(m)] = m
    nobody = jnp.full((*low.shape[:-2], 1, 3), jnp.inf)
    return (
        jnp.min(jnp.concatenate([low, nobody], axis=-2)[..., slots, :], axis=-2, initial=jnp.inf),
        jnp.max(jnp.concatenate([high, -nobody], axis=-2)[..., slots, :], axis=-2, initial=-jnp.inf),
    )


def point_in_box(
    point: Float[AnyArray, "*#b 3"], low: Float[AnyArray, "*#b 3"], high: Float[AnyArray, "*#b 3"]
) -> Bool[Array, "*b"]:
    """Whether the point is in the box, its faces included. False for NaN."""
    return jnp.all((point >= low) & (point <= high), axis=-1)


def box_gap(
    low_a: Float[AnyArray, "*#b 3"],
    high_a: Float[AnyArray, "*#b 3"],
    low_b: Float[AnyArray, "*#b 3"],
    high_b: Float[AnyArray, "*#b 3"],
) -> Float[Array, "*b"]:
    """Distance of two boxes: the length of the gaps along the axes, 0 where they overlap (spec/states.md 5.5)."""
    gap = jnp.maximum(low_a, low_b) - jnp.minimum(high_a, high_b)
    endless = gap == jnp.inf  # of an empty box; kept out of the square root for its gradient
    distance = length(jnp.maximum(jnp.where(endless, 0.0, gap), 0.0))
    return jnp.where(jnp.any(endless, axis=-1), jnp.inf, distance)


def point_box_distance(
    point: Float[AnyArray, "*#b 3"], low: Float[AnyArray, "*#b 3"], high: Float[AnyArray, "*#b 3"]
) -> Float[Array, "*b"]:
    """Distance of a point from a box, 0 inside, inf for the empty box."""
    return box_gap(point, point, low, high)


def box_corners(low: Float[AnyArray, "*#b 3"], high: Float[AnyArray, "*#b 3"]) -> Float[Array, "*b 8 3"]:
    """The eight corners, x changing slowest."""
    upper = np.array([[(i >> 2) & 1, (i >> 1) & 1, i & 1] for i in range(8)], bool)
    return jnp.where(upper, high[..., None, :], low[..., None, :])


def _round_reach(
    kind: Int[AnyArray, "*#b"], size: Float[AnyArray, "*#b 3"], quat: Float[AnyArray, "*#b 4"]
) -> Float[Array, "*b 3"]:
    """Half extent along the world axes of spheres, capsules and cylinders (0 for polyhedra)."""
    axis = quat_to_matrix(quat)[..., :, 2]
    radius, half = size[..., 0, None], size[..., 1, None]
    across = jnp.maximum(1.0 - axis * axis, 0.0)
    flat = jnp.sqrt(jnp.where(across > 0.0, across, 1.0)) * (across > 0.0)
    return jnp.select(
        [(kind == k)[..., None] for k in (PieceKind.SPHERE, PieceKind.CAPSULE, PieceKind.CYLINDER)],
        [jnp.broadcast_to(radius, axis.shape), jnp.abs(axis) * half + radius, jnp.abs(axis) * half + flat * radius],
        0.0,
    )
