"""Axis-aligned boxes: the two rules that give an object's box, and what can be asked of boxes. Metres, world axes.

Tight: the smallest box around the object's pieces (`core_boxes`). iGibson's: per link the box of the link's whole shape
in the link's frame, widened by Bullet's margin (`link_boxes`, made once), and then turned into the world, which makes
it looser (`turned_boxes`; iGibson's aabb.py).

`core_boxes` takes NumPy arrays, `core_reaches` JAX ones; `turned_boxes` takes both and returns what it is
given.

An object without pieces has the empty box, low = inf and high = -inf: no point is in it and its gap to any box is inf.

Axes: K pieces, V points of the largest, N links, W worlds.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ig2mj.geometry.poses import AnyArray, length, matrices_on_host
from ig2mj.scene.tables import PieceKind

Boxes = tuple[Float[AnyArray, "*b K 3"], Float[AnyArray, "*b K 3"]]

BULLET_MARGIN_SINGLE, BULLET_MARGIN_COMPOUND = 0.003, 0.004
"""Metres by which pybullet's box stands off one hull, and off a compound of hulls (measured in PyBullet)."""

EDGE_ON = 1e-14
"""Of the squared sine of the angle between a cylinder's axis and a world axis: below, the gradient is cut to 0."""

OUTWARDS = np.array([-1.0, 1.0], np.float32)[:, None, None, None, None]
"""Directions of a box's sides along an axis, in front of axes 3 3 K W."""


def piece_cores(
    kind: Int[np.ndarray, "K"],
    size: Float[np.ndarray, "K 3"],
    vertices: Float[np.ndarray, "K V 3"],
    pos: Float[np.ndarray, "K 3"],
    quat: Float[np.ndarray, "K 4"],
) -> tuple[Float[np.ndarray, "K 3 V"], Float[np.ndarray, "K 1"], Float[np.ndarray, "K 3"]]:
    """What `core_boxes` needs of pieces that are posed in a frame, a body's for instance: (points, radius, axis).

    Points are a polyhedron's vertices, or the ends of a round piece's axis. `radius` is 0 for polyhedra; `axis` is the
    unit vector along a cylinder, and zero for everything else. Host side, once per scene.
    """
    rotation = matrices_on_host(quat)
    local = np.array(vertices, np.float64)
    round_piece = kind != PieceKind.POLYHEDRON
    half = np.where(kind == PieceKind.SPHERE, 0.0, size[:, 1])
    ends = np.zeros((int(round_piece.sum()), *local.shape[1:]))
    ends[:, :, 2] = np.where(np.arange(local.shape[1]) % 2, 1.0, -1.0) * half[round_piece, None]
    local[round_piece] = ends
    points = rotation @ local.transpose(0, 2, 1) + np.asarray(pos)[..., None]
    radius = np.where(round_piece, size[:, 0], 0.0)[:, None]
    return points, radius, np.where((kind == PieceKind.CYLINDER)[:, None], rotation[:, :, 2], 0.0)


def core_boxes(
    rotation: Float[np.ndarray, "*b K 3 3"],
    points: Float[np.ndarray, "K 3 V"],
    radius: Float[np.ndarray, "K 1"] | None,
    axis: Float[np.ndarray, "K 3"],
) -> tuple[Float[np.ndarray, "*b K 3"], Float[np.ndarray, "*b K 3"]]:
    """The tight rule: boxes (low, high) about the origin of each piece's frame, which `rotation` turns into the world.

    `radius` None says that no piece is round.
    """
    turned = rotation @ points
    low, high = turned.min(-1), turned.max(-1)
    if radius is None:
        return low, high
    along = (rotation @ axis[..., None])[..., 0]
    reach = radius * np.sqrt(np.maximum(1.0 - along * along, EDGE_ON))
    return low - reach, high + reach


