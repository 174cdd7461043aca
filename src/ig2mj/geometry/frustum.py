"""What a camera may see: view frusta against points, boxes and pieces, and whether sight is free.

Camera axes are MuJoCo's: -z forward, y up, x to the right. `fovy` is the vertical opening angle in radians, `aspect`
width over height; only what lies between the planes at `near` and `far` (metres, along the view) is in view. Surfaces
of the frustum belong to it. NaN is never in view.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Array, Bool, Float, Int

from ig2mj.geometry.gjk import PosedPieces, piece_distance
from ig2mj.geometry.hulls import bounding_radius
from ig2mj.geometry.poses import (
    AnyArray,
    inverse_transform_points,
    quat_to_matrix,
    transform_points,
)
from ig2mj.geometry.rays import rays_hit_pieces
from ig2mj.scene.tables import PieceKind

BLOCKING = 0.999
"""Share of the way to a point within which something stands in front of it: a point on a surface does not hide itself
behind that surface by rounding."""


@struct.dataclass
class Camera:
    """Cameras; leading axes are the batch (worlds, agents, ...).

    Attributes:
      pos, quat: pose of the eye in the world. fovy: radians. aspect: width over height. near, far: metres.
    """

    pos: Float[AnyArray, "*b 3"]
    quat: Float[AnyArray, "*b 4"]
    fovy: Float[AnyArray, "*#b"] | float
    aspect: Float[AnyArray, "*#b"] | float = 1.0
    near: Float[AnyArray, ""] | float = 0.01
    far: Float[AnyArray, ""] | float = 100.0

    @property
    def slopes(self) -> Float[Array, "*#b 2"]:
        """Half width and half height of the view at distance 1."""
        up = jnp.tan(0.5 * jnp.asarray(self.fovy))
        return jnp.stack(jnp.broadcast_arrays(up * self.aspect, up), axis=-1)


def frustum_corners(camera: Camera) -> Float[Array, "*b 8 3"]:
    """Corners in the world frame: four near ones, then four far ones."""
    shape = camera.pos.shape[:-1]
    local = _corners(camera.slopes, jnp.full(shape, camera.near), jnp.full(shape, camera.far))
    return transform_points(camera.pos, camera.quat, local)


def points_in_frustum(camera: Camera, points: Float[AnyArray, "*#b n 3"]) -> Bool[Array, "*b n"]:
    """Which of `n` world points per camera are in view, hidden or not."""
    local = inverse_transform_points(camera.pos, camera.quat, points)
    depth = -local[..., 2]
    reach = camera.slopes[..., None, :] * depth[..., None]
    return (depth >= camera.near) & (depth <= camera.far) & jnp.all(jnp.abs(local[..., :2]) <= reach, axis=-1)


def boxes_in_frustum(
    camera: Camera, low: Float[AnyArray, "*#b n 3"], high: Float[AnyArray, "*#b n 3"]
) -> Bool[Array, "*b n"]:
    """Which of `n` world boxes per camera have a point in common with the view. Exact, by separating axes.

    Two convex polyhedra are apart only if they are so along the normal of a face of one of them or along the product
    of an edge of each: 3 axes of the box, 5 of the frustum, 3 x 6 products.
    """
    middle, half = (low + high) / 2, (high - low) / 2  # NaN for the empty box, which is nowhere
    corners = frustum_corners(camera)
    turn = quat_to_matrix(camera.quat)
    right, up, forward = turn[..., :, 0], turn[..., :, 1], -turn[..., :, 2]
    across, upright = camera.slopes[..., :1], camera.slopes[..., 1:]
    edges = [right, up, *(forward + sx * across * right + sy * upright * up for sx in (-1, 1) for sy in (-1, 1))]
    sides = [right - across * forward, -right - across * forward, up - upright * forward, -up - upright * forward]
    of_box = [jnp.broadcast_to(np.eye(3, dtype=np.float32)[i], right.shape) for i in range(3)]
    products = [jnp.cross(e, b) for e in edges for b in of_box]
    axes = jnp.stack([*of_box, forward, *sides, *products], axis=-2)  # [*b, 26, 3]
    spread = jnp.einsum("...ax,...cx->...ac", axes, corners - camera.pos[..., None, :])
    offset = middle - camera.pos[..., None, :]
    at = jnp.einsum("...ax,...nx->...na", axes, offset)
    reach = jnp.einsum("...ax,...nx->...na", jnp.abs(axes), half)
    lowest, highest = jnp.min(spread, axis=-1)[..., None, :], jnp.max(spread, axis=-1)[..., None, :]
    return jnp.all((at + reach >= lowest) & (at - reach <= highest), axis=-1)


def pieces_in_frustum(camera: Camera, pieces: PosedPieces) -> Bool[Array, "*b n"]:
    """Which of `n` pieces per camera have a point in common with the view, hidden or not. Exact, by GJK.

    `pieces` has the axes [*b, n] (or fewer, then the same for every camera). Of the view only the slab that the
    piece's bounding ball spans is looked at, so that a far plane 100 m away costs no accuracy.
    """
    eye, turn = jnp.asarray(camera.pos)[..., None, :], jnp.asarray(camera.quat)[..., None, :]
    depth = -inverse_transform_points(camera.pos, camera.quat, jnp.asarray(pieces.pos))[..., 2]
    radius = bounding_radius(pieces.kind, pieces.size, pieces.vertices)
    near, far = jnp.maximum(depth - radius, camera.near), jnp.minimum(depth + radius, camera.far)
    view = PosedPieces(
        kind=np.array(PieceKind.POLYHEDRON),
        size=np.zeros(3, np.float32),
        vertices=_corners(camera.slopes[..., None, :], near, jnp.maximum(near, far)),
        pos=eye,
        quat=turn,
    )
    return (near <= far) & piece_distance(pieces, view).overlap


def points_in_sight(
    camera: Camera,
    points: Float[AnyArray, "*#b n 3"],
    piece_pos: Float[AnyArray, "*#b K 3"],
    piece_quat: Float[AnyArray, "*#b K 4"],
    piece_kind: Int[np.ndarray, "K"],
    piece_size: Float[np.ndarray, "K 3"],
    piece_planes: Float[np.ndarray, "K N 4"],
    see_through: Bool[AnyArray, "*#b K"] | None = None,
) -> Bool[Array, "*b n"]:
    """Which points are in view and hidden by no piece.

    A piece hides a point if the ray from the eye enters it before the point; a piece the eye is inside of hides
    nothing. The points may be a sample of an object's surface (`ig2mj.geometry.surface`): its own front then hides
    its back. `see_through` marks pieces that hide nothing. Memory is b x n x K numbers.
    """
    eye = jnp.asarray(camera.pos)[..., None, :]
    sight = points - eye
    entered = rays_hit_pieces(
        jnp.broadcast_to(eye, sight.shape),
        sight,
        jnp.full(sight.shape[:-1], BLOCKING),
        piece_pos,
        piece_quat,
        piece_kind,
        piece_size,
        piece_planes,
    )
    hides = entered < jnp.inf
    if see_through is not None:
        hides &= ~see_through[..., None, :]
    return points_in_frustum(camera, points) & ~jnp.any(hides, axis=-1)


def _corners(
    slopes: Float[Array, "*#b 2"], near: Float[Array, "*#b"], far: Float[Array, "*#b"]
) -> Float[Array, "*b 8 3"]:
    """Corners of the view between two depths, in camera axes."""
    signs = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)], np.float32)
    rim = slopes[..., None, :] * signs
    square = jnp.concatenate([rim, -jnp.ones_like(rim[..., :1])], axis=-1)
    return jnp.concatenate([square * near[..., None, None], square * far[..., None, None]], axis=-2)
