"""The interactive viewer: MuJoCo's own window, run at real time, with overlays and a few keys of ours.

MuJoCo's passive viewer draws; the simulation steps here, in the thread that called. Objects can be dragged and pushed
with the mouse (`ig2mj.viewer.mouse`).
"""

from __future__ import annotations

import os
import queue
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np

from ig2mj.errors import EngineError, MissingDependencyError
from ig2mj.looks import visual_of
from ig2mj.scene.scene import Scene
from ig2mj.viewer.label_space import Sight, off_texts, uncovered
from ig2mj.viewer.mouse import Mouse
from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.overlays import Drawing, Label, Overlay, default_overlays
from ig2mj.viewer.overview import home_overview
from ig2mj.viewer.state_marks import draw_marks

#: Keys that switch overlays on and off, in their order. MuJoCo's viewer uses 0 to 5 for groups of geoms, and nearly
#: all letters.
OVERLAY_KEYS = "6789"
#: GLFW's codes of the other keys.
_SPACE, _SLASH, _PUSH, _ENTER, _BACKSPACE, _RIGHT = 32, 47, ord("P"), 257, 259, 262
PREPARING = ("preparing", "states are compiled; once per machine and scene")
"""What the window says before the first step."""

_NO_DISPLAY = (
    "a window needs a display: set DISPLAY, use the browser (`ig2mj web NAME`), or write an image with"
    " `ig2mj view SCENE --image out.png`"
)


@runtime_checkable
class Looking(Protocol):
    """An overlay whose labels depend on what the camera sees; called before `labels`."""

    def look(self, data: mujoco.MjData, sight: Sight) -> None: ...


class ViewerState:
    """What the keys change: running or paused, help shown, overlays on.

    Attributes:
      overlays: in the order of their keys. shown: whether each is on. paused, help: as they say.
      steps: control steps asked for with the right arrow while paused. reset: go back to the start. push: push what is
        picked.
    """

    def __init__(self, overlays: Sequence[Overlay], paused: bool = False, more_keys: Sequence[tuple[str, str]] = ()):
        self.overlays, self._more_keys = list(overlays), list(more_keys)
        self.shown = [True] * len(self.overlays)
        self.paused, self.help, self.steps, self.reset, self.push = paused, False, 0, False, False

    def press(self, key: int) -> None:
        """Does what a key (GLFW code) stands for; other keys are MuJoCo's."""
        if key == _SPACE:
            self.paused = not self.paused
        elif key == _RIGHT and self.paused:
            self.steps += 1
        elif key == _BACKSPACE:
            self.reset = True
        elif key == _PUSH:
            self.push = True
        elif key in (_ENTER, _SLASH):
            self.help = not self.help
        elif 0 < key < 128 and chr(key) in OVERLAY_KEYS[: len(self.overlays)]:
            index = OVERLAY_KEYS.index(chr(key))
            self.shown[index] = not self.shown[index]

    def wants_step(self) -> bool:
        """Whether the next control step is to be done; uses up one that was asked for by key."""
        if self.paused and self.steps:
            self.steps -= 1
            return True
        return not self.paused

    def key_help(self) -> list[tuple[str, str]]:
        """The viewer's own keys and what they do."""
        rows = [
            ("Space", "pause, go on"),
            ("Right arrow", "one step, while paused"),
            ("Backspace", "back to the start"),
            ("Double-click", "pick an object"),
            ("Ctrl, right button", "drag what is picked"),
            ("P", "push what is picked"),
        ]
        rows += [(k, f"{o.title} on, off") for k, o in zip(OVERLAY_KEYS, self.overlays, strict=False)]
        rows += [("Enter or ?", "this list"), ("Tab", "MuJoCo's panel"), ("F1", "MuJoCo's keys")]
        return [*rows, ("Esc", "free camera")]

    def texts(self, data: mujoco.MjData) -> list[Any]:
        """The corner texts as `Handle.set_texts` takes them."""
        rows = [line for o, on in zip(self.overlays, self.shown, strict=True) if on for line in o.lines(data)]
        if self.paused:
            rows.append(("paused", "Space goes on"))
        font, corner = mujoco.mjtFontScale.mjFONTSCALE_150, mujoco.mjtGridPos
        texts = [(font, corner.mjGRID_TOPRIGHT, *_columns(rows))]
        if not self.help:
            return [*texts, (font, corner.mjGRID_BOTTOMLEFT, *_columns([("Enter or ?", "keys")]))]
        if not self._more_keys:
            return [*texts, (font, corner.mjGRID_BOTTOMLEFT, *_columns(self.key_help()))]
        texts.append((font, corner.mjGRID_BOTTOMLEFT, *_columns(self._more_keys)))  # two lists: one would be too high
        return [*texts, (font, corner.mjGRID_BOTTOMRIGHT, *_columns(self.key_help()))]

    def draw_labels(self, data: mujoco.MjData, scene: mujoco.MjvScene, sight: Sight | None = None) -> None:
        """Replaces the user geoms of `scene` by the marks and labels of the overlays that are on.

        Args:
          sight: what the camera sees, so that labels which would cover a nearer one give way; None: all are written.
        """
        scene.ngeom = 0
        labels: list[Label] = []
        for overlay, on in zip(self.overlays, self.shown, strict=True):
            if isinstance(overlay, Drawing):
                draw_marks(scene, overlay.marks(data)) if on else overlay.hide()
            if on and sight is not None and isinstance(overlay, Looking):
                overlay.look(data, sight)
            labels += overlay.labels(data) if on else ()
        if sight is not None:
            labels = uncovered(off_texts(labels, sight, self.texts(data)), sight)
        for label in labels:
            if scene.ngeom >= scene.maxgeom:
                return
            geom = scene.geoms[scene.ngeom]
            mujoco.mjv_initGeom(
                geom,
                mujoco.mjtGeom.mjGEOM_LABEL,
                np.zeros(3),
                np.array(label.pos, dtype=float),
                np.eye(3).ravel(),
                np.array(label.rgba, dtype=np.float32),
            )
            geom.label = label.text[:99]  # mjvGeom holds 100 bytes
            scene.ngeom += 1


