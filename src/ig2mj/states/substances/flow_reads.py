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
      objects: on these. links: on forces at these, which are of cleaning tools. knows: False: on more than can be said.
    """

    objects: Int[np.ndarray, "N"]
    is_read: Bool[np.ndarray, "O"]
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
    return _Reads(np.flatnonzero(own), own, links, not (len(found.things.object) and len(slicers)))


def depend_on_moves(
    model: StateModel, before: PhysicsView, view: PhysicsView, starts: Float[np.ndarray, "W K 3"]
) -> bool:
    """Whether what has moved between two views, `before` and `view`, can change steps of contents.

    Args:
      starts: where the streams begin, m, world frame; NaN: there is none.
    """
    reads = _reads(model)
    if not reads.knows:
        return True
    some = _moved(before, view, model.tables.body_object)
    if reads.is_read[some].any() or _touches_differ(model, reads, before, view):
        return True
    if not len(some):
        return False
    low = np.minimum(*(np.asarray(v.aabb_low)[:, None, some] for v in (before, view)))
    high = np.maximum(*(np.asarray(v.aabb_high)[:, None, some] for v in (before, view)))
    start = starts[:, :, None]
    apart = (start + AROUND < low) | (start - BELOW > high)
    return bool((~(apart[..., 0] | apart[..., 1] | apart[..., 2] | np.isnan(start[..., 0]))).any())


AROUND = np.array([float(ASIDE.max()) + SLACK] * 2 + [SLACK], np.float32)
BELOW = np.array([float(ASIDE.max()) + SLACK] * 2 + [FALL + SLACK], np.float32)
"""m from where a stream begins, along and against the axes, to the ends of a box that holds all of it."""


def _moved(before: PhysicsView, view: PhysicsView, owner: Int[np.ndarray, "B"]) -> Int[np.ndarray, "N"]:
    """Objects of which a body has another pose."""
    found = []
    for name in ("body_pos", "body_quat"):
        one, other = np.asarray(getattr(before, name)), np.asarray(getattr(view, name))
        found.append(np.flatnonzero(one != other) // one.shape[-1])
    objects = owner[np.concatenate(found) % len(owner)]
    return np.unique(objects[objects >= 0])


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
