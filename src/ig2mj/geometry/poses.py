"""Rotations and poses: quaternions w,x,y,z, positions in metres, angles in radians.

Every function broadcasts over leading axes (`*b`). A pose is a pair (position, quaternion) that maps points of the
child frame into the parent frame. Quaternions are taken to be of unit length unless a docstring says otherwise.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

AnyArray = Array | np.ndarray
Quat = Float[AnyArray, "*#b 4"]
Vec = Float[AnyArray, "*#b 3"]

TINY = 1e-20


def namespace(*arrays: Any) -> ModuleType:
    """NumPy where all arrays are NumPy's, else `jax.numpy`: one formula for the host and for batches."""
    return np if all(isinstance(a, np.ndarray) for a in arrays) else jnp


def normalize(v: Float[AnyArray, "*b d"]) -> Float[Array, "*b d"]:
    """Vector of unit length along `v`; zero stays zero, with a finite gradient there."""
    square = jnp.sum(jnp.square(v), axis=-1, keepdims=True)
    usable = ~(square <= TINY)  # true for NaN, which shall stay visible
    return jnp.where(usable, v / jnp.sqrt(jnp.where(usable, square, 1.0)), 0.0)


def length(v: Float[AnyArray, "*b d"]) -> Float[AnyArray, "*b"]:
    """Euclidean length; its gradient at zero is zero rather than NaN."""
    xp = namespace(v)
    square = xp.sum(xp.square(v), axis=-1)
    usable = ~(square <= TINY)
    return xp.where(usable, xp.sqrt(xp.where(usable, square, 1.0)), 0.0)


def quat_normalize(q: Quat) -> Float[Array, "*b 4"]:
    """Quaternion of unit length; a zero quaternion becomes the identity."""
    zero = jnp.sum(jnp.square(q), axis=-1, keepdims=True) <= TINY
    return jnp.where(zero, np.array([1.0, 0.0, 0.0, 0.0], np.float32), normalize(q))


def quat_conjugate(q: Quat) -> Float[Array, "*b 4"]:
    """Inverse rotation."""
    return jnp.multiply(q, np.array([1.0, -1.0, -1.0, -1.0], np.float32))


def quat_multiply(a: Quat, b: Quat) -> Float[Array, "*b 4"]:
    """The rotation that turns by `b` first and by `a` then."""
    aw, ax, ay, az = (a[..., i] for i in range(4))
    bw, bx, by, bz = (b[..., i] for i in range(4))
    return jnp.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def quat_rotate(q: Quat, v: Vec) -> Float[Array, "*b 3"]:
    """`v` turned by `q`."""
    w, u = q[..., :1], q[..., 1:]
    twice = 2.0 * jnp.cross(u, v)
    return jnp.add(v, w * twice) + jnp.cross(u, twice)


def quat_rotate_inverse(q: Quat, v: Vec) -> Float[Array, "*b 3"]:
    """`v` turned by the inverse of `q`: a world vector seen from the frame `q`."""
    return quat_rotate(quat_conjugate(q), v)


def quat_to_matrix(q: Quat) -> Float[Array, "*b 3 3"]:
    """Rotation matrix whose columns are the child's axes in the parent frame."""
    rows = matrix_rows(*(q[..., i] for i in range(4)))
    return jnp.stack([jnp.stack(row, axis=-1) for row in rows], axis=-2)


def quats_to_matrices(q: Float[Array, "n 4 W"]) -> Float[Array, "3 3 n W"]:
    """`quat_to_matrix` with worlds last."""
    return jnp.stack([jnp.stack(row) for row in matrix_rows(*(q[:, i] for i in range(4)))])


def matrix_rows(w: AnyArray, x: AnyArray, y: AnyArray, z: AnyArray) -> list[list[Any]]:
    """Of one rotation, too, whose entries are numbers."""
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def matrices_on_host(q: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 3 3"]:
    """`quat_to_matrix` in float64 and without JAX: for constants, also while something is traced."""
    squares = q * q
    q = q / np.sqrt(squares[:, 1] + squares[:, 2] + squares[:, 3] + squares[:, 0])[:, None]  # SciPy's order
    w, x, y, z = q.T
    ww, xx, yy, zz = (q * q).T
    rows = [
        [xx - yy - zz + ww, 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), -xx + yy - zz + ww, 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), -xx - yy + zz + ww],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def matrix_to_quat(m: Float[AnyArray, "*b 3 3"]) -> Float[Array, "*b 4"]:
    """Unit quaternion with w >= 0 of a rotation matrix, stable for every angle.

    The four columns below are the quaternion times 4w, 4x, 4y and 4z; the longest of them is taken (Shepperd's method).
    """
    m00, m01, m02 = m[..., 0, 0], m[..., 0, 1], m[..., 0, 2]
    m10, m11, m12 = m[..., 1, 0], m[..., 1, 1], m[..., 1, 2]
    m20, m21, m22 = m[..., 2, 0], m[..., 2, 1], m[..., 2, 2]
    columns = jnp.stack(
        [
            jnp.stack([1 + m00 + m11 + m22, m21 - m12, m02 - m20, m10 - m01], axis=-1),
            jnp.stack([m21 - m12, 1 + m00 - m11 - m22, m10 + m01, m02 + m20], axis=-1),
            jnp.stack([m02 - m20, m10 + m01, 1 - m00 + m11 - m22, m21 + m12], axis=-1),
            jnp.stack([m10 - m01, m02 + m20, m21 + m12, 1 - m00 - m11 + m22], axis=-1),
        ],
        axis=-2,
    )
    largest = jnp.argmax(jnp.diagonal(columns, axis1=-2, axis2=-1), axis=-1)
    chosen = jnp.take_along_axis(columns, largest[..., None, None], axis=-2)[..., 0, :]
    quat = quat_normalize(chosen)
    return jnp.where(quat[..., :1] < 0, -quat, quat)


