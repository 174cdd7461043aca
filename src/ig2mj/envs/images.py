"""`Environment.render`: images of worlds, from a state, from a list of states, or from a recording.

What draws (`ig2mj.viewer.env_images`) is built on environments, so it is found by name when the first image is made.
"""

from __future__ import annotations

import os
import pkgutil
import typing
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8

from ig2mj.envs.state import EnvState

RENDERER = "ig2mj.viewer.env_images:Renderer"

WIDTH, HEIGHT = 640, 480
"""Pixels of an image unless other numbers are asked for."""


class StateImages:
    """Part of `Environment`."""

    _renderer: Any = None

    def render(
        self,
        source: EnvState | Sequence[EnvState] | str | os.PathLike | Any,
        world: int = 0,
        camera: Any = None,
        *,
        width: int = WIDTH,
        height: int = HEIGHT,
        run: int = 0,
    ) -> UInt8[np.ndarray, "Y X 3"] | UInt8[np.ndarray, "T Y X 3"]:
        """Images of one world, with the colours of states (burnt, soaked, ...), dust, stains and water.

        Rendering takes OpenGL, or Warp's ray caster where there is none, and about 10 ms an image; it changes no state.
        Observations of a robot's own cameras are `observations=("rgb", ...)` of `ig2mj.make`, for all worlds at once.

        Args:
          source: a state; or a trajectory: a list of states, which `fork` copies before they are stepped; or a
            recording (`ig2mj.record`), as file, as `ig2mj.demos.Recording`, or by the name of one that ships.
          world: which world, from 0; a recording's run has its own.
          camera: name of a camera of the scene or of its robots, or an `ig2mj.viewer.FreeView`; None: next to the
            robot, from where most of it and of the task's objects is visible, chosen at the start of each episode.
          width, height: pixels.
          run: which run of a recording, from 0.

        Returns:
          uint8 [height, width, 3] of a state, row 0 on top; [T, height, width, 3] of a trajectory.

        Raises:
          StaleStateError: a state was stepped or reset since. UnknownNameError: no such camera or recording.
          EngineError: no such world or run. InputError: a recording cannot be read, or belongs to another environment.
          MissingDependencyError: nothing can render on this machine.
        """
        if self._renderer is None:
            self._renderer = pkgutil.resolve_name(RENDERER)(typing.cast(Any, self))
        return self._renderer(source, world, camera, width, height, run)
