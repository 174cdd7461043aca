"""`object_poses`, `base_pose` and `eye_pose`: true poses, which no real sensor measures."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Percept, Sensor, Setup, Space

_SUMMARY = "position (m) and orientation (w-x-y-z)"


def _poses(shape: tuple[int, ...]) -> Space:
    return Space((*shape, 7), np.float32, -np.inf, np.inf)


def _objects(setup: Setup, percept: Percept) -> Float[Array, "W O 7"]:
    return jnp.concatenate([jnp.asarray(percept.view.object_pos), jnp.asarray(percept.view.object_quat)], axis=-1)


def _base(setup: Setup, percept: Percept) -> Float[Array, "W 7"]:
    agent = percept.view.agent
    return jnp.concatenate([jnp.asarray(a)[:, setup.agent] for a in (agent.base_pos, agent.base_quat)], axis=-1)


def _eye(setup: Setup, percept: Percept) -> Float[Array, "W 7"]:
    return jnp.concatenate(setup.controller.eye(percept.view, percept.controller), axis=-1)


OBJECT_POSES = Sensor(
    "object_poses", f"{_SUMMARY} of every object", "world", lambda s: _poses((s.scene.tables.num_objects,)), _objects
)
BASE_POSE = Sensor("base_pose", f"{_SUMMARY} of the robot's base", "world", lambda _: _poses(()), _base)
EYE_POSE = Sensor("eye_pose", f"{_SUMMARY} of the robot's camera", "world", lambda _: _poses(()), _eye)
