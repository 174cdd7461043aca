"""Where rays enter pieces, one piece after the other: what planned computations are compared with."""

from __future__ import annotations

import jax.numpy as jnp

from ig2mj.geometry.poses import quat_rotate_inverse
from ig2mj.geometry.rays import piece_interval


def rays_hit_pieces(
    origins, directions, lengths, piece_pos, piece_quat, piece_kind, piece_size, piece_planes, inflate=0.0
):
    """Entry parameter t [..., R, K] of every ray into every piece; inf where it does not enter within its length.

    Args:
      origins, directions: [..., R, 3]. lengths: [..., R]. piece_pos, piece_quat: world poses [..., K, 3], [..., K, 4].
      piece_kind, piece_size, piece_planes: as in `SceneTables`.
    """
    origin = quat_rotate_inverse(piece_quat[..., None, :, :], origins[..., :, None, :] - piece_pos[..., None, :, :])
    direction = quat_rotate_inverse(piece_quat[..., None, :, :], directions[..., :, None, :])
    low, high = piece_interval(piece_kind, piece_size, piece_planes, origin, direction, inflate)
    return jnp.where(enters(low, high, lengths[..., :, None]), low, jnp.inf)


def enters(low, high, length):
    """Whether the ray along the line's direction enters the shape at 0 <= t <= length; from inside it does not."""
    return jnp.logical_and(low >= 0.0, (low <= length) & (low <= high))
