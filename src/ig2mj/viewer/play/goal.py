"""What `ig2mj play` shows of the goal: its objects, its point, marks at both, and the task in words."""

from __future__ import annotations

import textwrap
from collections.abc import Collection

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.tasks.navigation.objective import NavigationObjective
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.task import Task
from ig2mj.viewer.overlays import Label
from ig2mj.viewer.sight_lines import SightLines, surface_points
from ig2mj.viewer.state_marks import Mark

COLOUR = (0.1, 0.9, 0.2, 0.6)
"""Of marks of a goal, rgba."""

THICK = 0.01
"""m: half the height of the disc on the floor."""

ARROW = (0.02, 0.2, 0.06)
"""m: radius and length of the arrow that points at an object, and the gap between both."""

COLUMNS = 28
"""Characters of a line of the task's text."""

LINES = 3
"""Lines of the task's text, at most."""

_DOWN = np.diag([1.0, -1.0, -1.0])


class Goal:
    """The goal of an environment with one world.

    Attributes:
      objects: names of the objects that the task or its goal names, in that order, without parts of the building.
      geoms: visible geoms of each of these objects.
      text: the task in a sentence, in lines that fit the corner of the window.
    """

    def __init__(self, env: Environment, lines: SightLines):
        """`lines`: of the environment's model."""
        self._objective, self._task, self._model = env.objective, env.task, env.scene.model
        household = {entry.name for entry in env.scene.manifest.objects if entry.in_household}
        named = list(env.task.objects_of_interest) if isinstance(env.task, Task) else []
        goal = env.core.rules.goal if env.core.rules is not None else None
        if goal is not None:
            named += [argument for atom in goal.atoms for argument in atom.arguments]
        self.objects = tuple(name for name in dict.fromkeys(named) if name in household)
        self.text = textwrap.wrap(env.task.summary, COLUMNS, max_lines=LINES, placeholder=" ...")
        owner = np.asarray(env.scene.tables.geom_object)
        indices = [env.scene.object_index(name) for name in self.objects]
        self.geoms = [np.flatnonzero(lines.opaque & (owner == index)) for index in indices]

    def point(self, state: EnvState) -> Float[np.ndarray, "3"] | None:
        """Where the robot or its hand is to go, world frame, m; None where the goal is no point."""
        if not isinstance(self._objective, NavigationObjective):
            return None
        goal = self._objective.goal(state.measures)
        return None if goal is None else np.array(np.asarray(goal)[0], float)

    def distance(self, state: EnvState) -> float | None:
        """m in a straight line from the base (or from the hand that is to reach it) to the goal's point."""
        point = self.point(state)
        if point is None:
            return None
        agent = state.batch.world.view.agent
        if self._in_air:
            return float(np.linalg.norm(np.asarray(agent.hand_pos, float)[0, 0] - point))
        return float(np.linalg.norm((np.asarray(agent.base_pos, float)[0, 0] - point)[:2]))

    def way(self, data: mujoco.MjData, state: EnvState, heading: float, held: Collection[str | None]) -> str | None:
        """Where the goal's point or its nearest object is, such as "1.5 m left"; None where there is neither.

        Args:
          heading: degrees about +z in which the robot looks. held: objects in its hands, which are left out.
        """
        base = np.asarray(state.batch.world.view.agent.base_pos, float)[0, 0]
        point, far = self.point(state), self.distance(state)
        if point is not None and far is not None:
            return f"{far:.1f} m {_direction(point - base, heading)}"
        centres = [
            (surface_points(self._model, data, geoms)[:, 0].mean(axis=0) - base, name)
            for name, geoms in zip(self.objects, self.geoms, strict=True)
            if len(geoms) and name not in held
        ]
        if not centres:
            return None
        offset, name = min(centres, key=lambda centre: float(np.linalg.norm(centre[0][:2])))
        return f"{name}, {np.linalg.norm(offset[:2]):.1f} m {_direction(offset, heading)}"

    def marks(self, data: mujoco.MjData, state: EnvState) -> list[Mark]:
        """A disc on the floor or a ball in the air within which the goal is reached; an arrow above each object."""
        found: list[Mark] = []
        point = self.point(state)
        if point is not None and isinstance(self._task, NavigationTask):
            kind = mujoco.mjtGeom.mjGEOM_SPHERE if self._in_air else mujoco.mjtGeom.mjGEOM_CYLINDER
            size = (self._task.tolerance,) * 3 if self._in_air else (self._task.tolerance, THICK, 0.0)
            found.append(Mark(kind, size, point, np.eye(3), COLOUR))
        radius, length, gap = ARROW
        for geoms in self.geoms:
            if len(geoms):
                points = surface_points(self._model, data, geoms).reshape(-1, 3)
                x, y = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
                tail = np.array([x, y, points[:, 2].max() + gap + length])
                found.append(Mark(mujoco.mjtGeom.mjGEOM_ARROW, (radius, radius, length), tail, _DOWN, COLOUR))
        return found

    def labels(self, state: EnvState) -> list[Label]:
        """A text at the goal's point, which shows the way through walls, too."""
        point, far = self.point(state), self.distance(state)
        if point is None or far is None:
            return []
        return [Label((point[0], point[1], point[2] + 0.3), f"goal, {far:.1f} m")]

    @property
    def _in_air(self) -> bool:
        return isinstance(self._task, NavigationTask) and self._task.goal == "reach"


def _direction(offset: Float[np.ndarray, "3"], heading: float) -> str:
    """Of the four sides of a robot that looks in a direction (degrees), the one on which an offset lies."""
    angle = np.degrees(np.arctan2(offset[1], offset[0])) - heading
    return ("ahead", "left", "behind", "right")[round(angle / 90) % 4]
