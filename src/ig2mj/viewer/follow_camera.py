"""`FollowCamera`: a camera that goes along with a robot, from where walls and furniture hide little of what it does."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.looks.visual import COSTUMES
from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.scene.tables import SceneTables
from ig2mj.viewer.offscreen import FreeView

DISTANCES, ELEVATIONS, SIDES = (2.5, 1.8, 1.2), (-30.0, -48.0, -66.0), 16
"""m from what is looked at, degrees below the horizon, and number of directions around it that are tried."""

TALL = (0.35, 0.6)
"""m above the robot's base of the points of its body that should be seen; the second is looked at."""

NEAR = 1.6
"""m from the robot within which an object is in the image, too."""

SLACK = 0.12
"""m before a point from which a hit counts as the point itself."""

SHARE = 0.35
"""Of the way from the robot to the object at which the middle of an image is."""

AGAIN, STAY = 10, 1.0
"""Images after which another place is looked for while body and objects are seen, and how much better it must be."""

SMOOTH = 0.2
"""Share by which the point that is looked at follows in each image."""

PREFERRED = 55.0
"""Degrees to the side of the robot's back from which a view is best: hands are seen."""

CROWDED, AROUND = 1.4, tuple((x, y) for x in (-0.6, -0.3, 0.3, 0.6) for y in (-0.3, 0.3))
"""m from the camera within which things fill the image; where it is tested (right and up, for one ahead)."""

CROWD = 0.25
"""Share of an image that is near at which another place is looked for at once."""

Vector = Float[np.ndarray, "3"]

_GROUPS = np.isin(np.arange(mujoco.mjNGROUP), VISIBLE_GROUPS).astype(np.uint8)


class FollowCamera:
    """See the module's text. One for each video; it remembers where it is."""

    def __init__(self, tables: SceneTables, agent: int = 0):
        """`agent`: number of the robot that it goes along with."""
        self._tables, self._agent = tables, agent
        self._view: FreeView | None = None
        self._count, self._focus = 0, -1

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData, objects: Sequence[int] = ()) -> FreeView:
        """The camera for the next image.

        Args:
          model, data: of the scene, or what is drawn of it (`ig2mj.looks`), with poses up to date.
          objects: numbers of those that matter now, the first most.
        """
        tables = self._tables
        base = data.xpos[tables.agent_body[self._agent]]
        up = np.array([0.0, 0.0, 1.0])
        targets = [base + z * up for z in TALL]
        middle = targets[1]
        for number in objects:
            place = data.xipos[tables.object_root[number]]
            if np.linalg.norm((place - base)[:2]) < NEAR:
                targets.append(place)
                middle = (1 - SHARE) * middle + SHARE * place if number == objects[0] else middle
        seen = list(targets)
        targets += [data.xpos[b] for b, a in zip(tables.hand_body, tables.hand_agent, strict=True) if a == self._agent]
        focus, self._count = (objects[0] if objects else -1), self._count + 1
        own = self._own(model, objects)
        at = self._followed(middle)
        moved = self._view if self._view is None else dataclasses.replace(self._view, lookat=_floats(at))
        if (
            moved is None
            or focus != self._focus
            or self._count % AGAIN == 0
            or _seen(model, data, moved, seen, own) < 2.0 * len(seen)
            or _crowded(model, data, moved) >= CROWD
        ):
            moved, self._focus = self._best(model, data, at, targets, own, moved), focus
            if _seen(model, data, moved, targets[: len(TALL)], own) < 2.0 * len(TALL):
                moved = self._best(model, data, middle, targets, own, None)
        self._view = moved
        return moved

    def _followed(self, middle: Vector) -> Vector:
        """What the next image looks at: it follows `middle` by steps, and jumps where that is far away."""
        if self._view is None:
            return middle
        before = np.array(self._view.lookat)
        return before + SMOOTH * (middle - before) if np.linalg.norm(before - middle) < 1.0 else middle

    def _own(self, model: mujoco.MjModel, objects: Sequence[int]) -> np.ndarray:
        """Bodies of the robot, of what it wears, and of the objects."""
        tables, count = self._tables, len(self._tables.body_agent)
        own = np.zeros(model.nbody, bool)
        own[:count] = (tables.body_agent == self._agent) | np.isin(tables.body_object, list(objects))
        own[count:] = [model.body(b).name == COSTUMES for b in range(count, model.nbody)]
        return own

    def _best(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        at: Vector,
        targets: list[Vector],
        own: np.ndarray,
        present: FreeView | None,
    ) -> FreeView:
        """The camera that looks at `at` and sees most targets; `present` unless another is clearly better."""
        turn = data.xmat[self._tables.agent_body[self._agent]].reshape(3, 3)
        yaw = math.degrees(math.atan2(turn[1, 0], turn[0, 0]))

        def value(view: FreeView) -> float:
            side = abs((view.azimuth - yaw + 180.0) % 360.0 - 180.0)  # 0: behind the robot's back
            worse = abs(side - PREFERRED) / 90.0 + 0.03 * abs(view.elevation - ELEVATIONS[0])
            worse += DISTANCES.index(view.distance) + 6.0 * _crowded(model, data, view)
            return _seen(model, data, view, targets, own) - worse

        angles = [360.0 * k / SIDES for k in range(SIDES)]
        places = [(d, a, e) for d in DISTANCES for e in ELEVATIONS for a in angles]
        best = max((FreeView(_floats(at), *place) for place in places), key=value)
        return best if present is None or value(best) > value(present) + STAY else present


def _floats(point: Vector) -> tuple[float, float, float]:
    x, y, z = (float(c) for c in point)
    return x, y, z


def _seen(model: mujoco.MjModel, data: mujoco.MjData, view: FreeView, targets: list[Vector], own: np.ndarray) -> float:
    """Number of targets that are seen, twice. `own`: bodies that hide nothing."""
    eye, _ = _eye(view)
    seen = 0.0
    for target in targets:
        way = target - eye
        length = float(np.linalg.norm(way))
        distance, geom = _ray(model, data, eye, way / length)
        seen += 2.0 * (distance > length - SLACK or bool(own[model.geom_bodyid[geom]]))
    return seen


def _crowded(model: mujoco.MjModel, data: mujoco.MjData, view: FreeView) -> float:
    """Share of the image's corners and sides that something fills from less than `CROWDED` m."""
    eye, axes = _eye(view)
    near = 0
    for across, up in AROUND:
        way = axes[0] + across * axes[1] + up * axes[2]
        near += _ray(model, data, eye, way / np.linalg.norm(way))[0] < CROWDED
    return near / len(AROUND)


def _eye(view: FreeView) -> tuple[Vector, Float[np.ndarray, "3 3"]]:
    """Position of the camera, m, and its axes in rows: ahead, to the right, up."""
    azimuth, elevation = math.radians(view.azimuth), math.radians(view.elevation)
    level = math.cos(elevation)
    ahead = np.array([level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)])
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    return np.asarray(view.lookat) - view.distance * ahead, np.stack([ahead, right, np.cross(right, ahead)])


def _ray(model: mujoco.MjModel, data: mujoco.MjData, eye: Vector, way: Vector) -> tuple[float, int]:
    """How far the nearest visible geom is in a direction, m (infinite: none), and its number."""
    hit = np.array([-1], np.int32)
    distance = mujoco.mj_ray(model, data, eye, way, _GROUPS, 1, -1, hit)
    return (distance, int(hit[0])) if distance >= 0 else (math.inf, 0)
