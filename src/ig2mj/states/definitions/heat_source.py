"""HeatSourceOrSink: which sources are on, and on which objects they act (iGibson's heat_source_or_sink.py).

A source that asks for it is on only while its object is toggled on, or while it is closed. It acts either on the
objects inside it (oven, microwave, fridge) or on those whose centre of mass is near its annotated link (stove, burner).
Tables A.2 and A.3 give every source a switch and a link; the taxonomy's fridge has no switch and an oven acts on what
is inside whatever its link, so both sets of rules read these per category (docs/design/rules.md#sources).

Axes: W worlds, O objects, S sources (`StateParameters.heat_*`).
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.definitions.open import is_open
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import BOX_SLACK, Query
from ig2mj.states.relations.relations import Relations
from ig2mj.states.spec import StateSpec

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


FAR_BEYOND = 0.01
"""Metres beyond the reach of a source where no rounding can bring an object back within it."""


def queries(model: StateModel) -> list[Query]:
    """The pairs whose Inside the sources need."""
    return [("inside", int(i), int(j)) for i, j in _inside_pairs(model)]


def switched_on(model: StateModel, toggled_on: Bool[Array, "W O"], opened: Bool[Array, "W O"]) -> Bool[Array, "W S"]:
    """Whether each source is on; one that acts by nearness and has no link never is."""
    p = model.parameters
    on = ~p.heat_requires_toggled_on | toggled_on[:, p.heat_object]
    on &= ~p.heat_requires_closed | ~opened[:, p.heat_object]
    return on & (p.heat_requires_inside | (p.heat_link >= 0))


def acts_on(model: StateModel, on: Bool[Array, "W S"], view: PhysicsView, relations: Relations) -> Bool[Array, "W O S"]:
    """Whether each source acts on each object; false for objects without a temperature."""
    p, num_objects = model.parameters, model.tables.num_objects
    worlds = on.shape[0]
    if len(p.heat_object) == 0:
        return jnp.zeros((worlds, num_objects, 0), bool)
    if np.any(p.heat_link >= 0):
        link = jnp.asarray(view.link_pos)[:, np.maximum(p.heat_link, 0)]
        offset = jnp.asarray(view.object_com)[:, :, None] - link[:, None]
        reached = jnp.sum(offset * offset, axis=-1) <= p.heat_distance**2
    else:
        reached = jnp.zeros((worlds, num_objects, len(p.heat_object)), bool)
    pairs = _inside_pairs(model)
    if len(pairs):
        place = np.full((num_objects, len(p.heat_object)), len(pairs))
        for column in np.flatnonzero(p.heat_requires_inside):
            mine = np.flatnonzero(pairs[:, 1] == p.heat_object[column])
            place[pairs[mine, 0], column] = mine
        inside = relations.inside(pairs)
        inside = jnp.concatenate([inside, jnp.zeros((worlds, 1), bool)], axis=-1)[:, place]
    else:
        inside = jnp.zeros(reached.shape, bool)
    return on[:, None] & jnp.where(p.heat_requires_inside, inside, reached) & p.thermal[:, None]


def all_out_of_reach(model: StateModel, view: PhysicsView) -> bool:
    """On the host: no object with a temperature is anywhere near a source, however distances are rounded.

    No source acts on anything then; false where anything is not finite.
    """
    p = model.parameters
    thermal, boxes, own, links = _places(model)
    com = np.asarray(view.object_com).take(thermal, 1)[:, :, None]
    low, high = np.asarray(view.aabb_low).take(boxes, 1), np.asarray(view.aabb_high).take(boxes, 1)
    low, high = low[:, None] - (BOX_SLACK + FAR_BEYOND), high[:, None] + (BOX_SLACK + FAR_BEYOND)
    beyond = (com < low) | (com > high)
    if not (beyond[..., 0] | beyond[..., 1] | beyond[..., 2] | own).all():
        return False
    if not len(links):
        return True
    offset = np.abs(com - np.asarray(view.link_pos)[:, None, p.heat_link[links]]).max(-1)
    return bool((offset > p.heat_distance[links] + FAR_BEYOND).all())


@functools.lru_cache(maxsize=8)
def _places(
    model: StateModel,
) -> tuple[Int[np.ndarray, "T"], Int[np.ndarray, "C"], Bool[np.ndarray, "T C"], Int[np.ndarray, "N"]]:
    """Objects with a temperature; those that act on what is inside them; where both are one; sources that act by
    nearness."""
    p = model.parameters
    inside, thermal = p.heat_requires_inside, np.flatnonzero(p.thermal)
    boxes = np.unique(p.heat_object[inside])
    return thermal, boxes, thermal[:, None] == boxes, np.flatnonzero(~inside & (p.heat_link >= 0))


def _inside_pairs(model: StateModel) -> Int[np.ndarray, "P 2"]:
    """(object with a temperature, source that acts on what is inside it)."""
    p = model.parameters
    containers = np.unique(p.heat_object[p.heat_requires_inside])
    pairs = [(i, j) for i in np.flatnonzero(p.thermal) for j in containers if i != j]
    return np.array(pairs, int).reshape(-1, 2)


@functools.partial(jax.jit, static_argnums=0)
def _switched_on(
    model: StateModel, toggled_on: Bool[Array, "W O"], joint_pos: Float[Array, "W J"]
) -> Bool[Array, "W S"]:
    return switched_on(model, toggled_on, is_open(model, joint_pos))


def _get(model: StateModel, states: ExtendedStates, view: PhysicsView, obj: int, world: int) -> bool:
    on = np.asarray(_switched_on(model, states.toggled_on, view.joint_pos))
    mine = np.flatnonzero(model.parameters.heat_object == obj)
    return bool(len(mine) and on[world, mine[0]])


SPEC = StateSpec(name="heat_source", get=_get, abilities=("heatSource", "coldSource"), aliases=("heat_source_or_sink",))
