"""Cameras on hands: `<agent>/right_wrist` and `<agent>/left_wrist`. They ride on the hand and show what it holds."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.agents.parts import Vector, normalized

RIGHT, LEFT = "right_wrist", "left_wrist"

WRISTS = (RIGHT, LEFT)
"""Names of the cameras; that of a single hand is `RIGHT`."""

WRIST_FOVY = 80.0
"""Degrees, vertical: fingers and what is a hand's width in front of them are in the image."""


def add_wrist_camera(body: mujoco.MjsBody, agent: str, wrist: str, eye: Vector, at: Vector, up: Vector) -> str:
    """Adds a camera to a hand, and returns its name.

    Args:
      body: of the hand. agent: name of the robot. wrist: one of `WRISTS`.
      eye, at, up: in the body's frame: where the camera is and what it looks at (m), and what is up in its image.
    """
    eye, back = np.asarray(eye, np.float64), normalized(np.asarray(eye, np.float64) - np.asarray(at, np.float64))
    right = normalized(np.cross(up, back))
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.stack([right, np.cross(back, right), back], axis=1).ravel())
    name = f"{agent}/{wrist}"
    body.add_camera(name=name, pos=list(eye), quat=list(quat), fovy=WRIST_FOVY)
    return name


def is_wrist_camera(name: str) -> bool:
    """Whether a model's camera has such a name."""
    return name.rpartition("/")[2] in WRISTS and "/" in name
