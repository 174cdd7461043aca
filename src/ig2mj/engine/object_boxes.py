"""World boxes of objects from body poses, by the tight rule or by iGibson's (see `ig2mj.engine.base.BOX_RULES`).

Which boxes make up which object's; the rules themselves are in `ig2mj.geometry.boxes`.

Axes: K boxed items (convex pieces by the tight rule, bodies by iGibson's), sorted by object; V corners of the largest.
"""

from __future__ import annotations

import dataclasses

import jax
import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.engine.layout import ModelLayout
from ig2mj.geometry.boxes import Boxes, core_boxes, core_reaches, link_boxes, piece_cores, turned_boxes, turned_reaches
from ig2mj.scene.tables import SceneTables


@dataclasses.dataclass(frozen=True, eq=False)
class BoxTable:
    """What the boxes of all objects are made of. The tight rule uses points and rounding, iGibson's centres and halves.

    Attributes:
      owner, body: [K] object and body. Objects without collision geometry have one point: their base's origin.
      points: [K, 3, V] corners in the body's frame; ends of the core of round primitives.
      radius: [K, 1]; axis: [K, 3] in the body's frame, the flat direction of a cylinder, zero for all others. An item
        reaches `radius * sqrt(1 - axis_i^2)` beyond its points along world axis i.
      center, half: [K, 3] box in the body's frame, m, Bullet's margin included. any_round: some radius is not zero.
    """

    rule: str
    owner: np.ndarray
    body: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    axis: np.ndarray
    center: np.ndarray
    half: np.ndarray
    any_round: bool

    def boxes(self, rotation: Float[np.ndarray, "K 3 3"]) -> Boxes:
        """Boxes (low, high) of all items about their bodies' origins; `rotation` turns the bodies into the world."""
        if self.rule == "tight":
            return core_boxes(rotation, self.points, self.radius if self.any_round else None, self.axis)
        return turned_boxes(rotation, self.center, self.half)

    def reaches(self, rotation: Float[jax.Array, "3 3 K W"]) -> Float[jax.Array, "2 3 K W"]:
        """The same in JAX, for many worlds, as `core_reaches` gives it."""
        if self.rule == "tight":
            return core_reaches(rotation, self.points, self.radius if self.any_round else None, self.axis)
        return turned_reaches(rotation, self.center, self.half)


@dataclasses.dataclass(frozen=True, eq=False)
class BoxPlan:
    """The rows of a `BoxTable` for some objects, gathered once. `starts`: [n] first row of each of the n objects."""

    starts: np.ndarray
    rows: BoxTable


def make_box_table(rule: str, model: mujoco.MjModel, tables: SceneTables, layout: ModelLayout) -> BoxTable:
    """The table for a rule, "tight" or "igibson"."""
    points, radius, axis = piece_cores(
        tables.piece_kind, tables.piece_size, tables.piece_vertices, tables.piece_pos, tables.piece_quat
    )
    owner, body = tables.piece_object, tables.piece_body
    if rule == "igibson":
        kept = ~np.isin(body, _split_off(model, tables, layout))
        body, center, half = link_boxes(body[kept], points[kept], radius[kept], axis[kept])
        owner, count = tables.body_object[body], len(body)
        points, radius, axis = np.zeros((count, 3, 1)), np.zeros((count, 1)), np.zeros((count, 3))
    else:
        center, half = np.zeros((len(owner), 3)), np.zeros((len(owner), 3))
    bare = np.setdiff1d(np.arange(tables.num_objects), owner)
    extra = len(bare)
    owner, body = np.concatenate([owner, bare]), np.concatenate([body, tables.object_root[bare]])
    order = np.argsort(owner, kind="stable")

    def padded(a: np.ndarray, *shape: int) -> np.ndarray:
        return np.concatenate([a, np.zeros((extra, *shape))])[order]

    return BoxTable(
        rule=rule,
        owner=owner[order].astype(int),
        body=body[order].astype(int),
        points=padded(points, *points.shape[1:]),
        radius=padded(radius, 1),
        axis=padded(axis, 3),
        center=padded(center, 3),
        half=padded(half, 3),
        any_round=bool(np.any(radius > 0)),
    )


def plan_boxes(table: BoxTable, chosen: np.ndarray) -> BoxPlan:
    """Prepares boxes of the chosen objects, mask [O]; they come in the objects' order."""
    rows = np.flatnonzero(chosen[table.owner])
    columns = {f.name: getattr(table, f.name) for f in dataclasses.fields(table)}
    gathered = {name: column[rows] for name, column in columns.items() if isinstance(column, np.ndarray)}
    picked = dataclasses.replace(table, **gathered, any_round=bool(gathered["radius"].any()))
    return BoxPlan(np.flatnonzero(np.diff(picked.owner, prepend=-1)), picked)


def world_boxes(plan: BoxPlan, xpos: np.ndarray, xmat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of the plan's objects.

    Args:
      xpos, xmat: [B, 3] and [B, 9] poses of all bodies, as in MjData.

    Returns:
      low, high: [n, 3] float64, world frame.
    """
    rows = plan.rows
    low, high = rows.boxes(xmat.take(rows.body, 0).reshape(-1, 3, 3))
    position = xpos.take(rows.body, 0)
    low, high = np.add(low, position), np.add(high, position)
    if len(plan.starts) == len(rows.body):
        return low, high
    return np.minimum.reduceat(low, plan.starts), np.maximum.reduceat(high, plan.starts)


def _split_off(model: mujoco.MjModel, tables: SceneTables, layout: ModelLayout) -> np.ndarray:
    """Bodies that hang on their object by no joint: iGibson's box is the main body's alone (aabb.py)."""
    roots = model.dof_bodyid[layout.extra_dofadr]
    parents, found = np.asarray(model.body_parentid), np.zeros(model.nbody, bool)
    found[roots] = True
    for body in range(1, model.nbody):  # parents come first
        found[body] |= found[parents[body]]
    return np.flatnonzero(found & (tables.body_object >= 0))
