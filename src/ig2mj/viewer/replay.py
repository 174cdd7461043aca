"""Replaying a dump: the last steps of a world that went wrong, in the viewer, as an image or as a video.

Nothing is simulated: every recorded step is shown as it was. `ig2mj.worlds.debug` writes dumps.

Axis: T recorded steps.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Int

from ig2mj.engine.snapshot import Snapshot, closed_circles
from ig2mj.errors import EngineError, InputError
from ig2mj.scene.scene import PLAIN, Scene
from ig2mj.viewer.overlays import Label, default_overlays
from ig2mj.viewer.overview import home_overview
from ig2mj.worlds.recorder import read_dump

FRAMES_PER_SECOND = 30
"""Control steps of a second: a video runs at the speed of the world."""


class Replay:
    """A dump as a world that can be looked at: `scene`, `data`, `step` and `reset`, as the viewer asks.

    Attributes:
      scene: the scene as it was recorded, with its agents. note: the dump's header.
      at: the step that `data` shows, 0 the oldest.
    """

    def __init__(self, scene: Scene, file: str | os.PathLike):
        """Opens a dump of the scene and shows its first step. Raises InputError."""
        frames, model, self.note = read_dump(file, scene.name)
        self.frames: Snapshot = frames
        self.scene = _with_model(scene, model, file)
        self.data = mujoco.MjData(model)
        self.at = 0
        self.show(0)

    def __len__(self) -> int:
        return len(self.frames.qpos)

    def show(self, step: int) -> None:
        """Puts a recorded step into `data`: poses, and who sleeps."""
        self.at = min(max(step, 0), len(self) - 1)
        data, frames = self.data, self.frames
        for name in ("qpos", "qvel", "act", "ctrl", "eq_active", "mocap_pos", "mocap_quat"):
            getattr(data, name)[:] = np.asarray(getattr(frames, name))[self.at]
        data.time = float(np.asarray(frames.time)[self.at])
        # Poses only: forces of a state that is not finite would be nonsense, and take for ever.
        mujoco.mj_kinematics(self.scene.model, data)
        mujoco.mj_comPos(self.scene.model, data)
        mujoco.mj_camlight(self.scene.model, data)
        data.tree_asleep[:] = closed_circles(np.asarray(frames.tree_asleep)[self.at])

    def step(self) -> None:
        """Goes on to the next recorded step; stays at the last one."""
        self.show(self.at + 1)

    def reset(self) -> None:
        """Back to the oldest step."""
        self.show(0)

    def show_last(self) -> int:
        """Shows the last step all of whose positions are numbers, and says which.

        Raises:
          EngineError: there is none.
        """
        self.show(int(self._finite_steps()[-1]))
        return self.at

    def launch(self, **options: Any) -> None:
        """Opens the window; see `ig2mj.viewer.interactive.open_viewer`."""
        from ig2mj.viewer import interactive

        interactive.launch(self, overlays=[*default_overlays(self.scene), ReplayProgress(self)], **options)

    def video(self, file: str | os.PathLike, camera: Any = None, *, width: int = 640, height: int = 480) -> int:
        """Writes all finite steps as a video and says how many.

        Args:
          file: its ending says the format (.mp4, .gif).
          camera: as of `ig2mj.viewer.offscreen.render`; None: an overview.

        Raises:
          MissingDependencyError: there is nothing to draw with, or no ffmpeg. InputError: no such format.
          EngineError: ffmpeg cannot write the file.
        """
        from ig2mj.looks import visual_of
        from ig2mj.viewer.offscreen import render
        from ig2mj.viewer.video import VideoWriter

        good = self._finite_steps()
        with VideoWriter(file, width, height, FRAMES_PER_SECOND) as video:
            for step in good:
                self.show(int(step))
                view = home_overview(self.scene, self.data) if camera is None else camera
                visual = visual_of(self.scene)
                data = visual.data(self.scene.model, self.data)
                video.add(render(visual.model, data, view, width=width, height=height))
        return len(good)

    def _finite_steps(self) -> Int[np.ndarray, "N"]:
        """Steps all of whose positions are numbers. Raises EngineError if there is none."""
        good = np.flatnonzero(np.isfinite(np.asarray(self.frames.qpos)).all(1))
        if not len(good):
            raise EngineError("no step of the dump has finite positions: there is nothing to show")
        return good


def _with_model(scene: Scene, model: mujoco.MjModel, file: str | os.PathLike) -> Scene:
    """The scene with a model that may have agents behind the scene's own bodies. Raises InputError."""
    bodies, geoms = len(scene.tables.body_object), len(scene.tables.geom_object)
    if model.nbody < bodies or model.ngeom < geoms or (model.geom_type[:geoms] != scene.model.geom_type[:geoms]).any():
        raise InputError(file, "was dumped from another version of the scene", fix="give the scene it was dumped from")
    more = {"body_object": model.nbody - bodies, "body_agent": model.nbody - bodies, "body_hand": model.nbody - bodies}
    more |= {"geom_object": model.ngeom - geoms, "actuator_agent": model.nu - len(scene.tables.actuator_agent)}
    padded = {n: np.pad(getattr(scene.tables, n), (0, count), constant_values=-1) for n, count in more.items()}
    for name in ("body_rests", "body_rest_pos", "body_rest_quat"):  # of what belongs to objects
        column = getattr(scene.tables, name)
        padded[name] = np.concatenate([column, np.zeros((model.nbody - bodies, *column.shape[1:]), column.dtype)])
    tables = dataclasses.replace(scene.tables, **padded)
    looks = scene.looks if model.nbody == bodies else PLAIN  # files of the scene have no further agents
    return dataclasses.replace(scene, model=model, tables=tables, looks=looks)


class ReplayProgress:
    """Overlay: which recorded step is shown, and why the world was dumped."""

    title = "replay"

    def __init__(self, replay: Replay):
        self._replay = replay

    def labels(self, data: mujoco.MjData) -> Sequence[Label]:
        return []

    def lines(self, data: mujoco.MjData) -> Sequence[tuple[str, str]]:
        replay = self._replay
        return [("step", f"{replay.at + 1} of {len(replay)}"), ("dumped for", str(replay.note.get("text", "")))]
