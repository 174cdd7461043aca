"""The rows of a pool, one page each: in the viewer, or one of them as an image. Nothing is simulated."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import jax
import mujoco
import numpy as np

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.scene.scene import Scene
from ig2mj.viewer.overlays import Label, default_overlays
from ig2mj.viewer.overview import home_overview
from ig2mj.worlds.pool import Pool


class PoolPages:
    """A pool as a world that can be looked at: `scene`, `data`, `step` and `reset`, as the viewer asks.

    Attributes:
      scene: the scene that the pool belongs to. at: the row that `data` shows.
    """

    def __init__(self, scene: Scene, pool: Pool, at: int = 0):
        """Shows a row."""
        self.scene, self.pool = scene, pool
        self._engine = NativeEngine(scene)
        self._physics = self._engine.reset()
        self.show(at)

    def __len__(self) -> int:
        return self.pool.size

    @property
    def data(self) -> mujoco.MjData:
        """The row's poses."""
        return self._engine.to_mujoco(self._physics, 0)[1]

    def show(self, row: int) -> None:
        """Turns to a row; beyond the last one, the first comes again."""
        self.at = row % len(self)
        one = jax.tree.map(lambda a: np.asarray(a[self.at]), self.pool.physics)
        self._physics = self._engine.load(self._physics, one)

    def step(self) -> None:
        """Turns to the next row."""
        self.show(self.at + 1)

    def reset(self) -> None:
        """Back to the first row."""
        self.show(0)

    def launch(self, **options: Any) -> None:
        """Opens the window, paused: the right arrow turns the page; see `ig2mj.viewer.interactive.open_viewer`."""
        from ig2mj.viewer import interactive

        interactive.launch(self, overlays=[*default_overlays(self.scene), _RowNumber(self)], paused=True, **options)

    def picture(
        self, file: str | os.PathLike, camera: Any = None, *, size: tuple[int, int] = (1280, 960), **options: Any
    ) -> None:
        """Writes the row as an image.

        Args:
          camera, options: as of `ig2mj.viewer.offscreen.render`; None: an overview of the home.

        Raises:
          MissingDependencyError: there is nothing to draw with.
        """
        from PIL import Image

        from ig2mj.looks import visual_of
        from ig2mj.viewer.offscreen import render

        view = home_overview(self.scene, self.data) if camera is None else camera
        visual = visual_of(self.scene)
        data = visual.data(self.scene.model, self.data)
        image = render(visual.model, data, view, width=size[0], height=size[1], **options)
        Image.fromarray(image).save(file)


class _RowNumber:
    """Overlay: which row is shown."""

    title = "row"

    def __init__(self, pages: PoolPages):
        self._pages = pages

    def labels(self, data: mujoco.MjData) -> Sequence[Label]:
        return []

    def lines(self, data: mujoco.MjData) -> Sequence[tuple[str, str]]:
        return [("row", f"{self._pages.at} of {len(self._pages)}")]
