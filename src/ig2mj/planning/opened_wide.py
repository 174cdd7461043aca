"""What the kinematic rung opens: the door, drawer or lid that a hand is at, as wide as hands open it. The sampler opens
any joint of an object, anywhere where `open` holds, and leaves a hand no way to what is behind another one, or through
a gap of some centimetres."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.snapshot import Snapshot
from ig2mj.planning.joints import OPEN_TO, STEPS, OpenableJoint, openable_joints
from ig2mj.sampling.joints import JointMover
from ig2mj.sampling.query import SceneQuery

TRIED = (OPEN_TO, 0.9, 1.0, 0.5)
"""Shares of their range to which joints are opened, in this order: those that a hand reaches first, then those at which
a lid stays open that falls shut from there, at last half open."""

OPEN_FROM = 0.05
"""Share of a joint's range from which on it is one of those that have been opened."""


PUSHED = 0.05
"""s in which what a step of a joint meets gives way."""


def opened_wide(query: SceneQuery, index: int, hand: Float[np.ndarray, "3"] | None = None) -> Snapshot | None:
    """The world of a query with joints of an object opened wide, at rest; None: they are, or do not rest so.

    Args:
      index: number of the object. hand: m, world frame: the joint is opened whose link is nearest; None: all that are
        open.
    """
    tables, model = query.scene.tables, query.scene.model
    own = np.flatnonzero(tables.openable_object == index)
    if hand is not None:
        joints = openable_joints(query.scene, query.view, index)
        if not joints:
            return None
        nearest = model.joint(min(joints, key=lambda joint: _apart(joint, hand)).name).qposadr[0]
        own = own[tables.openable_qposadr[own] == nearest]
    count, range_ = len(tables.openable_object), tables.openable_open - tables.openable_closed
    before = np.asarray(query.view.joint_pos)[:, :count]
    share = (before - tables.openable_closed) / range_
    moves = np.isin(np.arange(count), own)[None] & (share < OPEN_TO)
    if hand is None:
        moves &= share > OPEN_FROM
    if not moves.any():
        return None
    whole = query.save()
    for to in TRIED:
        positions = np.where(share < to, tables.openable_closed + to * range_, before)
        _pull(query, index, positions, moves)
        rests = (np.asarray(query.view.joint_pos)[:, :count] - tables.openable_closed) / range_
        if (rests >= np.maximum(share, OPEN_FROM))[moves].all():
            return query.save()
        query.load(whole)
    return None


def _pull(query: SceneQuery, index: int, positions: Float[np.ndarray, "1 J"], moves: Bool[np.ndarray, "1 J"]) -> None:
    """Moves joints there in steps, so that what is in the way, or lies in a drawer, is pushed along."""
    before = np.asarray(query.view.joint_pos)[:, : positions.shape[1]].copy()
    for part in np.linspace(0.0, 1.0, STEPS + 1)[1:]:
        query.write(JointMover(query, index).plan(before + part * (positions - before), moves).write)
        query.settle(PUSHED)
    query.settle()


def _apart(joint: OpenableJoint, point: Float[np.ndarray, "3"]) -> float:
    """m from a point to the nearest place at which a link is taken."""
    return min(float(np.linalg.norm(place - point)) for place, _ in (*joint.grips, *joint.edges, *joint.inner_grips))
