"""On the host: whether steps of contents and coats depend on what has moved between two views.

They depend on containers, tools, what can absorb, machines, taps, objects of transition rules, on what these touch, and
on what the streams meet. Whatever else moves leaves them as they are (`ig2mj.states.substances.flow_step`).

Axes: W worlds, O objects, B bodies, K streams.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.knowledge.transitions import DRYERS, STIRRERS, WASHERS
from ig2mj.scene.tables import LinkKind
from ig2mj.states.model import StateModel
from ig2mj.states.substances import applying
from ig2mj.states.substances.model import of
from ig2mj.states.substances.streams import ASIDE, FALL

SLACK = 0.02
"""m by which streams and boxes may be apart and count as near: more than roundings, and than a lip of a rim."""


class _Reads(NamedTuple):
    """What steps of contents depend on.

    Attributes:
      objects: on these. is_read: whether each body is of one of them. links: on forces at these, which are of cleaning
        tools. knows: False: on more than can be said.
    """

    objects: Int[np.ndarray, "N"]
    is_read: Bool[np.ndarray, "B"]
    links: Int[np.ndarray, "L"]
    knows: bool


@functools.lru_cache(maxsize=8)
def _reads(model: StateModel) -> _Reads:
    found, tables, p = of(model), model.tables, model.parameters
    kinds = (*WASHERS, *DRYERS, *STIRRERS, *applying.BRUSHES)
    own = np.isin(np.array(tables.object_categories, object), kinds)
    for objects in (found.containers.object, p.tool_object, applying.absorbers(model), p.water_object):
        own[objects] = True
    own[found.things.object] = True
    links = np.unique(p.tool_link[p.tool_link >= 0])
    slicers = tables.link_object[tables.link_kind == LinkKind.SLICER]
    of_bodies = np.append(own, False)[tables.body_object]  # the last: of no object
    return _Reads(np.flatnonzero(own), of_bodies, links, not (len(found.things.object) and len(slicers)))


class Reach(NamedTuple):
    """Boxes that hold streams, m, world frame: low and high corners. Of no stream, a box that nothing is in."""

    low: Float[np.ndarray, "W K 1 3"]
    high: Float[np.ndarray, "W K 1 3"]


def reach(starts: Float[np.ndarray, "W K 3"]) -> Reach:
    """Boxes of the streams that begin at these places, m, world frame; NaN: there is none."""
    start = starts[:, :, None]
    there = ~np.isnan(start)
    return Reach(np.where(there, start - BELOW, np.inf), np.where(there, start + AROUND, -np.inf))


def depend_on_moves(model: StateModel, before: PhysicsView, view: PhysicsView, streams: Reach | None) -> bool:
    """Whether what has moved between two views, `before` and `view`, can change steps of contents.

    Args:
      streams: where there are streams; None: there are none.
    """
    reads = _reads(model)
    if not reads.knows:
        return True
    owner = model.tables.body_object
    bodies = _moved(before, view, len(owner))
    if reads.is_read[bodies].any() or _touches_differ(model, reads, before, view):
        return True
    if streams is None or not len(bodies):
        return False
    objects = np.unique(owner[bodies])
    return any(_meets(streams, v, objects[objects >= 0]) for v in (before, view))


def _meets(streams: Reach, view: PhysicsView, objects: Int[np.ndarray, "N"]) -> bool:
    low, high = (np.asarray(a).take(objects, 1)[:, None] for a in (view.aabb_low, view.aabb_high))
    near = (low <= streams.high) & (high >= streams.low)
    return bool(np.count_nonzero(np.logical_and.reduce(near, axis=-1)))


AROUND = np.array([float(ASIDE.max()) + SLACK] * 2 + [SLACK], np.float32)
BELOW = np.array([float(ASIDE.max()) + SLACK] * 2 + [FALL + SLACK], np.float32)
"""m from where a stream begins, along and against the axes, to the ends of a box that holds all of it."""


def _moved(before: PhysicsView, view: PhysicsView, count: int) -> Int[np.ndarray, "n"]:
    """Bodies that have another pose, of so many, some of them more than once."""
    found = []
    for name, width in (("body_pos", 3), ("body_quat", 4)):
        differs = np.flatnonzero(np.asarray(getattr(before, name)) != np.asarray(getattr(view, name)))
        found.append(differs // width)
    moved = np.concatenate(found)
    return moved if len(before.body_pos) == 1 else moved % count


def _touches_differ(model: StateModel, reads: _Reads, before: PhysicsView, view: PhysicsView) -> bool:
    if not _are_equal(before.touching, view.touching) and not np.array_equal(
        before.touching[:, reads.objects], view.touching[:, reads.objects]
    ):
        return True
    if not len(reads.links):
        return False
    if not _are_equal(before.link_force, view.link_force) and not np.array_equal(
        before.link_force[:, reads.links] > 0, view.link_force[:, reads.links] > 0
    ):
        return True
    tools = model.parameters.tool_object
    return not _are_equal(before.awake, view.awake) and not np.array_equal(before.awake[:, tools], view.awake[:, tools])


def _are_equal(one: Array, other: Array) -> bool:
    return one is other or np.asarray(one).tobytes() == np.asarray(other).tobytes()
