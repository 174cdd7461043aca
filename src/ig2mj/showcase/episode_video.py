"""A video of an episode: one world of an environment, seen from next to the robot, in real time."""

from __future__ import annotations

import os
import pathlib

import mujoco
import numpy as np
from jaxtyping import UInt8

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.showcase.film_strip import ENDINGS, FilmStrip
from ig2mj.tasks.task import Task
from ig2mj.viewer.captions import caption
from ig2mj.viewer.episode_view import HEIGHT, WIDTH, EpisodeView
from ig2mj.viewer.establishing import establishing_shot
from ig2mj.viewer.follow_camera import FollowCamera
from ig2mj.viewer.video import VIDEO_SIZE, VideoWriter

BETWEEN = 3
"""Frames of an agent step; positions between two steps are interpolated."""

ESTABLISHING = 1.2
"""s of the first shot, in which the robot is seen in its room."""

JUMP = 0.3
"""m or rad of a step beyond which nothing is interpolated: a reset, or what slicing moves."""

LAST = 30
"""Frames for which the end of an episode stays."""


class EpisodeVideo:
    """Writes one world of an environment to a video file; `see` is called with every state (`envs.rollout.Watch`)."""

    def __init__(
        self, file: str | os.PathLike, env: Environment, world: int = 0, *, size: tuple[int, int] | None = None
    ):
        """
        Args:
          file: its ending says the format: a video (.mp4, .gif), or a strip of five of its frames (.png, .jpg).
          size: pixels, width and height; None: those of `viewer.video.VIDEO_SIZE`, of a strip those of `EpisodeView`.

        Raises:
          InputError: another ending. MissingDependencyError: there is no ffmpeg.
        """
        assert env.core.rules is not None
        self._env, self._world, self._model_of_states = env, world, env.core.rules.model
        self._objects = env.task.objects_of_interest if isinstance(env.task, Task) else ()
        strip = pathlib.Path(file).suffix.lower() in ENDINGS
        self._size = size or ((WIDTH, HEIGHT) if strip else VIDEO_SIZE)
        self._video = FilmStrip(file) if strip else VideoWriter(file, *self._size, BETWEEN / env.period)
        self._view = EpisodeView(env, world, *self._size)
        tables = env.scene.tables
        follows = not strip and isinstance(env.task, Task) and len(tables.agent_body) > 0
        self._camera = FollowCamera(tables) if follows else None
        self._matter = [env.scene.object_index(name) for name in self._objects]
        self._before: np.ndarray | None = None
        self._over = False
        self._last: UInt8[np.ndarray, "Y X 3"] | None = None
        self._told = ""

    def see(self, state: EnvState) -> None:
        """Adds the frames up to this state. Nothing after the end of the world's first episode."""
        if self._over:
            return
        model, data = self._env.core.engine.to_mujoco(state.batch.world.physics, self._world)
        now = data.qpos.copy()
        before = now if self._before is None else self._before
        self._over = bool(np.asarray(state.done)[self._world])
        if self._over and "final_obs" in state.info:  # the world is in its next episode already
            self._end(state)
            return
        if self._before is None and self._camera is not None:
            wide = self._view(state, now, establishing_shot(self._env.scene, state, self._world))
            for _ in range(round(ESTABLISHING * BETWEEN / self._env.period)):
                self._video.add(caption(wide, self._env.task.name))
        change = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, change, 1.0, before, now)
        smooth = np.abs(change).max(initial=0.0) < JUMP
        for part in range(1, BETWEEN + 1):
            pose = now.copy()
            if smooth and part < BETWEEN:
                pose = before.copy()
                mujoco.mj_integratePos(model, pose, change, part / BETWEEN)
            self._video.add(self._frame(pose, state))
        self._before = now
        if self._over:
            self._end(state)

    def _end(self, state: EnvState) -> None:
        """The last image stays for a while, with how it ended."""
        if self._last is not None:
            won = np.asarray(state.info["success"])[self._world]
            frame = caption(self._last, f"{self._told}   {'done' if won else 'not done'}")
            for _ in range(LAST):
                self._video.add(frame)

    def close(self) -> None:
        """Ends the file. Raises EngineError if ffmpeg could not write it."""
        self._video.close()

    def _frame(self, qpos: np.ndarray, state: EnvState) -> UInt8[np.ndarray, "Y X 3"]:
        camera = self._camera
        view = None if camera is None else lambda model, data: camera(model, data, self._matter)
        self._last = pixels = self._view(state, qpos, view)
        self._told = self._words(state)
        return caption(pixels, self._told)

    def _words(self, state: EnvState) -> str:
        """The task, the time, and a number about its first object."""
        env, world = self._env, self._world
        steps = int(np.asarray(state.info["steps"])[world])
        words = [env.task.name, f"{steps * env.period:.1f} s"]
        first = next(iter(self._objects), None)
        if first is None:
            return "   ".join(words)
        index, states = env.scene.object_index(first), state.batch.world.states
        if self._model_of_states.parameters.thermal[index]:
            words.append(f"{first.rpartition('_')[0]} {float(np.asarray(states.temperature)[world, index]):.0f} °C")
        return "   ".join(words)
