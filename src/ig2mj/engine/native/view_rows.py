"""Positions of the view's rows from a world's MjData, only of what moves with a set of trees.

Axes: B bodies, O objects, L links, T trees.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.native.lazy_fields import multiply
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
    "body_pos": Changed.BODIES | Changed.AGENT,
    "body_quat": Changed.BODIES | Changed.AGENT,
    "link_pos": Changed.LINKS,
    "link_quat": Changed.LINKS,
    "joint_pos": Changed.JOINTS,
    "touching": Changed.TOUCHING,
    "link_force": Changed.FORCE,
    "awake": Changed.AWAKE,
    "held": Changed.HELD,
}
"""The view's own fields that have working arrays, and the group that each is written with. Velocities of objects belong
to OBJECTS, all of agents to AGENT but for the forces of fingers, which have FINGERS to themselves. BODIES are those
that are no agent's."""

OF_AGENTS = Changed.AGENT | Changed.FINGERS
"""Groups that tell nothing but of agents."""


@dataclasses.dataclass(frozen=True, eq=False)
class PosePlan:
    """Which rows of the view move with a set of trees; runs of rows are slices, which NumPy copies faster. Bodies are
    the run from the first to the last that moves: what rests between them is as it was.

    link_pos, link_quat: [n, 3, 1], [n, 4] of the links in their bodies' frames.
    """

    bodies: slice
    objects: np.ndarray | slice
    roots: np.ndarray
    links: np.ndarray
    link_bodies: np.ndarray
    link_pos: np.ndarray
    link_quat: np.ndarray
    boxes: BoxPlan
    any_body: bool
    any_other: bool  # than agents'
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
            bodies=_span_of(np.flatnonzero(moves)),
            objects=_run_of(np.flatnonzero(chosen)),
            roots=tables.object_root[chosen],
            links=links,
            link_bodies=tables.link_body[links],
            link_pos=tables.link_pos[links][..., None],
            link_quat=tables.link_quat[links],
            boxes=plan_boxes(self.boxes, chosen),
            any_body=bool(moves.any()),
            any_other=bool(moves[tables.body_agent < 0].any()),
            any_object=bool(chosen.any()),
            agents=bool(moves[tables.body_agent >= 0].any()),
            joints=bool(chosen[tables.openable_object].any()),
        )

    def refresh(self, plan: PosePlan, data: mujoco.MjData, rows: dict[str, np.ndarray]) -> int:
        """Writes the plan's rows of one world; says what it wrote (`Changed`), but for what is agents'."""
        tables, changed = self.tables, Changed.NOTHING
        xpos, xquat, xmat = data.xpos, data.xquat, data.xmat
        if plan.any_body:
            rows["body_pos"][plan.bodies] = xpos[plan.bodies]
            rows["body_quat"][plan.bodies] = xquat[plan.bodies]
        if plan.any_other:
            changed |= Changed.BODIES
        if plan.any_object:
            rows["object_pos"][plan.objects] = xpos.take(plan.roots, 0)  # a quarter of the time of an index
            rows["object_quat"][plan.objects] = xquat.take(plan.roots, 0)
            rows["object_com"][plan.objects] = data.xipos.take(plan.roots, 0)
            rows["aabb_low"][plan.objects], rows["aabb_high"][plan.objects] = world_boxes(plan.boxes, xpos, xmat)
            rows["qvel"][:] = data.qvel
            changed |= Changed.OBJECTS
        if plan.joints:
            rows["joint_pos"][:] = data.qpos.take(tables.openable_qposadr)
            changed |= Changed.JOINTS
        if len(plan.links):
            offset = (xmat.take(plan.link_bodies, 0).reshape(-1, 3, 3) @ plan.link_pos)[..., 0]
            rows["link_pos"][plan.links] = xpos.take(plan.link_bodies, 0) + offset
            rows["link_quat"][plan.links] = multiply(xquat.take(plan.link_bodies, 0), plan.link_quat)
            changed |= Changed.LINKS
        return changed


def _span_of(indices: np.ndarray) -> slice:
    return slice(int(indices[0]), int(indices[-1]) + 1) if len(indices) else slice(0, 0)


def _run_of(indices: np.ndarray) -> np.ndarray | slice:
    span = _span_of(indices)
    return span if span.stop - span.start == len(indices) else indices
