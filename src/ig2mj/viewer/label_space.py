"""Which labels are written where several would cover each other: the nearest to the camera."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.viewer.overlays import Label

CHARACTER = (9.0, 18.0)
"""Pixels. Width and height of a character of MuJoCo's labels, about; letters differ in width."""


@dataclasses.dataclass(frozen=True)
class Sight:
    """What the window's free camera sees.

    Attributes:
      eye: world frame, metres. axes: rows are right, up and forward, world frame. fovy: vertical field of view, rad.
      size: width and height of the window, pixels.
    """

    eye: Float[np.ndarray, "3"]
    axes: Float[np.ndarray, "3 3"]
    fovy: float
    size: tuple[int, int]

    @classmethod
    def of_window(cls, handle: Any, fovy: float) -> Sight | None:
        """Of MuJoCo's passive viewer; None: the window has no size yet, or its camera is not the free one.

        Args:
          fovy: degrees, as in `mjModel.vis.global_`.
        """
        camera, window = handle.cam, handle.viewport
        if window is None or window.height <= 0 or camera.type != mujoco.mjtCamera.mjCAMERA_FREE:
            return None
        turn, tilt = np.deg2rad(camera.azimuth), np.deg2rad(camera.elevation)
        forward = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
        right = np.array([np.sin(turn), -np.cos(turn), 0.0])
        axes = np.stack([right, np.cross(right, forward), forward])
        return cls(camera.lookat - camera.distance * forward, axes, np.deg2rad(fovy), (window.width, window.height))

    def pixels(self, points: Float[np.ndarray, "N 3"]) -> tuple[Float[np.ndarray, "N 2"], Float[np.ndarray, "N"]]:
        """Where points appear, from the window's lower left corner, and how far before the camera they are (metres)."""
        across, upwards, depth = self.axes @ (points - self.eye).T
        scale = self.size[1] / 2 / np.tan(self.fovy / 2) / np.where(depth > 0, depth, np.inf)
        return np.stack([self.size[0] / 2 + across * scale, self.size[1] / 2 + upwards * scale], axis=-1), depth


def uncovered(labels: Sequence[Label], sight: Sight) -> list[Label]:
    """The labels that can be written without covering a nearer one, in their order; none of what is behind the eye."""
    if not labels:
        return []
    corner, depth = sight.pixels(np.array([label.pos for label in labels], float))
    size = np.array([(CHARACTER[0] * len(label.text), CHARACTER[1]) for label in labels])
    kept: list[int] = []
    for k in np.argsort(depth, kind="stable"):
        if depth[k] <= 0:
            continue
        apart = np.abs(corner[kept] + size[kept] / 2 - corner[k] - size[k] / 2) >= (size[kept] + size[k]) / 2
        if apart.any(axis=1).all():
            kept.append(int(k))
    return [labels[k] for k in sorted(kept)]