def axis_angle_to_quat(axis: Vec, angle: Float[AnyArray, "*#b"]) -> Float[Array, "*b 4"]:
    """Rotation by `angle` about `axis` (of any length but zero), right-handed."""
    half = 0.5 * jnp.asarray(angle)[..., None]
    vector = normalize(axis) * jnp.sin(half)
    return jnp.concatenate([jnp.broadcast_to(jnp.cos(half), (*vector.shape[:-1], 1)), vector], axis=-1)


def rotation_vector_to_quat(v: Float[AnyArray, "*b 3"]) -> Float[Array, "*b 4"]:
    """Rotation about `v` by its length; smooth through zero."""
    angle = length(v)[..., None]
    # sin(a/2)/a = sinc(a/2pi)/2, and jnp.sinc is smooth at zero.
    return quat_normalize(jnp.concatenate([jnp.cos(angle / 2), 0.5 * jnp.sinc(angle / (2 * jnp.pi)) * v], axis=-1))


def quat_to_rotation_vector(q: Float[AnyArray, "*b 4"]) -> Float[Array, "*b 3"]:
    """Axis times angle, the angle in [0, pi]; the inverse of `rotation_vector_to_quat`."""
    q = jnp.where(q[..., :1] < 0, -q, q)
    sine = length(q[..., 1:])[..., None]
    small = sine < 1e-6
    angle = 2.0 * jnp.arctan2(jnp.where(small, 1.0, sine), q[..., :1])
    return q[..., 1:] * jnp.where(small, 2.0, angle / jnp.where(small, 1.0, sine))


def rpy_to_quat(rpy: Float[AnyArray, "*b 3"]) -> Float[Array, "*b 4"]:
    """URDF's roll, pitch, yaw: turns about the fixed x, then y, then z axis."""
    cr, cp, cy = (jnp.cos(0.5 * rpy[..., i]) for i in range(3))
    sr, sp, sy = (jnp.sin(0.5 * rpy[..., i]) for i in range(3))
    return jnp.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def quat_to_rpy(q: Float[AnyArray, "*b 4"]) -> Float[Array, "*b 3"]:
    """Roll and yaw in [-pi, pi], pitch in [-pi/2, pi/2]; at pitch +-pi/2 only roll -+ yaw is meaningful."""
    w, x, y, z = (q[..., i] for i in range(4))
    roll = jnp.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = jnp.arcsin(jnp.clip(2 * (w * y - z * x), -1.0, 1.0))
    yaw = jnp.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return jnp.stack([roll, pitch, yaw], axis=-1)


def rotation_angle(a: Quat, b: Quat) -> Float[Array, "*b"]:
    """Angle between two orientations, in [0, pi]."""
    relative = quat_multiply(quat_conjugate(a), b)
    return 2.0 * jnp.arctan2(length(relative[..., 1:]), jnp.abs(relative[..., 0]))


def compose(pos_a: Vec, quat_a: Quat, pos_b: Vec, quat_b: Quat) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 4"]]:
    """Pose of frame b in the parent of a, where (pos_b, quat_b) is its pose in frame a."""
    return quat_rotate(quat_a, pos_b) + pos_a, quat_multiply(quat_a, quat_b)


def invert(pos: Vec, quat: Quat) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 4"]]:
    """Pose of the parent frame seen from the child."""
    return -quat_rotate_inverse(quat, pos), quat_conjugate(quat)


def relative_pose(
    pos_a: Vec, quat_a: Quat, pos_b: Vec, quat_b: Quat
) -> tuple[Float[Array, "*b 3"], Float[Array, "*b 4"]]:
    """Pose of frame b seen from frame a, both given in one parent frame."""
    return quat_rotate_inverse(quat_a, pos_b - pos_a), quat_multiply(quat_conjugate(quat_a), quat_b)


def transform_points(
    pos: Float[AnyArray, "*#b 3"], quat: Float[AnyArray, "*#b 4"], points: Float[AnyArray, "*#b n 3"]
) -> Float[Array, "*b n 3"]:
    """Points of the child frame, expressed in the parent frame; `n` points per pose."""
    return quat_rotate(quat[..., None, :], points) + pos[..., None, :]


def inverse_transform_points(
    pos: Float[AnyArray, "*#b 3"], quat: Float[AnyArray, "*#b 4"], points: Float[AnyArray, "*#b n 3"]
) -> Float[Array, "*b n 3"]:
    """Points of the parent frame, expressed in the child frame; `n` points per pose."""
    return quat_rotate_inverse(quat[..., None, :], points - pos[..., None, :])
