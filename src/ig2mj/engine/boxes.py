"""World boxes of objects from body poses, by the tight rule or by iGibson's (see `ig2mj.engine.base.BOX_RULES`).

Axes: K boxed things (convex pieces by the tight rule, bodies by iGibson's), sorted by object; V corners of the largest.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout
from ig2mj.scene.tables import PieceKind, SceneTables

BULLET_MARGIN_SINGLE, BULLET_MARGIN_COMPOUND = 0.003, 0.004
"""Metres that pybullet's box stands off one hull, and a compound of hulls (spec/states.md section 24)."""


@dataclasses.dataclass(frozen=True, eq=False)
class BoxTable:
    """What the boxes of all objects are made of. The tight rule uses points and rounding, iGibson's centres and halves.

    Attributes:
      owner, body: [K] object and body. Objects without collision geometry have one point: their base's origin.
      points: [K, 3, V] corners in the body's frame; ends of the core of round primitives.
      radius: [K, 1]; axis: [K, 3] in the body's frame, the flat direction of a cylinder, zero for all others. A thing
        reaches `radius * sqrt(1 - axis_i^2)` beyond its points along world axis i.
      center, half: [K, 3] box in the body's frame; margin: [K, 1] m. any_round: some radius is not zero.
    """

    rule: str
    owner: np.ndarray
    body: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    axis: np.ndarray
    center: np.ndarray
    half: np.ndarray
    margin: np.ndarray
    any_round: bool


@dataclasses.dataclass(frozen=True, eq=False)
class BoxPlan:
    """The rows of a `BoxTable` for some objects, gathered once.

    Attributes:
      starts: [n] first row of each of the n objects. round: some row has a radius. The others: as in the table.
    """

    starts: np.ndarray
    body: np.ndarray
    points: np.ndarray
    radius: np.ndarray
    axis: np.ndarray
    center: np.ndarray
    half: np.ndarray
    margin: np.ndarray
    round: bool


def make_box_table(rule: str, model: mujoco.MjModel, tables: SceneTables, layout: ModelLayout) -> BoxTable:
    """The table for a rule, "tight" or "igibson"."""
    rotation = _matrices(tables.piece_quat)
    points, radius, axis = _cores(tables, rotation)
    owner, body = tables.piece_object, tables.piece_body
    width = points.shape[2] if len(points) else 1
    if rule == "igibson":
        kept = ~np.isin(body, _split_off(model, tables, layout))
        owner, body = owner[kept], body[kept]
        spread = radius[kept] * np.sqrt(np.maximum(0.0, 1.0 - axis[kept] ** 2))
        low, high = points[kept].min(-1, initial=np.inf) - spread, points[kept].max(-1, initial=-np.inf) + spread
        bodies, group, count = np.unique(body, return_inverse=True, return_counts=True)
        box_low, box_high = np.full((len(bodies), 3), np.inf), np.full((len(bodies), 3), -np.inf)
        np.minimum.at(box_low, group, low)
        np.maximum.at(box_high, group, high)
        owner, body = tables.body_object[bodies], bodies
        center, half = (box_low + box_high) / 2, (box_high - box_low) / 2
        margin = np.where(count > 1, BULLET_MARGIN_COMPOUND, BULLET_MARGIN_SINGLE)[:, None]
        points, radius, axis = np.zeros((len(bodies), 3, 1)), np.zeros((len(bodies), 1)), np.zeros((len(bodies), 3))
    else:
        center, half, margin = np.zeros((len(owner), 3)), np.zeros((len(owner), 3)), np.zeros((len(owner), 1))
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
        points=padded(points, 3, width if rule == "tight" else 1),
        radius=padded(radius, 1),
        axis=padded(axis, 3),
        center=padded(center, 3),
        half=padded(half, 3),
        margin=padded(margin, 1),
        any_round=bool(np.any(radius > 0)),
    )


def plan_boxes(table: BoxTable, chosen: np.ndarray) -> BoxPlan:
    """Prepares boxes of the chosen objects, mask [O]; they come in the objects' order."""
    rows = np.flatnonzero(chosen[table.owner])
    owner = table.owner[rows]
    radius = table.radius[rows]
    return BoxPlan(
        starts=np.flatnonzero(np.diff(owner, prepend=-1)),
        body=table.body[rows],
        points=table.points[rows],
        radius=radius,
        axis=table.axis[rows],
        center=table.center[rows],
        half=table.half[rows],
        margin=table.margin[rows],
        round=bool(radius.any()),
    )


def world_boxes(rule: str, plan: BoxPlan, xpos: np.ndarray, xmat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes of the plan's objects.

    Args:
      rule: of the table that the plan was made from.
      xpos, xmat: [B, 3] and [B, 9] poses of all bodies, as in MjData.

    Returns:
      low, high: [n, 3] float64, world frame.
    """
    rotation = xmat[plan.body].reshape(-1, 3, 3)
    if rule == "tight":
        turned = rotation @ plan.points
        low, high = turned.min(-1), turned.max(-1)
        if plan.round:
            along = (rotation @ plan.axis[..., None])[..., 0]
            reach = plan.radius * np.sqrt(np.maximum(0.0, 1.0 - along * along))
            low, high = low - reach, high + reach
    else:
        center = (rotation @ plan.center[..., None])[..., 0]
        half = (np.abs(rotation) @ plan.half[..., None])[..., 0] + plan.margin
        low, high = center - half, center + half
    position = xpos[plan.body]
    low, high = low + position, high + position
    if len(plan.starts) == len(plan.body):
        return low, high
    return np.minimum.reduceat(low, plan.starts), np.maximum.reduceat(high, plan.starts)


def _cores(tables: SceneTables, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points [K, 3, V], radius [K, 1] and flat axis [K, 3] of every piece in its body's frame."""
    kind, size = tables.piece_kind, tables.piece_size
    local = np.array(tables.piece_vertices)
    round_piece = kind != PieceKind.POLYHEDRON
    length = np.where(kind == PieceKind.SPHERE, 0.0, size[:, 1])
    if round_piece.any():
        ends = np.zeros((int(round_piece.sum()), local.shape[1], 3))
        ends[:, :, 2] = np.where(np.arange(local.shape[1]) % 2, 1.0, -1.0) * length[round_piece, None]
        local[round_piece] = ends
    points = rotation @ local.transpose(0, 2, 1) + tables.piece_pos[..., None]
    radius = np.where(round_piece, size[:, 0], 0.0)[:, None]
    axis = np.where((kind == PieceKind.CYLINDER)[:, None], rotation[:, :, 2], 0.0)
    return points, radius, axis


def _split_off(model: mujoco.MjModel, tables: SceneTables, layout: ModelLayout) -> np.ndarray:
    """Bodies that hang on their object by no joint: iGibson's box is the main body's alone (spec/states.md 4.2)."""
    roots = model.dof_bodyid[layout.extra_dofadr]
    parents, found = np.asarray(model.body_parentid), np.zeros(model.nbody, bool)
    found[roots] = True
    for body in range(1, model.nbody):  # parents come first
        found[body] |= found[parents[body]]
    return np.flatnonzero(found & (tables.body_object >= 0))


def _matrices(quat: np.ndarray) -> np.ndarray:
    """Rotation matrices [n, 3, 3] of quaternions [n, 4], w-x-y-z."""
    out = np.zeros((len(quat), 9))
    for row, q in zip(out, quat, strict=True):
        mujoco.mju_quat2Mat(row, q)
    return out.reshape(-1, 3, 3)
