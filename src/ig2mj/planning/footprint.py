"""`BaseFootprint`: the space that a robot and what it holds occupy while driving: discs about its axis, by height."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Collection, Iterable

import mujoco
import numpy as np

from ig2mj.agents.task_robot import TaskRobot
from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.scene import Scene

LOWEST, SLICE, TOP = 0.05, 0.25, 2.0
"""m: what is lower does not count, since wheels and hovering bodies pass over it; height of a slice; of the top."""

SLICES = np.arange(LOWEST, TOP + SLICE, SLICE)
"""m: heights at which slices begin and end."""

ROUNDING = 0.005
"""m to which radii are rounded up, so that a robot whose hands move a little has the same footprint."""


@dataclasses.dataclass(frozen=True)
class Disc:
    """Everything between two heights (m above the floor) is within `radius` (m) of the robot's vertical axis."""

    low: float
    high: float
    radius: float


@dataclasses.dataclass(frozen=True)
class BaseFootprint:
    """See the module's text. Turning does not change it.

    Attributes:
      discs: from the lowest on. wheels: m from the axis to which a base stands on wheels and casters that climb no edge
        of a carpet; 0: it passes over what is lower than `LOWEST`.
    """

    discs: tuple[Disc, ...]
    wheels: float = 0.0

    @property
    def radius(self) -> float:
        """Of the widest disc, m."""
        return max(d.radius for d in self.discs)

    def holding(self, low: float, high: float, radius: float) -> BaseFootprint:
        """With something between two heights that reaches `radius` from the axis, m."""
        return self.with_discs([Disc(max(low, LOWEST), high, radius)])

    def with_discs(self, discs: Iterable[Disc]) -> BaseFootprint:
        """With more discs."""
        return dataclasses.replace(self, discs=_merged([*self.discs, *discs]))

    def on_wheels(self) -> BaseFootprint:
        """With wheels that reach as far as its lowest disc."""
        return dataclasses.replace(self, wheels=self.discs[0].radius)

    @classmethod
    def of_robot(
        cls,
        scene: Scene,
        view: PhysicsView,
        agent: int = 0,
        world: int = 0,
        without_hands: Collection[int] = (),
        without_bodies: Collection[int] = (),
    ) -> BaseFootprint:
        """That of a robot as it stands in a view.

        Args:
          view: with a world axis; `world` of it. agent: number of the robot. without_hands: numbers of hands, among all
            of the scene, that do not count. without_bodies: of the model, that do not count either.
        """
        model, tables = scene.model, scene.tables
        counts = (tables.body_agent == agent) & ~np.isin(tables.body_hand, list(without_hands))
        counts[list(without_bodies)] = False
        geoms = np.flatnonzero(counts[model.geom_bodyid] & ((model.geom_contype | model.geom_conaffinity) != 0))
        bodies = model.geom_bodyid[geoms]
        pos, quat = (np.asarray(a)[world, bodies] for a in (view.body_pos, view.body_quat))
        turn = matrices_on_host(quat)
        middle = pos + np.einsum("nij,nj->ni", turn, model.geom_pos[geoms])
        frame = turn @ matrices_on_host(model.geom_quat[geoms])
        axis = np.asarray(view.agent.base_pos)[world, agent]
        offset = middle - axis
        robot = scene.agents[agent]
        floor = float(axis[2]) - robot.stands if isinstance(robot, TaskRobot) else 0.0
        discs = []
        for k, geom in enumerate(geoms):
            away, tall = _extent(model, int(geom), frame[k], offset[k, :2])
            low, high = middle[k, 2] - tall - floor, middle[k, 2] + tall - floor
            discs.append(Disc(float(low), float(high), away))
        return cls(_merged(discs))


def _extent(model: mujoco.MjModel, geom: int, frame: np.ndarray, offset: np.ndarray) -> tuple[float, float]:
    """How far a geom reaches from the robot's vertical axis, and from its middle upwards, m. `offset`: of the middle
    from the axis, horizontal."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == int(mujoco.mjtGeom.mjGEOM_SPHERE):
        return float(np.hypot(*offset) + size[0]), float(size[0])
    if kind in (int(mujoco.mjtGeom.mjGEOM_CAPSULE), int(mujoco.mjtGeom.mjGEOM_CYLINDER)):
        along, round_ = frame[:, 2] * size[1], float(size[0])
        ends = offset + np.array([[1.0], [-1.0]]) * along[:2]
        return float(np.linalg.norm(ends, axis=1).max()) + round_, abs(float(along[2])) + round_
    box = model.geom_aabb[geom]
    corners = (frame @ (np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1) * box[3:, None] + box[:3, None])).T
    return float(np.linalg.norm(corners[:, :2] + offset, axis=1).max()), float(np.abs(corners[:, 2]).max())


def _merged(discs: list[Disc]) -> tuple[Disc, ...]:
    """The same as slices of equal height: the widest of each, equal neighbours as one."""
    found: list[Disc] = []
    for low, high in itertools.pairwise(SLICES):
        radius = max((d.radius for d in discs if d.high > low and d.low < high), default=0.0)
        if radius == 0.0:
            continue
        radius = float(np.ceil(radius / ROUNDING - 1e-6) * ROUNDING)
        if found and found[-1].high == low and found[-1].radius == radius:
            found[-1] = dataclasses.replace(found[-1], high=float(high))
        else:
            found.append(Disc(float(low), float(high), radius))
    return tuple(found)
