"""What an agent of a task observes, by name.

| name | what | shape |
|---|---|---|
| `proprioception` | the robot of itself (`Controller.proprioception`) | [m] |
| `privileged_state` | ground truth of hands, objects and goal, in the frame of the robot's base | [p] |
| `rgb` | the robot's camera, 0..255, row 0 on top | [Y, X, 3] |
| `depth` | metres along the optical axis, at most 10; 0 where nothing is hit | [Y, X, 1] |

Every array has the world axis W before that.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Engine, Physics
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.geometry.poses import quat_rotate_inverse, relative_pose
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.particles import NUM_PARTICLES
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.points import locator
from ig2mj.tasks.reward import Measures, Reward
from ig2mj.tasks.task import Task

PICTURES = ("rgb", "depth")
NAMES = ("proprioception", "privileged_state", *PICTURES)

FARTHEST = 10.0
"""m: the end of the depth picture's range (spec/robots_tasks_sensors.md section 2.6)."""

DEGREES = 100.0
"""Celsius that are 1 in `privileged_state`."""


@dataclasses.dataclass(frozen=True)
class Space:
    """Shape (without the world axis), type and range of an observation or an action."""

    shape: tuple[int, ...]
    dtype: type
    low: float
    high: float


class Observer:
    """Makes the observations of a task. All methods are pure.

    Attributes:
      spaces: of each observation. privileged_names: what each number of `privileged_state` means.
    """

    def __init__(
        self,
        names: Sequence[str],
        task: Task,
        robot: str,
        scene: Scene,
        model: StateModel,
        controller: Controller,
        reward: Reward,
        engine: Engine,
        image_size: int,
    ):
        """
        Raises:
          UnknownNameError: no such observation. EngineError: this engine makes no pictures.
        """
        for name in names:
            if name not in NAMES:
                raise UnknownNameError("observation", name, NAMES)
        self._names, self._horizon, self._controller = tuple(names), task.horizon, controller
        self._hands, self._reward = reward.hands, reward
        self._objects = np.array([scene.object_index(name) for name in task.objects_of_interest])
        self._ends = [locator(end, scene, model) for _, end in task.points(robot)]
        self.privileged_names = _privileged_names(task, robot)
        self._camera = None
        if set(names) & set(PICTURES):
            self._camera = _camera(engine, model, scene, names, image_size)
        every = {
            "proprioception": Space((len(controller.proprioception_names),), np.float32, -np.inf, np.inf),
            "privileged_state": Space((len(self.privileged_names),), np.float32, -np.inf, np.inf),
            "rgb": Space((image_size, image_size, 3), np.uint8, 0.0, 255.0),
            "depth": Space((image_size, image_size, 1), np.float32, 0.0, FARTHEST),
        }
        self.spaces = {name: every[name] for name in names}

    def vectors(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        controller_state: Any,
        measures: Measures,
        progress: Float[Array, "W"],
        steps: Array,
    ) -> dict[str, Array]:
        """The observations that are no pictures; numbers that are not finite are 0.

        Args:
          progress: share of the goal's literals that are as wanted. steps: agent steps since the reset.
        """
        found: dict[str, Array] = {}
        if "proprioception" in self._names:
            found["proprioception"] = self._controller.proprioception(view, controller_state)
        if "privileged_state" in self._names:
            found["privileged_state"] = self._privileged(view, states, measures, progress, steps)
        return {name: jnp.nan_to_num(jnp.asarray(a, jnp.float32), posinf=0.0, neginf=0.0) for name, a in found.items()}

    def pictures(self, physics: Physics, view: PhysicsView, states: ExtendedStates) -> dict[str, Array]:
        """The pictures that are wanted."""
        if self._camera is None:
            return {}
        images, found = self._camera(physics, view, states), {}
        if "rgb" in self._names:
            found["rgb"] = images.rgb[:, 0]
        if "depth" in self._names:
            depth = jnp.nan_to_num(images.depth[:, 0], posinf=FARTHEST)
            found["depth"] = jnp.clip(depth, 0.0, FARTHEST)[..., None]
        return found

    def _privileged(
        self, view: PhysicsView, states: ExtendedStates, measures: Measures, progress: Array, steps: Array
    ) -> Float[Array, "W p"]:
        agent, worlds = view.agent, view.object_com.shape[0]
        base_pos, base_quat = jnp.asarray(agent.base_pos)[:, :1], jnp.asarray(agent.base_quat)[:, :1]

        def moving(pos: Array, quat: Array, speed: Array) -> Float[Array, "W n 10"]:
            place, turn = relative_pose(base_pos, base_quat, jnp.asarray(pos), jnp.asarray(quat))
            return jnp.concatenate([place, turn, quat_rotate_inverse(base_quat, jnp.asarray(speed))], axis=-1)

        hands, objects = self._hands, self._objects
        of_hands = moving(agent.hand_pos[:, hands], agent.hand_quat[:, hands], agent.hand_linvel[:, hands])
        of_objects = moving(view.object_com[:, objects], view.object_quat[:, objects], view.object_linvel[:, objects])
        scalars = [
            jnp.asarray(states.max_temperature)[:, objects] / DEGREES,
            jnp.asarray(states.wetness)[:, objects],
            jnp.asarray(states.sliced)[:, objects],
            jnp.asarray(states.toggled_on)[:, objects],
        ]
        ends = []
        for locate in self._ends:
            pos, there = locate(view, states)
            own = quat_rotate_inverse(base_quat[:, 0], pos - base_pos[:, 0])
            ends.append(jnp.where(there[:, None], own, 0.0))
        columns = [
            of_hands.reshape(worlds, -1),
            of_objects.reshape(worlds, -1),
            *[jnp.asarray(s, jnp.float32) for s in scalars],
            *ends,
            measures.distances,
            self._reward.holding(view).astype(jnp.float32),
            measures.stains[:, None] / NUM_PARTICLES,
            jnp.asarray(progress, jnp.float32)[:, None],
            1.0 - jnp.asarray(steps, jnp.float32)[:, None] / self._horizon,
        ]
        return jnp.concatenate(columns, axis=1)


def _privileged_names(task: Task, robot: str) -> tuple[str, ...]:
    hands = [f"hand_{h}" for h in task.acts(robot).hands]
    moving = [*(f"pos_{a}" for a in "xyz"), *(f"quat_{a}" for a in "wxyz"), *(f"velocity_{a}" for a in "xyz")]
    objects, distances = task.objects_of_interest, range(len(task.distances))
    return (
        *(f"{hand}_{n}" for hand in hands for n in moving),
        *(f"{obj}_{n}" for obj in objects for n in moving),
        *(f"{obj}_{n}" for n in ("max_temperature", "wetness", "sliced", "toggled_on") for obj in objects),
        *(f"end_{d}_{a}" for d in distances for a in "xyz"),
        *(f"distance_{d}" for d in distances),
        *(f"{hand}_holds" for hand in hands),
        *("stains", "goal_progress", "time_left"),
    )


def _camera(engine: Engine, model: StateModel, scene: Scene, names: Sequence[str], size: int) -> Any:
    if engine.name != "warp":
        raise EngineError(f"the {engine.name} engine makes no pictures for observations (take engine='warp')")
    from ig2mj.sensors.batch_camera import BatchCamera  # MJX-Warp is only loaded where pictures are made

    eye = scene.manifest.agents[0].camera
    if not eye:
        raise EngineError("the robot has no camera")
    return BatchCamera(engine, model, [eye], width=size, height=size, rgb="rgb" in names, depth="depth" in names)
