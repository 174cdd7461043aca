"""A film of an episode: one world of an environment, seen from beside the robot, in real time.

Where a robot drives through rooms the camera goes along above it, and the goal is marked.
"""

from __future__ import annotations

import dataclasses
import math
import os
import pathlib

import mujoco
import numpy as np
from jaxtyping import UInt8

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.showcase.cooking_pictures import caption_at, font
from ig2mj.showcase.film_strip import ENDINGS, FilmStrip
from ig2mj.tasks.navigation.objective import NavigationObjective
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.task import Task
from ig2mj.viewer.film import Film
from ig2mj.viewer.offscreen import FreeView, render
from ig2mj.viewer.state_marks import Mark, Tinter, draw_marks, marks, tint_of_objects

WIDTH, HEIGHT = 640, 480
"""Pixels."""

BETWEEN = 2
"""Frames of an agent step of 1/10 s; positions between two steps are interpolated."""

JUMP = 0.3
"""m or rad of a step beyond which nothing is interpolated: a reset, or what slicing moves."""

SIDES = (50.0, -50.0, 25.0, -25.0, 75.0, -75.0, 110.0, -110.0)
"""Degrees to the side of the robot's back at which cameras are tried."""

DISTANCE, ELEVATION = 1.7, -32.0
"""m from what is looked at, and degrees."""

FROM_ABOVE, DOWN, UP = 4.0, -75.0, 0.5
"""The same for a camera that goes along, and m above the floor of what it looks at."""

GOAL_COLOUR, GOAL_THICK = (0.1, 0.9, 0.2, 0.5), 0.01
"""Of the mark of a goal; half its height, m, where it lies on the floor."""

LAST = 15
"""Frames for which the end of an episode stays."""


