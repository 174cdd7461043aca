"""Images of one world of an environment, seen from next to the robot, with the looks of states.

Where a robot drives through rooms the camera moves along above it, and the goal is marked.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import mujoco
import numpy as np
from jaxtyping import Float, UInt8

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.images import HEIGHT, WIDTH
from ig2mj.looks import visual_of
from ig2mj.tasks.navigation.objective import NavigationObjective
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.task import Task
from ig2mj.viewer.offscreen import FreeView, render
from ig2mj.viewer.state_effects import effects
from ig2mj.viewer.state_marks import Mark, Tinter, draw_marks, marks, tint_of_objects

SIDES = (50.0, -50.0, 25.0, -25.0, 75.0, -75.0, 110.0, -110.0)
"""Degrees to the side of the robot's back at which cameras are tried."""

DISTANCE, ELEVATION = 1.7, -32.0
"""m from the point that is looked at, and degrees."""

FROM_ABOVE, DOWN, UP = 4.0, -75.0, 0.5
"""The same for a camera that moves along, and m above the floor of the point that it looks at."""

GOAL_COLOUR, GOAL_THICK = (0.1, 0.9, 0.2, 0.5), 0.01
"""Of the mark of a goal; half its height, m, where it lies on the floor."""


class EpisodeView:
    """See the module's text. The camera is chosen for each episode, by what is seen from several places."""

    def __init__(self, env: Environment, world: int = 0, width: int = WIDTH, height: int = HEIGHT):
        """
        Args:
          width, height: of every image, pixels.
        """
        assert env.core.rules is not None
        self._env, self._world, self._size = env, world, (width, height)
        self._states = env.core.rules.model
        self._objects = env.task.objects_of_interest if isinstance(env.task, Task) else ()
        self._moves_along = isinstance(env.task, NavigationTask)
        self._drawn: mujoco.MjData | None = None
        self._camera: FreeView | None = None
        self._episode = -1
        self._tinter: Tinter | None = None

    def __call__(
        self,
        state: EnvState,
        qpos: Float[np.ndarray, "nq"] | None = None,
        camera: int | str | FreeView | Callable[[mujoco.MjModel, mujoco.MjData], FreeView] | None = None,
    ) -> UInt8[np.ndarray, "Y X 3"]:
        """An image of a state.

        Args:
          qpos: positions in place of those of the state. camera: in place of the one chosen for the episode, or a
            function that gives it for the model that is drawn, with poses.

        Raises:
          MissingDependencyError: nothing can draw here.
        """
        visual = visual_of(self._env.scene)
        world_model, data = self._env.core.engine.to_mujoco(state.batch.world.physics, self._world)
        drawn = self._drawn
        if drawn is None or self._tinter is None:
            drawn = self._drawn = mujoco.MjData(world_model)
            self._tinter = Tinter(visual.model, visual.owner)
        drawn.qpos[:] = data.qpos if qpos is None else qpos
        mujoco.mj_forward(world_model, drawn)
        if camera is None:
            camera = self._of_episode(world_model, drawn, state)
        states, view = state.batch.world.states, state.batch.world.view
        found = [*marks(self._states, states, view, self._world), *self._goal_marks(state)]
        found += effects(self._states, states, view, self._world, float(data.time))
        width, height = self._size
        seen = visual.data(world_model, drawn)
        if callable(camera):
            camera = camera(visual.model, seen)
        with self._tinter.shown(tint_of_objects(self._states, states, self._world)):
            return render(
                visual.model, seen, camera, width=width, height=height, decorate=lambda scene: draw_marks(scene, found)
            )

    def _of_episode(self, model: mujoco.MjModel, drawn: mujoco.MjData, state: EnvState) -> FreeView:
        episode = int(np.asarray(state.batch.episode)[self._world])
        if self._camera is None or episode != self._episode:
            self._camera, self._episode = self._best_view(model, drawn, state), episode
        if not self._moves_along:
            return self._camera
        return dataclasses.replace(self._camera, lookat=_above(drawn.xpos[self._env.scene.tables.agent_body[0]]))

    def _goal_marks(self, state: EnvState) -> list[Mark]:
        """A disc on the floor, or a ball in the air, within which the goal is reached."""
        objective, task = self._env.objective, self._env.task
        if not isinstance(objective, NavigationObjective) or not isinstance(task, NavigationTask):
            return []
        goal = objective.goal(state.measures)
        if goal is None:
            return []
        pos, ball = np.array(np.asarray(goal)[self._world], float), task.goal == "reach"
        kind = mujoco.mjtGeom.mjGEOM_SPHERE if ball else mujoco.mjtGeom.mjGEOM_CYLINDER
        size = (task.tolerance, 0.0 if ball else GOAL_THICK, 0.0)
        return [Mark(kind, size, pos, np.eye(3), GOAL_COLOUR)]

    def _best_view(self, model: mujoco.MjModel, data: mujoco.MjData, state: EnvState) -> FreeView:
        """Of the cameras next to the robot, the one that sees most of it and of what the task is about."""
        env = self._env
        agent, tables = state.batch.world.view.agent, env.scene.tables
        base, (w, x, y, z) = np.asarray(agent.base_pos)[self._world, 0], np.asarray(agent.base_quat)[self._world, 0]
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        ahead = (float(base[0]) + 0.5 * math.cos(yaw), float(base[1]) + 0.5 * math.sin(yaw), 0.8)
        objects = [env.scene.object_index(name) for name in self._objects]
        requested = np.isin(tables.body_object[model.geom_bodyid], objects)
        hands = np.isin(tables.body_hand[model.geom_bodyid], np.flatnonzero(tables.hand_agent == 0))
        middle, distance, elevation = ahead, DISTANCE, ELEVATION
        if self._moves_along:
            hands = tables.body_agent[model.geom_bodyid] == 0
            middle, distance, elevation = _above(base), FROM_ABOVE, DOWN

        def seen(view: FreeView) -> float:
            ids = render(model, data, view, width=160, height=120, segmentation=True)
            geoms = ids[ids >= 0]
            first = np.isin(tables.body_object[model.geom_bodyid[geoms]], objects[:1])
            return float(min(requested[geoms].sum(), 800) + 3 * hands[geoms].sum() + 5 * first.sum())

        views = [FreeView(middle, distance, math.degrees(yaw) + side, elevation) for side in SIDES]
        return max(views, key=seen)


def _above(base: np.ndarray) -> tuple[float, float, float]:
    """What a camera that moves along looks at."""
    return float(base[0]), float(base[1]), float(base[2]) + UP