@runtime_checkable
class World(Protocol):
    """What `launch` asks of a world; `ig2mj.Simulation` is one. `data` may be another object after every step."""

    @property
    def scene(self) -> Scene: ...

    @property
    def data(self) -> mujoco.MjData: ...

    def step(self) -> Any: ...

    def reset(self) -> Any: ...


def launch(world: World, **options: Any) -> None:
    """Opens the window on a world and runs it until the window is closed; `options` as in `open_viewer`.

    A world that has a method `prepare` is prepared while the window says so.
    """
    options.setdefault("prepare", getattr(world, "prepare", None))
    shown = world.data

    def show() -> None:
        if world.data is not shown:  # an engine that hands out copies
            mujoco.mj_copyData(shown, world.scene.model, world.data)

    def step() -> None:
        world.step()
        show()

    def reset() -> None:
        world.reset()
        show()

    open_viewer(world.scene, shown, step, reset=reset, **options)


def open_viewer(
    scene: Scene,
    data: mujoco.MjData,
    step: Callable[[], None],
    *,
    reset: Callable[[], None] | None = None,
    overlays: Sequence[Overlay] | None = None,
    step_time: float = 1 / 30,
    paused: bool = False,
    key_callback: Callable[[int], None] | None = None,
    prepare: Callable[[], object] | None = None,
    more_keys: Sequence[tuple[str, str]] = (),
    camera: Callable[[], FreeView | None] | None = None,
    own_letters: bool = False,
    panels: bool = True,
) -> None:
    """Opens the window and runs the simulation until it is closed.

    Args:
      scene: what is shown.
      data: the state that is drawn; `step` changes it in place.
      step: does one control step. reset: brings back the start (key Backspace).
      overlays: what is written over the image; None: `default_overlays(scene)`.
      step_time: simulated seconds of one control step; steps are paced to real time.
      paused: begin paused.
      key_callback: called with every key (GLFW code) that is pressed, in this thread.
      prepare: does what takes long, such as compiling; must not change `data`, which is drawn meanwhile.
      more_keys: what `key_callback` does, key and text, for the list of keys.
      camera: where each image is taken from; None where it gives none: where the mouse has put the camera.
      panels: MuJoCo's panel on the left is open at first; Tab opens and closes it.
      own_letters: letters are `key_callback`'s: the marks that MuJoCo's viewer shows for some of them stay off or on.

    Raises:
      MissingDependencyError: there is no display.
    """
    state, mouse = ViewerState(default_overlays(scene) if overlays is None else overlays, paused, more_keys), Mouse()
    keys: queue.SimpleQueue[int] = queue.SimpleQueue()
    visual = visual_of(scene)
    with launch_window(visual.model, visual.data(scene.model, data), keys.put, panels) as handle:
        first = camera() if camera is not None else None
        look_at(handle.cam, home_overview(scene, data) if first is None else first)
        handle.set_texts([(mujoco.mjtFontScale.mjFONTSCALE_150, mujoco.mjtGridPos.mjGRID_TOPLEFT, *PREPARING)])
        handle.sync()
        if prepare is not None:
            prepare()  # without the lock, so that the window lives
        marks = np.array(handle.opt.flags) if own_letters else None
        due = time.monotonic()
        while handle.is_running():
            while not keys.empty():
                key = keys.get()
                state.press(key)
                if key_callback is not None:
                    key_callback(key)
            with handle.lock():
                if state.reset and reset is not None:
                    reset()
                state.reset = False
                if state.push:
                    mouse.push(step_time)
                state.push = False
                mouse.apply(scene.model, data, handle.perturb, _sight(handle.cam))
                if state.wants_step():
                    step()
                visual.data(scene.model, data)  # what the window has
                if marks is not None:
                    handle.opt.flags[:] = marks
                look_at(handle.cam, camera() if camera is not None else None)
                state.draw_labels(data, handle.user_scn, Sight.of_window(handle, scene.model.vis.global_.fovy))
                texts = state.texts(data)
            handle.set_texts(texts)
            handle.sync()
            due = max(due + step_time, time.monotonic() - step_time)  # never hurry after a pause
            time.sleep(max(0.0, due - time.monotonic()))