class EpisodeFilm:
    """Writes one world of an environment to a film file; `see` is called with every state (`envs.rollout.Watch`)."""

    def __init__(self, file: str | os.PathLike, env: Environment, world: int = 0):
        """
        Args:
          file: its ending says the format: a film (.mp4, .gif), or a strip of five of its frames (.png, .jpg).

        Raises:
          InputError: another ending. MissingDependencyError: there is no ffmpeg.
        """
        assert env.core.rules is not None
        self._env, self._world, self._model_of_states = env, world, env.core.rules.model
        self._objects = env.task.objects_of_interest if isinstance(env.task, Task) else ()
        self._goes_along = isinstance(env.task, NavigationTask)
        strip = pathlib.Path(file).suffix.lower() in ENDINGS
        self._film = FilmStrip(file) if strip else Film(file, WIDTH, HEIGHT, BETWEEN / ACTION_PERIOD)
        self._drawn: mujoco.MjData | None = None
        self._camera: FreeView | None = None
        self._tinter: Tinter | None = None
        self._over = False
        self._letters = font(18)
        self._last: UInt8[np.ndarray, "Y X 3"] | None = None
        self._told = ""

    def see(self, state: EnvState) -> None:
        """Adds the frames up to this state. Nothing after the end of the world's first episode."""
        if self._over:
            return
        model, data = self._env.core.engine.to_mujoco(state.batch.world.physics, self._world)
        now = data.qpos.copy()
        drawn = self._drawn
        if drawn is None:
            drawn = self._drawn = mujoco.MjData(model)
            drawn.qpos[:] = now
            mujoco.mj_forward(model, drawn)
            self._camera = self._best_view(model, drawn, state)
            self._tinter = Tinter(model, self._env.scene.tables)
        before = drawn.qpos.copy()
        self._over = bool(np.asarray(state.done)[self._world])
        if self._over and "final_obs" in state.info:  # the world is in its next episode already
            self._end(state)
            return
        change = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, change, 1.0, before, now)
        smooth = np.abs(change).max(initial=0.0) < JUMP
        for part in range(1, BETWEEN + 1):
            pose = now.copy()
            if smooth and part < BETWEEN:
                pose = before.copy()
                mujoco.mj_integratePos(model, pose, change, part / BETWEEN)
            self._film.add(self._frame(model, pose, state))
        if self._over:
            self._end(state)

    def _end(self, state: EnvState) -> None:
        """The last picture stays for a while, with how it ended."""
        if self._last is not None:
            won = np.asarray(state.info["success"])[self._world]
            frame = self._captioned(self._last, f"{self._told}   {'done' if won else 'not done'}")
            for _ in range(LAST):
                self._film.add(frame)

    def close(self) -> None:
        """Ends the file. Raises EngineError if ffmpeg could not write it."""
        self._film.close()

    def _frame(self, model: mujoco.MjModel, qpos: np.ndarray, state: EnvState) -> UInt8[np.ndarray, "Y X 3"]:
        drawn = self._drawn
        assert drawn is not None and self._tinter is not None
        drawn.qpos[:] = qpos
        mujoco.mj_forward(model, drawn)
        states, view = state.batch.world.states, state.batch.world.view
        found = [*marks(self._model_of_states, states, view, self._world), *self._goal_marks(state)]
        camera = self._camera
        if self._goes_along and camera is not None:
            camera = dataclasses.replace(camera, lookat=_above(drawn.xpos[self._env.scene.tables.agent_body[0]]))
        with self._tinter.shown(tint_of_objects(self._model_of_states, states, self._world)):
            self._last = pixels = render(
                model,
                drawn,
                camera,
                width=WIDTH,
                height=HEIGHT,
                decorate=lambda scene: draw_marks(scene, found),
            )
        self._told = self._words(state)
        return self._captioned(pixels, self._told)

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

    def _captioned(self, pixels: UInt8[np.ndarray, "Y X 3"], words: str) -> UInt8[np.ndarray, "Y X 3"]:
        from PIL import Image, ImageDraw

        picture = Image.fromarray(pixels)
        caption_at(ImageDraw.Draw(picture), (10, HEIGHT - 30), words, self._letters)
        return np.asarray(picture)

    def _words(self, state: EnvState) -> str:
        """The task, the time, and a number about its first object."""
        env, world = self._env, self._world
        steps = int(np.asarray(state.info["steps"])[world])
        words = [env.task.name, f"{steps * ACTION_PERIOD:.1f} s"]
        first = next(iter(self._objects), None)
        if first is None:
            return "   ".join(words)
        index, states = env.scene.object_index(first), state.batch.world.states
        if self._model_of_states.parameters.thermal[index]:
            words.append(f"{first.rpartition('_')[0]} {float(np.asarray(states.temperature)[world, index]):.0f} °C")
        return "   ".join(words)

    def _best_view(self, model: mujoco.MjModel, data: mujoco.MjData, state: EnvState) -> FreeView:
        """Of the cameras beside the robot, the one that sees most of it and of what the task is about."""
        env = self._env
        agent, tables = state.batch.world.view.agent, env.scene.tables
        base, (w, x, y, z) = np.asarray(agent.base_pos)[self._world, 0], np.asarray(agent.base_quat)[self._world, 0]
        yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        ahead = (float(base[0]) + 0.5 * math.cos(yaw), float(base[1]) + 0.5 * math.sin(yaw), 0.8)
        objects = [env.scene.object_index(name) for name in self._objects]
        wanted = np.isin(tables.body_object[model.geom_bodyid], objects)
        hands = np.isin(tables.body_hand[model.geom_bodyid], np.flatnonzero(tables.hand_agent == 0))
        middle, distance, elevation = ahead, DISTANCE, ELEVATION
        if self._goes_along:
            hands = tables.body_agent[model.geom_bodyid] == 0
            middle, distance, elevation = _above(base), FROM_ABOVE, DOWN

        def seen(view: FreeView) -> float:
            ids = render(model, data, view, width=160, height=120, segmentation=True)
            geoms = ids[ids >= 0]
            first = np.isin(tables.body_object[model.geom_bodyid[geoms]], objects[:1])
            return float(min(wanted[geoms].sum(), 800) + 3 * hands[geoms].sum() + 5 * first.sum())

        views = [FreeView(middle, distance, math.degrees(yaw) + side, elevation) for side in SIDES]
        return max(views, key=seen)


def _above(base: np.ndarray) -> tuple[float, float, float]:
    """What a camera that goes along looks at."""
    return float(base[0]), float(base[1]), float(base[2]) + UP
