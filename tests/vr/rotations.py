"""Rotations for tests."""

from __future__ import annotations

from scipy.spatial.transform import Rotation


def turned(**about: float) -> Rotation:
    """Degrees about fixed axes: `turned(z=90)`."""
    return Rotation.from_euler("".join(about), list(about.values()), degrees=True) if about else Rotation.identity()
