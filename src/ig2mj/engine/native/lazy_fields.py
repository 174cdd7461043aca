"""Fields of the native engine's views that are computed when they are read first.

An agent is awake in every step, and few of its fields are read in each. Each world copies the rows of MuJoCo's arrays
that the fields depend on, which takes a tenth of the time, and views compute the fields from those. Views between which
nothing of a group changed share one object of a class below, so that a field is computed once and stays the same array.
With an idle robot in one world this saves 200 us of a control step of 350 to 450, and 25 to 50 us a world in batches of
16 (docs/notes/native.md).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from typing import NamedTuple

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout
from ig2mj.scene.tables import SceneTables

RAW = "raw"
"""The working array of an engine that holds copies of all rows of `RawRows`: one copy of it is faster than four."""


@dataclasses.dataclass(frozen=True)
class RawRows:
    """Which rows of MuJoCo's arrays the fields of agents are made of; agents come last, so they are few.

    Attributes:
      starts, shapes: first row, and shape of the rows, by MuJoCo's name of the array.
    """

    starts: dict[str, int]
    shapes: dict[str, tuple[int, ...]]

    @classmethod
    def build(cls, model: mujoco.MjModel, tables: SceneTables) -> RawRows:
        """The shortest runs of rows that hold all that is needed."""
        bodies = np.concatenate([tables.agent_body, tables.hand_body, tables.finger_body]).astype(int)
        needed = {
            "qpos": (tables.agent_joint_qposadr, ()),
            "qvel": (tables.agent_joint_dofadr, ()),
            "cvel": (bodies, (6,)),
            "subtree_com": (np.asarray(model.body_rootid)[bodies], (3,)),
        }
        starts = {name: int(rows.min()) if len(rows) else 0 for name, (rows, _) in needed.items()}
        counts = {n: int(rows.max()) + 1 - starts[n] if len(rows) else 0 for n, (rows, _) in needed.items()}
        return cls(starts, {name: (counts[name], *row) for name, (_, row) in needed.items()})

    @property
    def size(self) -> int:
        """Numbers of one world."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    def parts(self, raw: np.ndarray) -> dict[str, np.ndarray]:
        """The rows [W, ...] of each array in an array [W, `size`], without copies."""
        parts, end = {}, 0
        for name, shape in self.shapes.items():
            start, end = end, end + math.prod(shape)
            parts[name] = raw[:, start:end].reshape(len(raw), *shape)
        return parts

    def copied(self, data: mujoco.MjData, raw: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Pairs of what is to be copied in every step, into and from where, of one world's row of `RAW`."""
        parts = self.parts(raw[None])
        pairs = [(part[0], getattr(data, name)[self.starts[name] :][: len(part[0])]) for name, part in parts.items()]
        return [(into, of) for into, of in pairs if into.size]


@dataclasses.dataclass(frozen=True, eq=False)
class LazyPlan:
    """Index arrays of a scene, shared by all views.

    Attributes:
      raw: what is copied.
      free, free_dofs: [n], [n, 6] objects with a free joint, and the addresses of their velocities.
      roots: [B] root of each body's tree. camera_body, camera_pos, camera_quat: [A...] eyes in their bodies' frames.
      unit_starts: [O] first unit of each object. agent_starts: [A] first unit of each agent, counted from V.
      agent_unit, object_unit: [G] unit of each geom that collides, agents' counted from V; -1 none.
      tolerance: metres.
    """

    tables: SceneTables
    raw: RawRows
    free: np.ndarray
    free_dofs: np.ndarray
    roots: np.ndarray
    camera_body: np.ndarray
    camera_pos: np.ndarray
    camera_quat: np.ndarray
    unit_starts: np.ndarray
    agent_starts: np.ndarray
    agent_unit: np.ndarray
    object_unit: np.ndarray
    tolerance: float

    @classmethod
    def build(cls, model: mujoco.MjModel, tables: SceneTables, layout: ModelLayout, tolerance: float) -> LazyPlan:
        """Of an engine's model."""
        free = np.flatnonzero(layout.object_dofadr >= 0)
        count, camera = layout.num_object_units, tables.agent_camera
        unit = np.where(layout.collides, layout.geom_unit, -1)
        known = camera >= 0
        return cls(
            tables=tables,
            raw=RawRows.build(model, tables),
            free=free,
            free_dofs=layout.object_dofadr[free, None] + np.arange(6),
            roots=np.array(model.body_rootid),
            camera_body=np.where(known, model.cam_bodyid[camera] if model.ncam else 0, tables.agent_body),
            camera_pos=np.where(known[:, None], model.cam_pos[camera] if model.ncam else 0.0, np.zeros(3)),
            camera_quat=np.where(known[:, None], model.cam_quat[camera] if model.ncam else 0.0, [1.0, 0, 0, 0]),
            unit_starts=np.unique(layout.unit_object[:count], return_index=True)[1],
            agent_starts=np.unique(layout.unit_agent[count:], return_index=True)[1],
            agent_unit=np.where(unit >= count, unit - count, -1),
            object_unit=np.where(unit < count, unit, -1),
            tolerance=tolerance,
        )


class AgentContacts(NamedTuple):
    """What is needed to tell what the agents of one world touch.

    Attributes:
      remembered: [agents' units, V] touching that is taken over where `fresh` is false (both of a pair sleep).
      fresh: of the same shape, or None: everywhere.
      geom, dist: [C, 2], [C] the contacts.
    """

    remembered: np.ndarray
    fresh: np.ndarray | None
    geom: np.ndarray
    dist: np.ndarray


def agents_touching(plan: LazyPlan, contacts: AgentContacts) -> np.ndarray:
    """Touching of agents' units with objects' [agents' units, V]."""
    if contacts.fresh is None:
        touching = np.zeros_like(contacts.remembered)
    else:
        touching = contacts.remembered & ~contacts.fresh
    agent = plan.agent_unit[contacts.geom]
    if len(agent) and agent.max() >= 0:  # mostly no contact is an agent's
        near = contacts.dist <= plan.tolerance
        agent, thing = agent[near], plan.object_unit[contacts.geom[near]]
        for side in (0, 1):
            both = (agent[:, side] >= 0) & (thing[:, 1 - side] >= 0)
            touching[agent[both, side], thing[both, 1 - side]] = True
    return touching


class ObjectMotion:
    """Velocities of objects."""

    def __init__(self, plan: LazyPlan, qvel: np.ndarray, object_quat: np.ndarray):
        """`qvel` [W, nv]: never changed again. `object_quat`: the view's."""
        self._plan, self._qvel, self._quat = plan, qvel, object_quat
        self._made: dict[str, np.ndarray] = {}

    def __call__(self, name: str) -> np.ndarray:
        """The field. Raises AttributeError where it is none of these."""
        if name not in ("object_linvel", "object_angvel"):
            raise AttributeError(name)
        if not self._made:
            plan = self._plan
            linear, angular = (np.zeros((*self._quat.shape[:2], 3), np.float32) for _ in range(2))
            if len(plan.free):  # a free joint's: linear in the world's axes, angular in the body's
                velocity = self._qvel[:, plan.free_dofs]
                linear[:, plan.free] = velocity[..., :3]
                angular[:, plan.free] = _rotate(self._quat[:, plan.free], velocity[..., 3:])
            self._made = {"object_linvel": linear, "object_angvel": angular}
        return self._made[name]


class Agents:
    """All fields of agents but for the forces of fingers."""

    def __init__(
        self,
        plan: LazyPlan,
        body_pos: np.ndarray,
        body_quat: np.ndarray,
        raw: np.ndarray,
        contacts: list[AgentContacts],
    ):
        """None of the arrays is changed again.

        Args:
          body_pos, body_quat: the view's. raw: [W, n] of `RAW`. contacts: of each world.
        """
        self._plan, self._pos, self._quat, self._all_raw, self._contacts = plan, body_pos, body_quat, raw, contacts
        self._made: dict[str, np.ndarray] = {}

    def __call__(self, name: str) -> np.ndarray:
        """The field. Raises AttributeError where it is none of these."""
        if name not in self._made:
            if name.startswith("_") or not hasattr(self, f"_make_{name.rpartition('_')[2]}"):
                raise AttributeError(name)
            getattr(self, f"_make_{name.rpartition('_')[2]}")(name.rpartition("_")[0])
        return self._made[name]

    @functools.cached_property
    def _raw(self) -> dict[str, np.ndarray]:
        return self._plan.raw.parts(self._all_raw)

    def _rows(self, name: str, rows: np.ndarray) -> np.ndarray:
        """Some rows of MuJoCo's array."""
        return self._raw[name].take(rows - self._plan.raw.starts[name], 1)

    def _bodies(self, part: str) -> np.ndarray:
        tables = self._plan.tables
        return {"base": tables.agent_body, "hand": tables.hand_body, "finger": tables.finger_body}[part]

    def _make_pos(self, part: str) -> None:
        if part == "joint":
            self._made["joint_pos"] = self._rows("qpos", self._plan.tables.agent_joint_qposadr).astype(np.float32)
        elif part == "eye":
            self._make_eyes()
        else:
            self._made[f"{part}_pos"] = self._pos.take(self._bodies(part), 1)

    def _make_quat(self, part: str) -> None:
        if part == "eye":
            self._make_eyes()
        else:
            self._made[f"{part}_quat"] = self._quat.take(self._bodies(part), 1)

    def _make_eyes(self) -> None:
        plan = self._plan
        pos, quat = self._pos.take(plan.camera_body, 1), self._quat.take(plan.camera_body, 1)
        self._made["eye_pos"] = (pos + _rotate(quat, plan.camera_pos)).astype(np.float32)
        self._made["eye_quat"] = multiply(quat, plan.camera_quat).astype(np.float32)

    def _make_vel(self, part: str) -> None:
        self._made["joint_vel"] = self._rows("qvel", self._plan.tables.agent_joint_dofadr).astype(np.float32)

    def _make_linvel(self, part: str) -> None:
        """From MuJoCo's velocities about the centre of mass of the whole tree: rotation, then translation."""
        bodies = self._bodies(part)
        velocity = self._rows("cvel", bodies)
        lever = self._pos.take(bodies, 1) - self._rows("subtree_com", self._plan.roots[bodies])
        angular = velocity[..., :3]
        self._made[f"{part}_linvel"] = (velocity[..., 3:] + _cross(angular, lever)).astype(np.float32)
        self._made[f"{part}_angvel"] = angular.astype(np.float32)

    _make_angvel = _make_linvel

    def _make_touching(self, part: str) -> None:
        plan = self._plan
        units = np.stack([agents_touching(plan, contacts) for contacts in self._contacts])
        self._made["touching"] = of_owners(of_owners(units, plan.agent_starts, 1), plan.unit_starts, 2)


def of_owners(touching: np.ndarray, starts: np.ndarray, axis: int) -> np.ndarray:
    """Whether any unit of each owner touches; `starts`: its first unit along the axis."""
    if len(starts) == touching.shape[axis]:
        return touching
    return np.logical_or.reduceat(touching, starts, axis)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of vectors [..., 3]; NumPy's own takes five times as long for a few."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], -1)


def _rotate(quat: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Vectors [..., 3] rotated by w-x-y-z quaternions [..., 4]."""
    w, u = quat[..., :1], quat[..., 1:]
    twice = 2 * _cross(u, vector)
    return vector + w * twice + _cross(u, twice)


def multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Products of quaternions [..., 4], w-x-y-z."""
    w, v = p[..., :1], p[..., 1:]
    s, u = q[..., :1], q[..., 1:]
    real = w * s - (v * u).sum(-1, keepdims=True)
    return np.concatenate([real, w * u + s * v + _cross(v, u)], -1)
