"""SlicedState: a blade with enough force on it cuts; halves take the whole's place (iGibson's sliced.py).

A contact of a slicer's annotated blade with a normal force strictly over the object's threshold (10 N) in any physics
step of the control step cuts it, for good (iGibson sees the last physics step only). Where the object has halves, a
`Swap` asks the engine to put each half where it belongs in the whole, at rest, and the whole where its first half was
parked. The halves inherit every extended state, particles included (iGibson loses those).

Axes: W worlds, O objects, M swapped objects (wholes, then halves), K blades.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_multiply, quat_rotate
from ig2mj.scene.tables import LinkKind
from ig2mj.states.model import StateModel
from ig2mj.states.spec import Cut, EventStep, StateSpec
from ig2mj.states.swap import Swap

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def cut(model: StateModel, sliced: Bool[Array, "W O"], view: PhysicsView) -> Bool[Array, "W O"]:
    """Which objects are cut in this step: sliceable, in one piece, in use, and under a blade with enough force."""
    enough = under_blade(model, view, model.parameters.slice_force)
    return enough & ~sliced & in_use(model, sliced)


def under_blade(model: StateModel, view: PhysicsView, least: Float[np.ndarray, "O"]) -> Bool[Array, "W O"]:
    """Objects on which a blade presses with more than `least` newtons."""
    tables = model.tables
    blades = np.flatnonzero((tables.link_kind == LinkKind.SLICER) & (tables.link_geom >= 0))
    blades = blades[model.parameters.has("slicer")[tables.link_object[blades]]]
    if len(blades) == 0:
        return jnp.zeros(view.object_com.shape[:2], bool)
    force = jnp.asarray(view.link_force)[:, blades]  # [W, K, O]
    own = tables.link_object[blades][:, None] == np.arange(tables.num_objects)
    return jnp.any((force > least) & ~own, axis=1)


def in_use(model: StateModel, sliced: Bool[Array, "W O"]) -> Bool[Array, "W O"]:
    """Not parked: a whole until it is sliced, its halves from then on, everything else unless the scene parks it."""
    p, tables = model.parameters, model.tables
    whole = np.isin(np.arange(tables.num_objects), p.half_whole)
    parked = tables.object_parked & ~whole & (tables.object_part_of < 0)
    used = jnp.broadcast_to(~parked, sliced.shape) & ~(whole & sliced)
    if len(p.half_object) == 0:
        return used
    whole_of = np.full(tables.num_objects, -1)
    whole_of[p.half_object] = p.half_whole
    return used & ((whole_of < 0) | sliced[:, np.maximum(whole_of, 0)])


def apply(
    model: StateModel, states: ExtendedStates, cut_now: Bool[Array, "W O"], view: PhysicsView
) -> tuple[ExtendedStates, Swap]:
    """Marks what is cut, lets halves inherit, and says what is to be moved where."""
    states = dataclasses.replace(states, sliced=states.sliced | cut_now)
    if len(model.parameters.half_object) == 0:
        return states, Swap.nothing(cut_now.shape[0], len(model.swap_objects))
    states = jax.lax.cond(jnp.any(cut_now), lambda s: inherit(model, s, cut_now), lambda s: s, states)
    return states, _swap(model, cut_now, view)


def inherit(model: StateModel, states: ExtendedStates, cut_now: Bool[Array, "W O"]) -> ExtendedStates:
    """Lets the halves of the wholes that are cut take over every extended state (`StateSpec.inherit`)."""
    p = model.parameters
    source = np.arange(model.tables.num_objects)
    source[p.half_object] = p.half_whole
    is_half = source != np.arange(model.tables.num_objects)
    return states.inherited(Cut(model, cut_now[:, source] & is_half, source))


def _swap(model: StateModel, cut_now: Bool[Array, "W O"], view: PhysicsView) -> Swap:
    p = model.parameters
    wholes = np.unique(p.half_whole)
    first_half = np.array([p.half_object[p.half_whole == w][0] for w in wholes])
    pos, quat = jnp.asarray(view.object_pos), jnp.asarray(view.object_quat)
    half_pos = pos[:, p.half_whole] + quat_rotate(quat[:, p.half_whole], p.half_pos)
    half_quat = quat_multiply(quat[:, p.half_whole], p.half_quat)
    others = Swap.nothing(cut_now.shape[0], len(model.swap_objects) - len(wholes) - len(p.half_object))
    return Swap(
        mask=jnp.concatenate([cut_now[:, wholes], cut_now[:, p.half_whole], others.mask], axis=1),
        pos=jnp.concatenate([pos[:, first_half], half_pos, others.pos], axis=1),
        quat=jnp.concatenate([quat[:, first_half], half_quat, others.quat], axis=1),
    )


def set_sliced(
    model: StateModel, states: ExtendedStates, objects: Bool[Array, "#W O"], view: PhysicsView
) -> tuple[ExtendedStates, Swap]:
    """Slices the masked objects that are in one piece and in use (paper table A.5). There is no way back."""
    asked = objects & model.parameters.has("sliceable") & ~states.sliced & in_use(model, states.sliced)
    return apply(model, states, asked, view)


def _update(step: EventStep) -> EventStep:
    cut_now = cut(step.model, step.states.sliced, step.view)
    states, swap = apply(step.model, step.states, cut_now, step.view)
    return dataclasses.replace(step, states=states, cut_now=cut_now, swap=swap)


def _idle(step: EventStep) -> Bool[Array, ""]:
    return ~jnp.any(cut(step.model, step.states.sliced, step.view))


SPEC = StateSpec.of_objects(
    "sliced", bool, False, _update, settable=False, idle=_idle, abilities=("sliceable",), aliases=("sliced_state",)
)
