"""Positions of the view's rows from a world's MjData, only of what moves with a set of trees.

Axes: B bodies, O objects, L links, T trees.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.native.later import RAW
from ig2mj.engine.object_boxes import BoxPlan, BoxTable, plan_boxes, world_boxes
from ig2mj.scene.tables import SceneTables


class Changed:
    """Groups of view fields that a refresh wrote: bits of an int (plain ones; an IntFlag costs a microsecond a use)."""

    NOTHING = 0
    BODIES = 1
    OBJECTS = 2
    LINKS = 4
    JOINTS = 8
    TOUCHING = 16
    FORCE = 32
    AWAKE = 64
    AGENT = 128
    HELD = 256
    FINGERS = 512
    ALL = 1023


FIELDS: dict[str, int] = {
    "object_pos": Changed.OBJECTS,
    "object_quat": Changed.OBJECTS,
    "object_com": Changed.OBJECTS,
    "aabb_low": Changed.OBJECTS,
    "aabb_high": Changed.OBJECTS,
    "body_pos": Changed.BODIES,
    "body_quat": Changed.BODIES,
    "link_pos": Changed.LINKS,
    "link_quat": Changed.LINKS,
    "joint_pos": Changed.JOINTS,
    "touching": Changed.TOUCHING,
    "link_force": Changed.FORCE,
    "awake": Changed.AWAKE,
    "held": Changed.HELD,
}
"""The view's own fields that have working arrays, and the group that each is written with. Velocities of objects belong
to OBJECTS, all of agents to AGENT but for the forces of fingers, which have FINGERS to themselves."""


@dataclasses.dataclass(frozen=True, eq=False)
class PosePlan:
    """Which rows of the view move with a set of trees; runs of rows are slices, which NumPy copies faster."""

    bodies: np.ndarray | slice
    objects: np.ndarray | slice
    roots: np.ndarray
    links: np.ndarray
    link_bodies: np.ndarray
    boxes: BoxPlan
    any_body: bool
    any_object: bool
    agents: bool
    joints: bool


@dataclasses.dataclass(frozen=True, eq=False)
class PoseRows:
    """Plans and writes rows of positions; shared by the worlds of an engine. body_tree: [B] tree of each body."""

    tables: SceneTables
    layout: ModelLayout
    boxes: BoxTable
    body_tree: np.ndarray

    def plan(self, trees: np.ndarray | None) -> PosePlan:
        """What moves with the given trees [T]; None: everything there is."""
        tables = self.tables
        if trees is None:
            moves, chosen = np.ones(len(self.body_tree), bool), np.ones(tables.num_objects, bool)
        else:
            moves = np.concatenate([trees, [False]])[self.body_tree]
            chosen = np.any(self.layout.object_trees & trees, axis=1)
        links = np.flatnonzero(moves[tables.link_body])
        return PosePlan(
            bodies=_run_of(np.flatnonzero(moves)),
            objects=_run_of(np.flatnonzero(chosen)),
            roots=tables.object_root[chosen],
            links=links,
            link_bodies=tables.link_body[links],
            boxes=plan_boxes(self.boxes, chosen),
            any_body=bool(moves.any()),
            any_object=bool(chosen.any()),
            agents=bool(moves[tables.body_agent >= 0].any()),
            joints=bool(chosen[tables.openable_object].any()),
        )

    def refresh(self, plan: PosePlan, data: mujoco.MjData, rows: dict[str, np.ndarray]) -> int:
        """Writes the plan's rows of one world; says what it wrote (`Changed`)."""
        tables, changed = self.tables, Changed.NOTHING
        xpos, xquat, xmat = data.xpos, data.xquat, data.xmat
        if plan.any_body:
            rows["body_pos"][plan.bodies] = xpos[plan.bodies]
            rows["body_quat"][plan.bodies] = xquat[plan.bodies]
            changed |= Changed.BODIES
        if plan.any_object:
            rows["object_pos"][plan.objects] = xpos[plan.roots]
            rows["object_quat"][plan.objects] = xquat[plan.roots]
            rows["object_com"][plan.objects] = data.xipos[plan.roots]
            rows["aabb_low"][plan.objects], rows["aabb_high"][plan.objects] = world_boxes(plan.boxes, xpos, xmat)
            rows["qvel"][:] = data.qvel
            changed |= Changed.OBJECTS
        if plan.joints:
            rows["joint_pos"][:] = data.qpos[tables.openable_qposadr]
            changed |= Changed.JOINTS
        if len(plan.links):
            turn = xmat[plan.link_bodies].reshape(-1, 3, 3)
            offset = (turn @ tables.link_pos[plan.links][..., None])[..., 0]
            rows["link_pos"][plan.links] = xpos[plan.link_bodies] + offset
            rows["link_quat"][plan.links] = _multiply(xquat[plan.link_bodies], tables.link_quat[plan.links])
            changed |= Changed.LINKS
        if plan.agents:
            for name in RAW:
                rows[name][:] = getattr(data, name)
            changed |= Changed.AGENT
        return changed


def _run_of(indices: np.ndarray) -> np.ndarray | slice:
    if len(indices) and indices[-1] - indices[0] + 1 == len(indices):
        return slice(int(indices[0]), int(indices[-1]) + 1)
    return indices


def _multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Products of quaternions [n, 4], w-x-y-z."""
    w, v = p[:, :1], p[:, 1:]
    s, u = q[:, :1], q[:, 1:]
    real = w * s - (v * u).sum(1, keepdims=True)
    return np.concatenate([real, w * u + s * v + np.cross(v, u)], 1)
