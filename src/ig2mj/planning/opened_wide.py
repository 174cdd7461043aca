"""What the kinematic rung opens stands as wide open as hands open it: the sampler's joints are anywhere where `open`
holds, and a hand has no way through a gap of some centimetres."""

from __future__ import annotations

import numpy as np

from ig2mj.engine.snapshot import Snapshot
from ig2mj.planning.joints import OPEN_TO
from ig2mj.sampling.joints import JointMover
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.tables import SceneTables

TRIED = (OPEN_TO, 0.9, 1.0, 0.5)
"""Shares of their range to which joints are opened, in this order: those that a hand reaches first, then those at which
a lid stays open that falls shut from there, at last half open."""

OPEN_FROM = 0.05
"""Share of a joint's range from which on it is one of those that have been opened."""


def opened_wide(query: SceneQuery, tables: SceneTables, index: int) -> Snapshot | None:
    """The world of a query with the open joints of an object opened wide, at rest; None: they are, or do not rest so.

    Args:
      query: in the state in which the object is open. tables: of its scene. index: number of the object.
    """
    own = tables.openable_object == index
    now = np.asarray(query.view.joint_pos)[:, : len(own)]
    range_ = tables.openable_open - tables.openable_closed
    share = (now - tables.openable_closed) / range_
    moves = own & (share > OPEN_FROM) & (share < OPEN_TO)
    if not moves.any():
        return None
    mover = JointMover(query, index)
    for to in TRIED:
        positions = np.where(share < to, tables.openable_closed + to * range_, now)
        if not mover.problem(mover.plan(positions, moves)):
            rests = (np.asarray(query.view.joint_pos)[:, : len(own)] - tables.openable_closed) / range_
            if (rests >= share)[moves].all():
                return query.save()
        query.load(mover.before)
    return None
