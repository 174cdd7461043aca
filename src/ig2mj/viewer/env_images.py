"""What `Environment.render` does: images of states, of lists of states, and of recordings."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8

from ig2mj.demos.reader import Recording
from ig2mj.demos.replay import Replayer
from ig2mj.demos.shipped import find_recording
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import EngineError
from ig2mj.viewer.episode_view import EpisodeView

Images = UInt8[np.ndarray, "T Y X 3"]


class Renderer:
    """Images of an environment's worlds. One view of each world and size is kept, with its camera."""

    def __init__(self, env: Environment):
        self._env, self._views = env, dict[tuple[Any, ...], EpisodeView]()

    def __call__(
        self, source: Any, world: int, camera: Any, width: int, height: int, run: int
    ) -> UInt8[np.ndarray, "Y X 3"] | Images:
        """See `Environment.render`."""
        size = width, height
        if isinstance(source, EnvState):
            return self._image(source, world, camera, size)
        if isinstance(source, str | os.PathLike):
            with Recording(find_recording(source)) as recording:
                return self._of_run(recording, run, camera, size)
        if isinstance(source, Recording):
            return self._of_run(source, run, camera, size)
        if isinstance(source, Sequence) and all(isinstance(state, EnvState) for state in source):
            return _stacked([self._image(state, world, camera, size) for state in source], size)
        raise EngineError(
            f"images are of a state, of a list of states or of a recording, not of {type(source).__name__}"
        )

    def _image(self, state: EnvState, world: int, camera: Any, size: tuple[int, int]) -> UInt8[np.ndarray, "Y X 3"]:
        count = self._env.num_worlds
        if isinstance(world, bool) or not isinstance(world, int | np.integer) or not 0 <= world < count:
            raise EngineError(f"world = {world!r}: this environment has worlds 0 to {count - 1}")
        self._env.check(state)
        key = world, size
        if key not in self._views:
            self._views[key] = EpisodeView(self._env, int(world), *size)
        return self._views[key](state, camera=camera)

    def _of_run(self, recording: Recording, number: int, camera: Any, size: tuple[int, int]) -> Images:
        """Images of one run: by state where the file has every frame, else by action."""
        if not 0 <= number < len(recording.runs):
            raise EngineError(f"run = {number!r}: the recording has runs 0 to {len(recording.runs) - 1}")
        run = recording.runs[number]
        kept = run.kept(0, min(3, run.frames)).all()
        images: list[np.ndarray] = []

        def watch(state: EnvState, going: Any, frame: int) -> None:
            images.append(self._image(state, run.world, camera, size))

        Replayer(recording, "state" if kept else "action", self._env)(watch=watch, runs=[run])
        return _stacked(images, size)


def _stacked(images: list[np.ndarray], size: tuple[int, int]) -> Images:
    return np.stack(images) if images else np.empty((0, size[1], size[0], 3), np.uint8)
