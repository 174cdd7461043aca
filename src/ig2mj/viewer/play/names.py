"""Names of the objects and rooms that the window's camera really sees."""

from __future__ import annotations

from collections.abc import Collection

import mujoco
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.scene.manifest import BUILDING
from ig2mj.scene.scene import Scene
from ig2mj.viewer.label_space import Sight
from ig2mj.viewer.overlays import Label, ObjectNames, RoomNames
from ig2mj.viewer.sight_lines import SightLines, surface_points

LASTS = 0.2
"""s of simulated time for which a look holds, while the camera stands still."""

NEAR_FLOOR = 0.15
"""m: a ray that ends this near to where a room's name lies has reached its floor."""


class _Look:
    """Remembers what was seen until the camera moves or time passes."""

    def __init__(self) -> None:
        self._key: tuple[bytes, bytes, tuple[int, int]] | None = None
        self._time = -np.inf

    def stale(self, data: mujoco.MjData, sight: Sight) -> bool:
        """Whether to look again; from now on counts as looked."""
        key = (sight.eye.tobytes(), sight.axes.tobytes(), sight.size)
        if key == self._key and 0.0 <= data.time - self._time < LASTS:
            return False
        self._key, self._time = key, data.time
        return True


class VisibleObjectNames(ObjectNames):
    """The name of every object of which the camera sees something; "(goal)" follows those that the task is about.

    A name hangs above its object, or at a part of it that is seen, where that point is hidden.
    """

    def __init__(self, scene: Scene, lines: SightLines, goal: Collection[str] = ()):
        super().__init__(scene)
        self._model, self._lines, self._look = scene.model, lines, _Look()
        self._goal, self._labels = frozenset(goal), list[Label]()
        building = np.array([entry.category in BUILDING for entry in scene.manifest.objects], bool)
        owner = np.asarray(scene.tables.geom_object)
        shown = lines.opaque & (owner >= 0)
        shown[shown] &= ~building[owner[shown]]
        self._geoms, self._owner = np.flatnonzero(shown), owner
        self._index = {name: number for number, name in enumerate(scene.object_names)}

    def look(self, data: mujoco.MjData, sight: Sight) -> None:
        """Finds out what is seen."""
        if not self._look.stale(data, sight):
            return
        points = surface_points(self._model, data, self._geoms).reshape(-1, 3)
        owner = np.repeat(self._owner[self._geoms], len(points) // max(len(self._geoms), 1))
        inside = sight.frames(points)
        points, owner = points[inside], owner[inside]
        met, _ = self._lines.towards(data, sight.eye, points)
        seen = _owners(self._owner, met) == owner
        points, owner = points[seen], owner[seen]
        labels = [label for label in super().labels(data) if self._index[label.text] in set(owner.tolist())]
        anchors = np.array([label.pos for label in labels], float).reshape(-1, 3)
        met, far = self._lines.towards(data, sight.eye, anchors)
        own = _owners(self._owner, met) == [self._index[label.text] for label in labels]
        free = sight.frames(anchors) & (own | (far > np.linalg.norm(anchors - sight.eye, axis=1)))
        self._labels = []
        for label, anchor, good in zip(labels, anchors, free, strict=True):
            if not good:
                parts = points[owner == self._index[label.text]]
                anchor = parts[np.argmin(np.linalg.norm(parts - anchor, axis=1))]
            text = f"{label.text} (goal)" if label.text in self._goal else label.text
            self._labels.append(Label((float(anchor[0]), float(anchor[1]), float(anchor[2])), text, label.rgba))

    def labels(self, data: mujoco.MjData) -> list[Label]:
        """Of the objects that were seen when it looked last."""
        return self._labels


def _owners(owner: Int[np.ndarray, "G"], geoms: Int[np.ndarray, "N"]) -> Int[np.ndarray, "N"]:
    """Objects of the geoms that rays met; -1: of none."""
    return np.where(geoms >= 0, owner[np.maximum(geoms, 0)], -1)


class VisibleRoomNames(RoomNames):
    """The name of every room of whose floor the camera sees where the name lies."""

    def __init__(self, scene: Scene, lines: SightLines):
        super().__init__(scene)
        self._lines, self._look = lines, _Look()
        self._seen: Bool[np.ndarray, "N"] = np.zeros(len(self._labels), bool)

    def look(self, data: mujoco.MjData, sight: Sight) -> None:
        """Finds out what is seen."""
        if not self._labels or not self._look.stale(data, sight):
            return
        points = np.array([label.pos for label in self._labels], float)
        _, far = self._lines.towards(data, sight.eye, points)
        self._seen = sight.frames(points) & (far > np.linalg.norm(points - sight.eye, axis=1) - NEAR_FLOOR)

    def labels(self, data: mujoco.MjData) -> list[Label]:
        """Of the rooms that were seen when it looked last."""
        return [label for label, seen in zip(self._labels, self._seen, strict=True) if seen]
