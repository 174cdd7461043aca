"""What PyBullet is to load: bodies, and where pictures are taken from. Nothing here needs the converter."""

from __future__ import annotations

import msgspec


class BulletBody(msgspec.Struct):
    """One URDF to load.

    Attributes:
      name: of the MJCF body that stands for it; also of its files. object: the object it belongs to.
      pos, quat: of its base link's frame, world, metres and x-y-z-w.
      fixed: the base does not move.
      sleeps: ENABLE_SLEEPING; a robot never sleeps (as in iGibson).
      joints: URDF joint -> start position. motor_force: of the velocity motor that stands for joint friction, N or N m.
    """

    name: str
    object: str
    urdf: str
    urdf_with_visuals: str
    pos: tuple[float, float, float]
    quat: tuple[float, float, float, float]
    fixed: bool
    motor_force: float
    sleeps: bool = True
    joints: dict[str, float] = {}


class BulletCamera(msgspec.Struct):
    """Where pictures are taken from: world frame, metres; vertical view angle in degrees."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    fovy: float = 90.0


class BulletScene(msgspec.Struct):
    """What `pybullet_worker.py` reads: paths are relative to the folder."""

    name: str
    bodies: list[BulletBody]
    camera: BulletCamera
