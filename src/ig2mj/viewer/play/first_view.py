"""Where the window of `ig2mj play` looks from at the start: the robot, its goal and the room are in sight.

Cameras around the robot are tried, the one behind it first. Each is judged by rays (`ig2mj.viewer.sight_lines`): how
much of the robot and of the goal it sees within the frame, and how far it sees into the room.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.viewer.label_space import Sight
from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.sight_lines import SightLines, surface_points

ASPECT = (800, 600)
"""The narrowest window, pixels, whose frame must hold the robot."""

MARGIN = 0.06
"""Share of the frame along each edge that does not count as in sight."""

SIDES = (0.0, 25.0, -25.0, 50.0, -50.0, 80.0, -80.0, 110.0, -110.0, 145.0, -145.0, 180.0)
"""Degrees from the robot's heading to the direction of view; 0: from behind."""

ELEVATIONS = (-25.0, -15.0, -38.0, -55.0)
"""Degrees."""

DISTANCES = (2.2, 2.8, 1.7, 3.5, 1.3)
"""m from the point that is looked at."""

FORWARD = 0.6
"""m towards the goal by which the camera looks past the robot, at most."""

_REACH = 2.5
"""m to which a free ray counts."""

_SKY = 0.7
"""What a ray counts that meets nothing."""

_CLEAR = 0.25
"""m before the camera within which nothing may be."""

_ROBOT, _GOAL, _ROOM = 6.0, 2.5, 1.5
"""Weights of the shares of the robot, of the goal and of the room that are seen."""

_TURNED, _STEEP, _OFF = 4.0, 0.5, 0.3
"""Weights of what differs from the first camera: the square of the side in half turns, the elevation in right angles,
and the distance in metres. A robot that faces the camera is hard to drive, so that a goal does not outweigh it."""

_GRID = np.stack(np.meshgrid(np.linspace(-0.9, 0.9, 9), np.linspace(-0.9, 0.9, 7)), axis=-1).reshape(-1, 2)
"""Where rays go through the frame, -1..1."""


def first_view(
    lines: SightLines,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    robot: Int[np.ndarray, "K"],
    heading: float,
    goal: Float[np.ndarray, "N 3"],
    goal_objects: Sequence[Int[np.ndarray, "_"]] = (),
) -> FreeView:
    """The best view of a robot at the start.

    Args:
      lines: of the model. data: with up-to-date positions.
      robot: geoms of the robot, those that are opaque where there are any. heading: degrees about +z in which it looks.
      goal: points in the air or on the floor that matter, world frame, m; may be empty.
      goal_objects: visible geoms of each object that matters.
    """
    body = surface_points(model, data, robot).reshape(-1, 3)
    low, high = body.min(axis=0), body.max(axis=0)
    middle = (low + high) / 2
    objects = [(geoms, surface_points(model, data, geoms)) for geoms in goal_objects if len(geoms)]
    matters = np.concatenate([np.asarray(goal, float).reshape(-1, 3), *(points[:, 0] for _, points in objects)])
    ahead = _ahead(middle, matters)
    tall = float(np.linalg.norm(high - low))

    def worth(view: FreeView, side: float, least: float) -> float:
        """How good a view is; no more than `least` where it is not better than that."""
        turned, steep = -((side / 180) ** 2), -abs(view.elevation - ELEVATIONS[0]) / 90
        value = _TURNED * turned + _STEEP * steep - _OFF * abs(view.distance - max(DISTANCES[0], tall))
        if value + _ROBOT + _GOAL + _ROOM <= least:
            return least
        sight = Sight.of_view(view, float(model.vis.global_.fovy), ASPECT)
        value += _ROBOT * _share(lines, data, sight, body, robot)
        if value + _GOAL + _ROOM <= least or (room := _room(lines, data, sight)) is None:
            return least
        return value + _ROOM * room + _GOAL * _goal_share(lines, data, sight, goal, objects)

    best, found = -np.inf, FreeView(tuple(middle.tolist()), DISTANCES[-1], heading, -89.0)
    for side, elevation, distance, past in itertools.product(SIDES, ELEVATIONS, DISTANCES, (1.0, 0.0)):
        view = FreeView(tuple((middle + past * ahead).tolist()), distance, heading + side, elevation)
        if (value := worth(view, side, best)) > best:
            best, found = value, view
    return found


def _ahead(middle: Float[np.ndarray, "3"], matters: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "3"]:
    """From the robot towards the nearest of what matters, at most `FORWARD`, along the floor."""
    if not len(matters):
        return np.zeros(3)
    offsets = (matters - middle) * (1.0, 1.0, 0.0)
    lengths = np.linalg.norm(offsets, axis=1)
    nearest = int(np.argmin(lengths))
    return offsets[nearest] * min(0.5, FORWARD / max(float(lengths[nearest]), 1e-6))


def _share(
    lines: SightLines,
    data: mujoco.MjData,
    sight: Sight,
    points: Float[np.ndarray, "N 3"],
    own: Int[np.ndarray, "K"],
) -> float:
    """Share of points that lie within the frame and before which rays meet nothing but one of their own geoms."""
    met, far = lines.towards(data, sight.eye, points)
    free = np.isin(met, own) | (far >= np.linalg.norm(points - sight.eye, axis=1))
    return float(np.mean(free & sight.frames(points, MARGIN)))


def _goal_share(
    lines: SightLines,
    data: mujoco.MjData,
    sight: Sight,
    goal: Float[np.ndarray, "N 3"],
    objects: Sequence[tuple[Int[np.ndarray, "_"], Float[np.ndarray, "_ 7 3"]]],
) -> float:
    """Mean over the goal's points and objects of whether a point is seen, or of the share of an object's geoms of which
    something is seen."""
    seen: list[float] = []
    if len(goal):
        _, far = lines.towards(data, sight.eye, goal)
        open_ = far > np.linalg.norm(goal - sight.eye, axis=1) - 0.1
        seen += (open_ & sight.frames(goal, MARGIN)).tolist()
    for geoms, points in objects:
        met, _ = lines.towards(data, sight.eye, points.reshape(-1, 3))
        own = met.reshape(len(geoms), -1) == geoms[:, None]
        framed = sight.frames(points.reshape(-1, 3), MARGIN).reshape(len(geoms), -1)
        seen.append(float(np.mean((own & framed).any(axis=1))))
    return float(np.mean(seen)) if seen else 0.0


def _room(lines: SightLines, data: mujoco.MjData, sight: Sight) -> float | None:
    """How far rays through the frame go, 0..1; None where something is right before the camera."""
    geoms, far = lines.cast(data, sight.eye, sight.directions(_GRID))
    if far.min() < _CLEAR:
        return None
    return float(np.mean(np.where(geoms >= 0, np.minimum(far / _REACH, 1.0), _SKY)))
