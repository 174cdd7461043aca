"""Which labels are written where several would cover each other: the nearest to the camera."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.overlays import Label

CHARACTER = (9.0, 18.0)
"""Pixels. Width and height of a character of MuJoCo's labels, about; letters differ in width."""

TEXT, TEXT_EDGE = (7.2, 23.0), (20.0, 10.0)
"""Pixels. Width and height of a character of the texts in the window's corners, about, and what lies around them."""


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
        return cls._of_angles(
            camera.lookat, camera.distance, camera.azimuth, camera.elevation, fovy, (window.width, window.height)
        )

    @classmethod
    def of_view(cls, view: FreeView, fovy: float, size: tuple[int, int]) -> Sight:
        """Of a free view in perspective. `fovy`: degrees; `size`: width and height of the image, pixels."""
        return cls._of_angles(np.asarray(view.lookat, float), view.distance, view.azimuth, view.elevation, fovy, size)

    @classmethod
    def _of_angles(
        cls,
        lookat: Float[np.ndarray, "3"],
        distance: float,
        azimuth: float,
        elevation: float,
        fovy: float,
        size: tuple[int, int],
    ) -> Sight:
        turn, tilt = np.deg2rad(azimuth), np.deg2rad(elevation)
        forward = np.array([np.cos(tilt) * np.cos(turn), np.cos(tilt) * np.sin(turn), np.sin(tilt)])
        right = np.array([np.sin(turn), -np.cos(turn), 0.0])
        axes = np.stack([right, np.cross(right, forward), forward])
        return cls(lookat - distance * forward, axes, float(np.deg2rad(fovy)), size)

    def pixels(self, points: Float[np.ndarray, "N 3"]) -> tuple[Float[np.ndarray, "N 2"], Float[np.ndarray, "N"]]:
        """Where points appear, from the window's lower left corner, and how far before the camera they are (metres)."""
        across, upwards, depth = self.axes @ (points - self.eye).T
        scale = self.size[1] / 2 / np.tan(self.fovy / 2) / np.where(depth > 0, depth, np.inf)
        return np.stack([self.size[0] / 2 + across * scale, self.size[1] / 2 + upwards * scale], axis=-1), depth

    def frames(self, points: Float[np.ndarray, "N 3"], margin: float = 0.0) -> Bool[np.ndarray, "N"]:
        """Which points lie within the window. `margin`: share of its width and height along each edge left out."""
        at, depth = self.pixels(points)
        share = at / self.size
        return (depth > 0) & ((share >= margin) & (share <= 1.0 - margin)).all(axis=-1)

    def directions(self, places: Float[np.ndarray, "N 2"]) -> Float[np.ndarray, "N 3"]:
        """Unit vectors, world frame, through places of the window; -1..1 from its left and lower edge."""
        up = np.tan(self.fovy / 2)
        local = np.column_stack(
            [places[:, 0] * up * self.size[0] / self.size[1], places[:, 1] * up, np.ones(len(places))]
        )
        lines = local @ self.axes
        return lines / np.linalg.norm(lines, axis=1, keepdims=True)


def off_texts(labels: Sequence[Label], sight: Sight, texts: Sequence[Sequence[Any]]) -> list[Label]:
    """The labels that do not begin under the window's texts; those that would reach under one are shifted to its left.

    Args:
      texts: font, corner and both columns of each, as `Handle.set_texts` takes them.
    """
    if not labels:
        return []
    low, depth = sight.pixels(np.array([label.pos for label in labels], float))
    width = np.array([CHARACTER[0] * len(label.text) for label in labels])
    free, shift = np.ones(len(labels), bool), np.zeros(len(labels))
    for _, corner, *columns in texts:
        size = np.array(text_size(*columns))
        right = corner in (mujoco.mjtGridPos.mjGRID_TOPRIGHT, mujoco.mjtGridPos.mjGRID_BOTTOMRIGHT)
        top = corner in (mujoco.mjtGridPos.mjGRID_TOPLEFT, mujoco.mjtGridPos.mjGRID_TOPRIGHT)
        start = np.where([right, top], np.array(sight.size) - size, 0.0)
        level = (low[:, 1] + CHARACTER[1] > start[1]) & (low[:, 1] < start[1] + size[1])
        free &= ~(level & (low[:, 0] >= start[0]) & (low[:, 0] < start[0] + size[0]))
        over = low[:, 0] + width - start[0]
        shift = np.where(level & (low[:, 0] < start[0]), np.maximum(shift, over), shift)
    metres = shift * depth * 2 * np.tan(sight.fovy / 2) / sight.size[1]
    moved = [label.pos - step * sight.axes[0] for label, step in zip(labels, metres, strict=True)]
    return [
        dataclasses.replace(label, pos=(float(pos[0]), float(pos[1]), float(pos[2])))
        for label, pos, good in zip(labels, moved, free, strict=True)
        if good
    ]


def text_size(left: str, right: str) -> tuple[float, float]:
    """Pixels that a text of two columns takes in a corner of the window: width and height, about."""
    if not (left or right):
        return 0.0, 0.0
    widths = [max(map(len, column.split("\n"))) for column in (left, right)]
    return TEXT[0] * sum(widths) + TEXT_EDGE[0], TEXT[1] * len(left.split("\n")) + TEXT_EDGE[1]


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
