"""What can be written over the image of the interactive viewer: object names, rooms, the clock.

An overlay is anything with a `title` and the methods `labels` (texts that hang at points of the world) and `lines`
(rows of two texts in a corner of the window). The viewer asks every overlay that is on once per frame. A new one is a
class like those below, handed to `interactive.open_viewer(..., overlays=[...])` or registered (`ig2mj.register`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np

from ig2mj.errors import PluginError
from ig2mj.plugins import Registry
from ig2mj.scene.scene import Scene


@runtime_checkable
class Drawing(Protocol):
    """An overlay that also draws shapes (`ig2mj.viewer.state_marks.Mark`), or changes how objects look."""

    def marks(self, data: mujoco.MjData) -> Sequence[Any]: ...

    def hide(self) -> None: ...


@dataclasses.dataclass(frozen=True)
class Label:
    """A text at a point: pos world frame (metres), rgba 0..1."""

    pos: tuple[float, float, float]
    text: str
    rgba: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)


@runtime_checkable
class Overlay(Protocol):
    """What the viewer asks of an overlay. `data` holds the state that is about to be drawn."""

    title: str

    def labels(self, data: mujoco.MjData) -> Sequence[Label]: ...

    def lines(self, data: mujoco.MjData) -> Sequence[tuple[str, str]]: ...


class ObjectNames:
    """The name of every object above its main body; parked objects and building parts are left out."""

    title = "object names"

    def __init__(self, scene: Scene):
        shown = [o for o in scene.manifest.objects if o.in_household]
        self._names = [o.name for o in shown]
        self._bodies = np.array([scene.model.body(o.bodies[0]).id for o in shown], dtype=int)
        self._centres = np.array([o.base_link_offset for o in shown], dtype=float).reshape(-1, 3)
        self._lift = np.array([0.5 * min(o.bounding_box) + 0.02 for o in shown], dtype=float)

    def labels(self, data: mujoco.MjData) -> list[Label]:
        rotations = data.xmat[self._bodies].reshape(-1, 3, 3)
        points = data.xpos[self._bodies] + np.einsum("nij,nj->ni", rotations, self._centres)
        points[:, 2] += self._lift
        return [Label((p[0], p[1], p[2]), n) for p, n in zip(points.tolist(), self._names, strict=True)]

    def lines(self, data: mujoco.MjData) -> list[tuple[str, str]]:
        return []


class RoomNames:
    """The name of every room instance on its floor, and the number of rooms."""

    title = "rooms"

    def __init__(self, scene: Scene):
        self._labels: list[Label] = []
        if scene.rooms is None:
            return
        resolution, room_map = scene.rooms.resolution, scene.rooms.room_map
        half = np.array(room_map.shape)[::-1] / 2
        for index, name in enumerate(scene.rooms.names):
            cells = np.argwhere(room_map == index + 1)[:, ::-1]  # row is y, column is x
            if len(cells):
                inside = cells[np.argmin(np.sum((cells - cells.mean(axis=0)) ** 2, axis=1))]
                x, y = ((inside + 0.5 - half) * resolution).tolist()
                self._labels.append(Label((x, y, 0.05), name, (1.0, 0.85, 0.3, 1.0)))

    def labels(self, data: mujoco.MjData) -> list[Label]:
        return self._labels

    def lines(self, data: mujoco.MjData) -> list[tuple[str, str]]:
        return []


class Clock:
    """Simulated time, contacts, and how many movable objects are awake."""

    title = "clock"

    def __init__(self, scene: Scene):
        self._trees = scene.model.ntree

    def labels(self, data: mujoco.MjData) -> list[Label]:
        return []

    def lines(self, data: mujoco.MjData) -> list[tuple[str, str]]:
        awake = int(np.sum(data.tree_asleep < 0))
        return [("time", f"{data.time:.1f} s"), ("awake", f"{awake} of {self._trees}"), ("contacts", str(data.ncon))]


OVERLAYS: Registry[Callable[..., Overlay]] = Registry(
    "overlay", "a class or function that makes an ig2mj.viewer.overlays.Overlay of a scene and a world,", callable
)
"""Overlays of plug-ins. Each is called with the scene and with what `default_overlays` got as `world`."""


def default_overlays(scene: Scene, world: Any = None) -> list[Overlay]:
    """Those that the viewer can show, one line each, and those of plug-ins.

    Args:
      world: what overlays of plug-ins may read states from, an `ig2mj.Simulation`; None: only the scene is shown.

    Raises:
      PluginError: one cannot be imported, or makes no overlay.
    """
    return [
        ObjectNames(scene),
        RoomNames(scene),
        Clock(scene),
        *(_added(name, scene, world) for name in OVERLAYS),
    ]


def _added(name: str, scene: Scene, world: Any) -> Overlay:
    overlay = OVERLAYS[name](scene, world)
    if not isinstance(overlay, Overlay):
        source = OVERLAYS.sources()[name]
        raise PluginError(f"overlay '{name}' of {source} is {overlay!r:.80}: it needs title, labels and lines")
    return overlay
