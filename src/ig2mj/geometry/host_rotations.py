"""Rotations in NumPy alone: the functions of `ig2mj.geometry.poses` with the same names, for code on the host.

A call of an operation of JAX on a few numbers takes 50 times as long as one of NumPy. Quaternions are w,x,y,z and of
unit length; every function broadcasts over leading axes (`*b`) and keeps the floating-point type of its arguments.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

Quat = Float[np.ndarray, "*#b 4"]
Vec = Float[np.ndarray, "*#b 3"]

_UP = np.array([0.0, 0.0, 1.0])
_CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0], np.float32)


def length(v: Float[np.ndarray, "*b d"]) -> Float[np.ndarray, "*b"]:
    """Euclidean length."""
    return np.asarray(np.sqrt(np.sum(np.square(v), axis=-1)))


def cross(a: Vec, b: Vec) -> Float[np.ndarray, "*b 3"]:
    """Cross product; for a few vectors five times as fast as NumPy's."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return _together(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def _together(*parts: Float[np.ndarray, "*b"] | np.floating) -> Float[np.ndarray, "*b d"]:
    """Parts of one shape along a last axis; for a few numbers four times as fast as `numpy.stack`."""
    found = np.empty((*parts[0].shape, len(parts)), parts[0].dtype)
    for k, part in enumerate(parts):
        found[..., k] = part
    return found


def quat_conjugate(q: Quat) -> Float[np.ndarray, "*b 4"]:
    """Inverse rotation."""
    return q * _CONJUGATE


def quat_multiply(a: Quat, b: Quat) -> Float[np.ndarray, "*b 4"]:
    """The rotation that turns by `b` first and by `a` then."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    return _together(
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def quat_rotate(q: Quat, v: Vec) -> Float[np.ndarray, "*b 3"]:
    """`v` turned by `q`."""
    w, u = q[..., :1], q[..., 1:]
    twice = 2 * cross(u, v)
    return v + w * twice + cross(u, twice)


def quat_rotate_inverse(q: Quat, v: Vec) -> Float[np.ndarray, "*b 3"]:
    """`v` turned by the inverse of `q`."""
    return quat_rotate(quat_conjugate(q), v)


def quat_to_rotation_vector(q: Quat) -> Float[np.ndarray, "*b 3"]:
    """Axis times angle, the angle in [0, pi]."""
    q = np.where(q[..., :1] < 0, -q, q)
    sine = length(q[..., 1:])[..., None]
    small = sine < 1e-6
    safe = np.where(small, 1, sine)
    return q[..., 1:] * np.where(small, 2, 2 * np.arctan2(safe, q[..., :1]) / safe)


def rotation_angle(a: Quat, b: Quat) -> Float[np.ndarray, "*b"]:
    """Angle between two orientations, in [0, pi]."""
    relative = quat_multiply(quat_conjugate(a), b)
    return np.asarray(2 * np.arctan2(length(relative[..., 1:]), np.abs(relative[..., 0])))


def matrix_to_quat(m: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "4"]:
    """Unit quaternion with w >= 0 of one rotation matrix, stable for every angle (Shepperd's method)."""
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = np.asarray(m)
    columns = np.array(
        [
            [1 + m00 + m11 + m22, m21 - m12, m02 - m20, m10 - m01],
            [m21 - m12, 1 + m00 - m11 - m22, m10 + m01, m02 + m20],
            [m02 - m20, m10 + m01, 1 - m00 + m11 - m22, m21 + m12],
            [m10 - m01, m02 + m20, m21 + m12, 1 - m00 - m11 + m22],
        ]
    )
    chosen = columns[int(np.argmax(np.diagonal(columns)))]
    chosen = chosen / np.linalg.norm(chosen)
    return -chosen if chosen[0] < 0 else chosen


def yaw_quat(angle: float) -> Float[np.ndarray, "4"]:
    """Rotation about the vertical by an angle in rad, w-x-y-z."""
    return np.array([np.cos(angle / 2), 0.0, 0.0, np.sin(angle / 2)])


def about_vertical(angle: float) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix about the vertical by an angle in rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turn_about(axis: Float[np.ndarray, "3"], angle: float) -> Float[np.ndarray, "3 3"]:
    """Rotation matrix about an axis of any length by an angle in rad."""
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + s * k + (1 - c) * (k @ k)


def turn_onto(one: Float[np.ndarray, "3"], other: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Matrix of the least rotation from one direction to another."""
    a, b = one / np.linalg.norm(one), other / np.linalg.norm(other)
    axis, cos = np.cross(a, b), float(a @ b)
    if cos < -0.999:
        side = np.cross(a, _UP) if abs(a @ _UP) < 0.9 else np.array([1.0, 0.0, 0.0])
        side = side / np.linalg.norm(side)
        return 2 * np.outer(side, side) - np.eye(3)
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + k + k @ k / (1 + cos)
