"""How substances look in images, videos and windows for people: levels of contents, streams, spots, flames.

They are marks (`ig2mj.viewer.state_marks`). Robots' cameras show simpler ones (`ig2mj.sensors.substance_slots`).
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import quat_rotate
from ig2mj.sensors.content_levels import THIN
from ig2mj.sensors.substance_shapes import burning, levels, spots, streams_of
from ig2mj.sensors.substance_slots import LONGER, SPOT_THICKNESS, STREAM_RADIUS
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.viewer.state_marks import Mark

ALPHA = {"level": 0.92, "stream": 0.8, "spot": 0.85}

FLAMES, HEIGHT = 26, 0.3
"""Number of tongues of a flame, and m to which they rise."""


def substance_marks(
    model: StateModel, states: ExtendedStates, view: PhysicsView, world: int = 0, time: float | int = 0.0
) -> list[Mark]:
    """Marks of one world. time: s, by which flames move."""
    found = list[Mark]()
    kinds = mujoco.mjtGeom
    for level in levels(model, states, view, world):
        kind = kinds.mjGEOM_BOX if level.rectangle else kinds.mjGEOM_ELLIPSOID
        found.append(Mark(kind, (*level.half, THIN), level.pos, level.axes, (*level.rgb, ALPHA["level"])))
    for stream in streams_of(model, states, view, world):
        for a, b in zip(stream.points[:-1], stream.points[1:], strict=True):
            half = float(np.linalg.norm(b - a)) / 2
            if half > 1e-5:
                rgba = (*stream.rgb, ALPHA["stream"])
                axes = _towards((b - a) / (2 * half))
                size = (STREAM_RADIUS, STREAM_RADIUS, LONGER * half)
                found.append(Mark(kinds.mjGEOM_ELLIPSOID, size, (a + b) / 2, axes, rgba))
    for spot in spots(model, states, world):
        body_pos, body_quat = (np.asarray(f)[world, spot.body] for f in (view.body_pos, view.body_quat))
        pos = body_pos + np.asarray(quat_rotate(body_quat, spot.pos))
        normal = np.asarray(quat_rotate(body_quat, spot.normal))
        size = (spot.radius, spot.radius, SPOT_THICKNESS)
        found += [
            Mark(kinds.mjGEOM_ELLIPSOID, size, p, _towards(n), (*spot.rgb, ALPHA["spot"]))
            for p, n in zip(pos, normal, strict=True)
        ]
    for obj in burning(states, model.extras, world):
        low, high = (np.asarray(f)[world, obj] for f in (view.aabb_low, view.aabb_high))
        found += _flames(low, high, int(obj), time)
    return found


def _flames(low: np.ndarray, high: np.ndarray, seed: int, time: float | int) -> list[Mark]:
    """Tongues over a box that rise and become narrow: yellow below, red above."""
    rng, found = np.random.default_rng(seed), []
    for k in range(FLAMES):
        x, y, phase = rng.uniform(0.1, 0.9), rng.uniform(0.1, 0.9), rng.uniform(0, 1)
        share = (phase + 1.3 * float(time)) % 1.0
        pos = low + (high - low) * np.array([x, y, 1.0]) + np.array([0.0, 0.0, HEIGHT * share])
        pos[:2] += 0.02 * share * np.array([math.sin(5 * share + k), math.cos(4 * share + k)])
        size = 0.035 * (1 - 0.75 * share)
        rgba = (1.0, 0.85 - 0.65 * share, 0.25 * (1 - share), 0.55 * (1 - share) + 0.1)
        found.append(Mark(mujoco.mjtGeom.mjGEOM_ELLIPSOID, (size, size, 2.0 * size), pos, np.eye(3), rgba))
    return found


def _towards(direction: np.ndarray) -> np.ndarray:
    """Rotation matrix whose third column is a unit vector."""
    aside = np.array([1.0, 0.0, 0.0]) if abs(direction[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = np.cross(aside, direction)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(direction, x), direction], axis=1)
