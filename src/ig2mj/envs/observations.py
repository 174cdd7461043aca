"""What an agent of a task observes, by name.

| name | what | shape |
|---|---|---|
| `proprioception` | the robot of itself (`Controller.proprioception`) | [m] |
| `privileged_state` | ground truth, in the frame of the robot's base (`Objective.vectors`) | [p] |
| others of the task | such as iGibson's `task_obs` of navigation (`Objective.vectors`) | [n] |
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
from ig2mj.predicates.compile import GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.objective import Measures, Objective

PICTURES = ("rgb", "depth")

FARTHEST = 10.0
"""m: the end of the depth picture's range (spec/robots_tasks_sensors.md section 2.6)."""


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
      spaces: of each observation.
    """

    def __init__(
        self,
        names: Sequence[str],
        objective: Objective,
        scene: Scene,
        model: StateModel,
        controller: Controller,
        engine: Engine,
        image_size: int,
    ):
        """
        Raises:
          UnknownNameError: no such observation. EngineError: this engine makes no pictures.
        """
        vectors = {name: len(numbers) for name, numbers in objective.vectors.items()}
        known = ("proprioception", *vectors, *PICTURES)
        for name in names:
            if name not in known:
                raise UnknownNameError("observation", name, known)
        self._names, self._objective, self._controller = tuple(names), objective, controller
        self._camera = None
        if set(names) & set(PICTURES):
            self._camera = _camera(engine, model, scene, names, image_size)
        every = {
            "proprioception": Space((len(controller.proprioception_names),), np.float32, -np.inf, np.inf),
            **{name: Space((count,), np.float32, -np.inf, np.inf) for name, count in vectors.items()},
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
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Array]:
        """The observations that are no pictures; numbers that are not finite are 0. See `Objective.observe`."""
        found: dict[str, Array] = {}
        if "proprioception" in self._names:
            found["proprioception"] = self._controller.proprioception(view, controller_state)
        made = self._objective.observe(view, states, measures, status, time_left)
        found |= {name: array for name, array in made.items() if name in self._names}
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


def _camera(engine: Engine, model: StateModel, scene: Scene, names: Sequence[str], size: int) -> Any:
    if engine.name != "warp":
        raise EngineError(f"the {engine.name} engine makes no pictures for observations (take engine='warp')")
    from ig2mj.sensors.batch_camera import BatchCamera  # MJX-Warp is only loaded where pictures are made

    eye = scene.manifest.agents[0].camera
    if not eye:
        raise EngineError("the robot has no camera")
    return BatchCamera(engine, model, [eye], width=size, height=size, rgb="rgb" in names, depth="depth" in names)
