"""4x4 poses: URDF origins and quaternions of files (x, y, z, w)."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ig2mj.errors import InputError

from .xml_reader import Element, numbers, where

ROTATION_TOLERANCE = 1e-9


def rotation_from_rpy(rpy: np.ndarray) -> np.ndarray:
    """[3, 3] from URDF's fixed-axis roll, pitch, yaw (radians): Rz(y) Ry(p) Rx(r)."""
    return Rotation.from_euler("xyz", rpy).as_matrix()


def pose_from(xyz: np.ndarray, rpy: np.ndarray) -> np.ndarray:
    """4x4 from a position (m) and fixed-axis roll, pitch, yaw (radians)."""
    pose = np.eye(4)
    if np.any(rpy):
        pose[:3, :3] = rotation_from_rpy(rpy)
    pose[:3, 3] = xyz
    return pose


def read_origin(parent: Element, file: object) -> np.ndarray:
    """4x4 of the child element <origin xyz rpy>, or <origin xyz quat_xyzw> of URDF 1.2; each may be missing (identity).

    Raises:
      InputError: both rpy and quat_xyzw, or a quaternion of length zero.
    """
    origin = parent.find("origin")
    if origin is None:
        return np.eye(4)
    zero = (0.0, 0.0, 0.0)
    pose = pose_from(numbers(origin, "xyz", 3, file, zero), numbers(origin, "rpy", 3, file, zero))
    if origin.get("quat_xyzw") is not None:
        if origin.get("rpy") is not None:
            raise InputError(file, "has both rpy and quat_xyzw", element=where(origin), fix="keep one of them")
        quat = numbers(origin, "quat_xyzw", 4, file)
        if np.linalg.norm(quat) < ROTATION_TOLERANCE:
            raise InputError(file, "quat_xyzw has length zero", element=where(origin))
        pose[:3, :3] = rotation_from_wxyz(wxyz(quat))
    return pose


def wxyz(xyzw: np.ndarray) -> np.ndarray:
    """Quaternion of a file (x, y, z, w) -> unit w, x, y, z; the zero quaternion gives the identity."""
    q = np.asarray(xyzw, dtype=float)[[3, 0, 1, 2]]
    norm = np.linalg.norm(q)
    return q / norm if norm > ROTATION_TOLERANCE else np.array([1.0, 0.0, 0.0, 0.0])


def rotation_from_wxyz(quat: np.ndarray) -> np.ndarray:
    """[3, 3] of a quaternion w, x, y, z."""
    return Rotation.from_quat(np.asarray(quat)[[1, 2, 3, 0]]).as_matrix()


def is_identity(rotation: np.ndarray) -> bool:
    return bool(np.allclose(rotation, np.eye(3), rtol=0, atol=ROTATION_TOLERANCE))


def apply(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    """points [n, 3] moved by a 4x4."""
    return points @ pose[:3, :3].T + pose[:3, 3]


def quat_from_rotation(rotation: np.ndarray) -> np.ndarray:
    """Quaternion w, x, y, z (w >= 0) of a [3, 3]."""
    return Rotation.from_matrix(rotation).as_quat(canonical=True)[[3, 0, 1, 2]]