def check_display() -> None:
    """Raises MissingDependencyError where there can be no window, before anything is loaded for one."""
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise MissingDependencyError(_NO_DISPLAY)


def launch_window(model: mujoco.MjModel, data: mujoco.MjData, key_callback: Callable[[int], None], panels: bool):
    """MuJoCo's passive viewer, with one-line errors where there can be no window."""
    check_display()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # glfw warns, and then says so again
        import glfw
        import mujoco.viewer

        if not glfw.init():
            raise MissingDependencyError(_NO_DISPLAY)
    try:
        return mujoco.viewer.launch_passive(
            model, data, key_callback=key_callback, show_left_ui=panels, show_right_ui=False
        )
    except RuntimeError as e:
        if "mjpython" in str(e):
            raise MissingDependencyError("on macOS the viewer runs under mjpython: mjpython -m ig2mj view ...") from e
        raise EngineError(f"MuJoCo's viewer does not open: {e}") from e


def _sight(cam: mujoco.MjvCamera) -> np.ndarray:
    """Where the window's free camera looks to, a unit vector."""
    azimuth, elevation = np.radians(cam.azimuth), np.radians(cam.elevation)
    flat = np.cos(elevation)
    return np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])


def look_at(cam: mujoco.MjvCamera, view: FreeView | None) -> None:
    """Moves the window's camera, where a view is given."""
    if view is not None:
        cam.type = mujoco.mjtCamera.mjCAMERA_FREE
        cam.lookat[:] = view.lookat
        cam.distance, cam.azimuth, cam.elevation = view.distance, view.azimuth, view.elevation


def _columns(rows: Sequence[tuple[str, str]]) -> tuple[str, str]:
    return "\n".join(a for a, _ in rows), "\n".join(b for _, b in rows)
