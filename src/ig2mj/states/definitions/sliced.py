"""SlicedState: a blade with enough force on it cuts; halves take the whole's place (spec/states.md section 10).

A contact of a slicer's annotated blade with a normal force strictly over the object's threshold (10 N) in any physics
step of the control step cuts it, for good (iGibson sees the last physics step only). Where the object has halves, a
`Swap` asks the engine to put each half where it belongs in the whole, at rest, and the whole where its first half was
parked. The halves inherit every extended state, particles included (iGibson loses those, spec/states.md 19.8).

Axes: W worlds, O objects, M swapped objects (wholes, then halves), K blades.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_multiply, quat_rotate, quat_rotate_inverse
from ig2mj.scene.tables import LinkKind
from ig2mj.states.model import StateModel
from ig2mj.states.particles import Particles
from ig2mj.states.swap import Swap

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def cut(model: StateModel, sliced: Bool[Array, "W O"], view: PhysicsView) -> Bool[Array, "W O"]:
    """Which objects are cut in this step: sliceable, in one piece, in use, and under a blade with enough force."""
    tables = model.tables
    blades = np.flatnonzero((tables.link_kind == LinkKind.SLICER) & (tables.link_geom >= 0))
    blades = blades[model.parameters.has("slicer")[tables.link_object[blades]]]
    if len(blades) == 0:
        return jnp.zeros(sliced.shape, bool)
    force = jnp.asarray(view.link_force)[:, blades]  # [W, K, O]
    own = tables.link_object[blades][:, None] == np.arange(tables.num_objects)
    enough = jnp.any((force > model.parameters.slice_force) & ~own, axis=1)
    return enough & ~sliced & in_use(model, sliced)


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
        worlds = cut_now.shape[0]
        nothing = Swap(jnp.zeros((worlds, 0), bool), jnp.zeros((worlds, 0, 3)), jnp.zeros((worlds, 0, 4)))
        return states, nothing
    states = jax.lax.cond(jnp.any(cut_now), lambda s: inherit(model, s, cut_now), lambda s: s, states)
    return states, _swap(model, cut_now, view)


def inherit(model: StateModel, states: ExtendedStates, cut_now: Bool[Array, "W O"]) -> ExtendedStates:
    """Copies every extended state of the wholes that are cut to their halves.

    Particles keep their place in the world: those of the side that a half lost come to lie on its cut.
    """
    p = model.parameters
    source = np.arange(model.tables.num_objects)
    source[p.half_object] = p.half_whole
    is_half = source != np.arange(model.tables.num_objects)
    takes = cut_now[:, source] & is_half

    def of_whole(field: Array) -> Array:
        return jnp.where(takes, field[:, source], field)

    return dataclasses.replace(
        states,
        temperature=of_whole(states.temperature),
        max_temperature=of_whole(states.max_temperature),
        wetness=of_whole(states.wetness),
        toggled=of_whole(states.toggled),
        press_count=of_whole(states.press_count),
        sliced=of_whole(states.sliced),
        dust=_inherit_particles(model, states.dust, p.dust_rows, takes),
        stain=_inherit_particles(model, states.stain, p.stain_rows, takes),
    )


def _inherit_particles(
    model: StateModel, particles: Particles, rows: Int[np.ndarray, "R"], takes: Bool[Array, "W O"]
) -> Particles:
    """Rows of halves become copies of their wholes' rows, in the halves' frames."""
    p, tables = model.parameters, model.tables
    row_of = {int(o): r for r, o in enumerate(rows)}
    moves = [
        (row_of[h], row_of[w], m)
        for m, (h, w) in enumerate(zip(p.half_object.tolist(), p.half_whole.tolist(), strict=True))
        if h in row_of and w in row_of
    ]
    if not moves:
        return particles
    to, start, half = (np.array(column) for column in zip(*moves, strict=True))
    mask = takes[:, rows[to]]
    offset, turn = p.half_pos[half][:, None], p.half_quat[half][:, None]
    obj = p.half_object[half]
    pos = quat_rotate_inverse(turn, particles.pos[:, start] - offset)
    centre, reach = tables.object_bbox_center[obj][:, None], tables.object_bbox[obj][:, None] / 2
    pos = jnp.clip(pos, centre - reach, centre + reach)
    normal = quat_rotate_inverse(turn, particles.normal[:, start])
    root = np.broadcast_to(tables.object_root[obj][:, None], particles.body[:, start].shape)

    def put(field: Array, value: Array) -> Array:
        chosen = mask.reshape(*mask.shape, *[1] * (field.ndim - 2))
        return jnp.asarray(field).at[:, to].set(jnp.where(chosen, value, field[:, to]).astype(field.dtype))

    return Particles(
        alive=put(particles.alive, particles.alive[:, start]),
        placed=put(particles.placed, particles.placed[:, start]),
        body=put(particles.body, root),
        pos=put(particles.pos, pos),
        normal=put(particles.normal, normal),
    )


def _swap(model: StateModel, cut_now: Bool[Array, "W O"], view: PhysicsView) -> Swap:
    p = model.parameters
    wholes = np.unique(p.half_whole)
    first_half = np.array([p.half_object[p.half_whole == w][0] for w in wholes])
    pos, quat = jnp.asarray(view.object_pos), jnp.asarray(view.object_quat)
    half_pos = pos[:, p.half_whole] + quat_rotate(quat[:, p.half_whole], p.half_pos)
    half_quat = quat_multiply(quat[:, p.half_whole], p.half_quat)
    mask = jnp.concatenate([cut_now[:, wholes], cut_now[:, p.half_whole]], axis=1)
    return Swap(
        mask=mask,
        pos=jnp.concatenate([pos[:, first_half], half_pos], axis=1),
        quat=jnp.concatenate([quat[:, first_half], half_quat], axis=1),
    )


def set_sliced(
    model: StateModel, states: ExtendedStates, objects: Bool[Array, "#W O"], view: PhysicsView
) -> tuple[ExtendedStates, Swap]:
    """Slices the masked objects that are in one piece and in use (paper table A.5). There is no way back."""
    asked = objects & model.parameters.has("sliceable") & ~states.sliced & in_use(model, states.sliced)
    return apply(model, states, asked, view)
