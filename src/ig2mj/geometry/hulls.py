"""Points against convex pieces: signed distance, support points of their cores. Metres.

Pieces are described as in `SceneTables.piece_*`, in their own frames: capsules and cylinders along z, `size` is
MuJoCo's geom_size, half-spaces (n, d) with n.x <= d. Distances between two pieces are in `ig2mj.geometry.gjk`.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ig2mj.geometry.poses import AnyArray, length, namespace, normalize
from ig2mj.scene.tables import PieceKind


def signed_depth(
    kind: Int[AnyArray, "*#b"],
    size: Float[AnyArray, "*#b 3"],
    planes: Float[AnyArray, "*#b N 4"],
    point: Float[AnyArray, "*#b 3"],
) -> Float[AnyArray, "*b"]:
    """How deep a point lies in a piece, in the piece's frame: positive inside, negative outside.

    Inside it is the distance to the surface. Outside it is exact (the negative distance) for round pieces; for
    polyhedra it is the negative distance from the farthest violated face's plane, which underestimates the distance
    where an edge or a corner is nearest (`ig2mj.geometry.gjk.pair_distance` is exact there).
    """
    xp = namespace(size, planes, point)
    radius, half = size[..., 0], size[..., 1]
    height = xp.abs(point[..., 2])
    from_axis = length(point[..., :2])
    from_end = xp.stack(xp.broadcast_arrays(from_axis, xp.maximum(height - half, 0.0)), axis=-1)
    side, end = radius - from_axis, half - height
    corner = length(xp.stack(xp.broadcast_arrays(xp.maximum(-side, 0.0), xp.maximum(-end, 0.0)), axis=-1))
    cylinder = xp.where((side >= 0.0) & (end >= 0.0), xp.minimum(side, end), -corner)
    room = planes[..., 3] - xp.sum(planes[..., :3] * point[..., None, :], axis=-1)
    in_use = xp.any(planes[..., :3] != 0.0, axis=-1)
    polyhedron = xp.min(xp.where(in_use, room, xp.inf), axis=-1, initial=xp.inf)
    return xp.select(
        [kind == k for k in (PieceKind.SPHERE, PieceKind.CAPSULE, PieceKind.CYLINDER)],
        [radius - length(point), radius - length(from_end), cylinder],
        polyhedron,
    )


def core_radius(kind: Int[AnyArray, "*#b"], size: Float[AnyArray, "*#b 3"]) -> Float[Array, "*b"]:
    """Radius of the ball that, swept over the core, gives the piece: that of spheres and capsules, else 0."""
    return jnp.where((kind == PieceKind.SPHERE) | (kind == PieceKind.CAPSULE), size[..., 0], 0.0)


def core_support(
    kind: Int[AnyArray, "*#b"],
    size: Float[AnyArray, "*#b 3"],
    vertices: Float[AnyArray, "*#b V 3"],
    direction: Float[AnyArray, "*#b 3"],
) -> Float[Array, "*b 3"]:
    """Farthest point of the core: a sphere's centre, a capsule's axis, the whole of cylinders and polyhedra.

    `kind` as a numpy array spares the kinds that do not occur.
    """
    present = set(PieceKind) if isinstance(kind, Array) else {PieceKind(k) for k in np.unique(kind)}
    shape = jnp.broadcast_shapes(kind.shape, size.shape[:-1], vertices.shape[:-2], direction.shape[:-1])
    point = jnp.zeros((*shape, 3))
    if PieceKind.POLYHEDRON in present:
        height = jnp.sum(vertices * direction[..., None, :], axis=-1)
        best = jnp.argmax(height, axis=-1)[..., None, None]
        corner = jnp.take_along_axis(jnp.broadcast_to(vertices, (*best.shape[:-2], *vertices.shape[-2:])), best, -2)
        point = jnp.where((kind == PieceKind.POLYHEDRON)[..., None], corner[..., 0, :], point)
    if present & {PieceKind.CAPSULE, PieceKind.CYLINDER}:
        end = jnp.where(direction[..., 2] >= 0.0, size[..., 1], -size[..., 1])
        rim = normalize(direction[..., :2]) * jnp.where(kind == PieceKind.CYLINDER, size[..., 0], 0.0)[..., None]
        along = jnp.concatenate(jnp.broadcast_arrays(rim[..., :1], rim[..., 1:], end[..., None]), axis=-1)
        point = jnp.where(((kind == PieceKind.CAPSULE) | (kind == PieceKind.CYLINDER))[..., None], along, point)
    return point
