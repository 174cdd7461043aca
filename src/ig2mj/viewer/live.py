"""`LiveWindow`: MuJoCo's window on a world that a program steps, such as `simulation.agent.do("grasp", "apple_0")`.

    with simulation.viewer():
        simulation.agent.do("grasp", "apple_0")

The program runs as without a window, in real time; the window's own keys pause it and write what overlays show.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Sequence
from typing import Any

import mujoco

from ig2mj.looks import visual_of
from ig2mj.scene.scene import Scene
from ig2mj.viewer import interactive
from ig2mj.viewer.interactive import ViewerState
from ig2mj.viewer.label_space import Sight
from ig2mj.viewer.overlays import Overlay, default_overlays
from ig2mj.viewer.overview import home_overview

POLL = 0.03
"""s between two looks at the keys while the program is paused."""


class LiveWindow:
    """See the module's text; a context manager. Called after each control step."""

    def __init__(
        self,
        scene: Scene,
        data: Callable[[], mujoco.MjData],
        *,
        overlays: Sequence[Overlay] | None = None,
        step_time: float = 1 / 30,
    ):
        """
        Args:
          data: the state now. overlays: what is written over the image; None: `default_overlays(scene)`.
          step_time: simulated seconds of a control step; steps are paced to real time.
        """
        self._scene, self._data, self._step_time = scene, data, step_time
        self._state = ViewerState(default_overlays(scene) if overlays is None else overlays)
        self._keys: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._visual = visual_of(scene)
        self._handle: Any = None
        self._due = 0.0

    def __enter__(self) -> LiveWindow:
        """Raises MissingDependencyError: there is no display."""
        now = self._data()
        shown = self._visual.data(self._scene.model, now)
        self._opened = interactive.launch_window(self._visual.model, shown, self._keys.put, True)
        self._handle = self._opened.__enter__()
        interactive.look_at(self._handle.cam, home_overview(self._scene, now))
        self._due = time.monotonic()
        self._draw()
        return self

    def __exit__(self, *error: Any) -> None:
        self._opened.__exit__(*error)
        self._handle = None

    def __call__(self) -> None:
        """Shows the world; returns when the next control step is due. A window that was closed shows nothing."""
        if self._handle is None or not self._handle.is_running():
            return
        self._draw()
        while self._handle.is_running():
            while not self._keys.empty():
                self._state.press(self._keys.get())
                self._draw()
            if self._state.wants_step():
                break
            time.sleep(POLL)
            self._due = time.monotonic()
        self._due += self._step_time
        time.sleep(max(0.0, self._due - time.monotonic()))
        self._due = max(self._due, time.monotonic() - self._step_time)

    def _draw(self) -> None:
        now = self._data()
        with self._handle.lock():
            self._visual.data(self._scene.model, now)  # what the window has
            sight = Sight.of_window(self._handle, self._scene.model.vis.global_.fovy)
            self._state.draw_labels(now, self._handle.user_scn, sight)
            texts = self._state.texts(now)
        self._handle.set_texts(texts)
        self._handle.sync()