def core_reaches(
    rotation: Float[Array, "3 3 K W"],
    points: Float[AnyArray, "K 3 V"],
    radius: Float[AnyArray, "K 1"] | None,
    axis: Float[AnyArray, "K 3"],
) -> Float[Array, "2 3 K W"]:
    """`core_boxes` in JAX, with worlds last: how far pieces reach against (-low) and along (high) the world's axes.

    For GPUs: one kernel in which each thread goes through a piece's points, next to threads that read neighbouring
    numbers. Both sides are one maximum, since XLA stores what a minimum and a maximum share: of 585 pieces with 32
    points those were 225 kB a world. Gradients are finite, also of an upright cylinder.
    """
    points = jax.lax.optimization_barrier(jnp.asarray(points, rotation.dtype))  # one array, not a constant a point
    outwards = jnp.asarray(OUTWARDS) * rotation

    def turned(v: int) -> Float[Array, "2 3 K W"]:
        x, y, z = (outwards[:, :, i] * points[:, i, v, None] for i in range(3))
        return x + y + z

    reach = turned(0)
    for v in range(1, points.shape[-1]):
        reach = jnp.maximum(reach, turned(v))
    if radius is None:
        return reach
    x, y, z = (rotation[:, i] * axis[:, i, None] for i in range(3))
    along = x + y + z
    return reach + jnp.asarray(radius) * jnp.sqrt(jnp.maximum(1.0 - along * along, EDGE_ON))


def turned_boxes(
    rotation: Float[AnyArray, "*b K 3 3"],
    center: Float[AnyArray, "K 3"],
    half: Float[AnyArray, "K 3"],
) -> Boxes:
    """iGibson's rule: boxes (low, high) around turned local boxes, about their frames' origins.

    Bullet turns half extents and margin together, |R| (half + margin) (iGibson's aabb.py): `half` includes the margin.
    """
    middle = (rotation @ center[..., None])[..., 0]
    reach = (abs(rotation) @ half[..., None])[..., 0]
    return middle - reach, middle + reach


def turned_reaches(
    rotation: Float[Array, "3 3 K W"], center: Float[AnyArray, "K 3"], half: Float[AnyArray, "K 3"]
) -> Float[Array, "2 3 K W"]:
    """`turned_boxes` as `core_reaches` gives the tight rule's."""
    x, y, z = (rotation[:, i] * center[:, i, None] for i in range(3))
    u, v, w = (abs(rotation[:, i]) * half[:, i, None] for i in range(3))
    return jnp.asarray(OUTWARDS[:, 0] * (x + y + z) + (u + v + w))


def link_boxes(
    body: Int[np.ndarray, "K"],
    points: Float[np.ndarray, "K 3 V"],
    radius: Float[np.ndarray, "K 1"],
    axis: Float[np.ndarray, "K 3"],
) -> tuple[Int[np.ndarray, "N"], Float[np.ndarray, "N 3"], Float[np.ndarray, "N 3"]]:
    """iGibson's local boxes, one for each body that has pieces: (body, centre, half size with Bullet's margin).

    Arguments as `piece_cores` gives them for pieces posed in their bodies. Host side, once per scene.
    """
    low, high = core_boxes(np.broadcast_to(np.eye(3), (len(body), 3, 3)), points, radius, axis)
    bodies, group, count = np.unique(body, return_inverse=True, return_counts=True)
    box_low, box_high = np.full((len(bodies), 3), np.inf), np.full((len(bodies), 3), -np.inf)
    np.minimum.at(box_low, group, low)
    np.maximum.at(box_high, group, high)
    margin = np.where(count > 1, BULLET_MARGIN_COMPOUND, BULLET_MARGIN_SINGLE)[:, None]
    return bodies, (box_low + box_high) / 2, (box_high - box_low) / 2 + margin


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
    """Distance of two boxes: the length of the gaps along the axes, 0 where they overlap (iGibson's next_to.py)."""
    gap = jnp.maximum(low_a, low_b) - jnp.minimum(high_a, high_b)
    endless = gap == jnp.inf  # of an empty box; kept out of the square root for its gradient
    distance = length(jnp.maximum(jnp.where(endless, 0.0, gap), 0.0))
    return jnp.where(jnp.any(endless, axis=-1), jnp.inf, distance)
