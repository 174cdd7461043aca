"""The first shot of a video: a robot in its room, from where a person would watch it."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from ig2mj.envs.state import EnvState
from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.scene.scene import Scene
from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.room_views import EYE_HEIGHT, standing_places

LOOKED_AT, FIELD_OF_VIEW = 0.65, 62.0
"""m above the robot's base of the middle of the image; degrees, vertical."""

BEST, LEAST = 3.2, 1.2
"""m from the robot: preferred, and at least."""

CLEAR = 0.2
"""m before the robot where a ray may end."""


def establishing_shot(scene: Scene, state: EnvState, world: int = 0) -> FreeView | None:
    """The place in the robot's room from which it is seen best; None where there is none, or no map of rooms."""
    base = np.asarray(state.batch.world.view.agent.base_pos)[world, 0].astype(float)
    room = scene.rooms.room_at(base[:2]) if scene.rooms is not None else None
    if room is None:
        return None
    data, target = scene.start_data(), np.array([base[0], base[1], LOOKED_AT])
    group = np.isin(np.arange(mujoco.mjNGROUP), VISIBLE_GROUPS).astype(np.uint8)
    best: tuple[float, np.ndarray] | None = None
    for x, y in standing_places(scene, room):
        eye = np.array([x, y, EYE_HEIGHT])
        way = target - eye
        length = float(np.linalg.norm(way))
        if length < LEAST:
            continue
        hit = np.array([-1], np.int32)
        free = mujoco.mj_ray(scene.model, data, eye, way / length, group, 1, -1, hit)
        owner = scene.tables.body_agent[scene.model.geom_bodyid[hit[0]]] if hit[0] >= 0 else -1
        if 0 <= free < length - CLEAR and owner != 0:
            continue
        if best is None or abs(length - BEST) < best[0]:
            best = abs(length - BEST), way
    if best is None:
        return None
    way = best[1]
    azimuth, tilt = math.atan2(way[1], way[0]), math.atan2(way[2], math.hypot(way[0], way[1]))
    x, y, z = (float(c) for c in target)
    length = float(np.linalg.norm(way))
    return FreeView((x, y, z), length, math.degrees(azimuth), math.degrees(tilt), fovy=FIELD_OF_VIEW)
