"""What fills the slots of a camera: the first `count` particles of dust, stains and water that exist, in every world,
then substances and fire (`ig2mj.sensors.substance_slots`).

Axes: W worlds, N particles of all kinds, S slots.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate, quat_to_matrix
from ig2mj.sensors import substance_slots
from ig2mj.sensors.slots import DUST, STAIN, WATER, Slots, free_slots
from ig2mj.sensors.tints import DUST_COLOUR, STAIN_COLOUR, WATER_COLOUR
from ig2mj.states.definitions.water import DROP_RADIUS, NUM_DROPS
from ig2mj.states.model import StateModel
from ig2mj.states.particles import (
    DUST_RADIUS,
    NUM_PARTICLES,
    STAIN_THICKNESS,
    stain_sizes,
)
from ig2mj.states.world import ExtendedStates


def slot_kinds(model: StateModel, count: int) -> tuple[mujoco.mjtGeom, ...]:
    """Of all slots of a camera that shows so many particles: those of particles, then `substance_slots`."""
    return (mujoco.mjtGeom.mjGEOM_ELLIPSOID,) * count + substance_slots.shape_kinds(model, count)


def fill_slots(model: StateModel, states: ExtendedStates, view: PhysicsView, count: int) -> Slots:
    """So many particles, then substances and fire, in the order of `slot_kinds`. Pure."""
    particles, others = _particles(model, states, view, count), substance_slots.shapes(model, states, view, count)
    return particles if others is None else jax.tree.map(lambda *x: jnp.concatenate(x, axis=1), particles, others)


def _particles(model: StateModel, states: ExtendedStates, view: PhysicsView, count: int) -> Slots:
    """The particles that exist, in the order dust, stains, water; those after `count` are not shown. Pure."""
    p, worlds = model.parameters, states.temperature.shape[0]
    dust_rows, stain_rows, sources = len(p.dust_rows), len(p.stain_rows), len(p.water_object)
    patches = stain_sizes(model.tables.object_bbox[p.stain_rows]) / 2 if stain_rows else np.zeros((0, NUM_PARTICLES))
    sizes = np.concatenate(
        [
            np.full((dust_rows * NUM_PARTICLES, 3), DUST_RADIUS),
            np.stack([patches.ravel(), patches.ravel(), np.full(patches.size, STAIN_THICKNESS / 2)], axis=-1),
            np.full((sources * NUM_DROPS, 3), DROP_RADIUS),
        ]
    ).astype(np.float32)
    colours = np.repeat(
        np.array([DUST_COLOUR, STAIN_COLOUR, WATER_COLOUR], np.float32),
        [dust_rows * NUM_PARTICLES, stain_rows * NUM_PARTICLES, sources * NUM_DROPS],
        axis=0,
    )
    owners = np.concatenate(
        [
            np.repeat(p.dust_rows, NUM_PARTICLES),
            np.repeat(p.stain_rows, NUM_PARTICLES),
            np.full(sources * NUM_DROPS, -1),
        ]
    ).astype(np.int32)
    kinds = np.repeat(
        np.array([DUST, STAIN, WATER], np.int32),
        [dust_rows * NUM_PARTICLES, stain_rows * NUM_PARTICLES, sources * NUM_DROPS],
    )

    if not len(kinds):
        return free_slots(worlds, count)

    def rows(dust: Array, stain: Array, water: Array, width: int) -> Array:
        return jnp.concatenate([jnp.asarray(a).reshape(worlds, -1, width) for a in (dust, stain, water)], axis=1)

    shown, at = _shown(rows(states.dust.alive, states.stain.alive, states.water.active, 1)[..., 0], count)

    def of_slots(dust: Array, stain: Array, water: Array, width: int) -> Array:
        return jnp.take_along_axis(rows(dust, stain, water, width), at[..., None], axis=1)

    drops = (worlds, sources * NUM_DROPS)
    body = of_slots(states.dust.body, states.stain.body, jnp.zeros(drops, jnp.int32), 1)
    turn, origin = (jnp.take_along_axis(jnp.asarray(a), body, axis=1) for a in (view.body_quat, view.body_pos))
    pos = of_slots(states.dust.pos, states.stain.pos, states.water.pos, 3)
    upright = jnp.broadcast_to(jnp.array([0.0, 0.0, 1.0]), (*drops, 3))
    normal = of_slots(states.dust.normal, states.stain.normal, upright, 3)
    falls = jnp.asarray(kinds)[at, None] == WATER  # in the world frame
    return Slots(
        pos=jnp.where(falls, pos, origin + quat_rotate(turn, pos)),
        rotation=quat_to_matrix(_turn_to(jnp.where(falls, normal, quat_rotate(turn, normal)))),
        size=jnp.asarray(sizes)[at],
        colour=jnp.asarray(colours)[at],
        owner=jnp.asarray(owners)[at],
        kind=jnp.asarray(kinds)[at],
        body=body[..., 0],
    ).where(shown)


def _shown(there: Bool[Array, "W N"], count: int) -> tuple[Bool[Array, "W S"], Int[Array, "W S"]]:
    """Which slots show a particle, and which: the first so many that are there."""
    worlds, particles = there.shape
    rank = jnp.cumsum(there.astype(jnp.int32), axis=1) - 1
    slot = jnp.where(there & (rank < count), rank, count)
    number = jnp.broadcast_to(jnp.arange(particles, dtype=jnp.int32), there.shape)
    at = jnp.full((worlds, count), -1, jnp.int32)
    at = at.at[jnp.arange(worlds)[:, None], slot].set(number, mode="drop")
    return at >= 0, jnp.maximum(at, 0)


def _turn_to(normal: Float[Array, "W S 3"]) -> Float[Array, "W S 4"]:
    """A rotation that takes z to the normal (unit length); about x by half a turn where it points down."""
    x, y, z = normal[..., 0], normal[..., 1], normal[..., 2]
    quat = jnp.stack([1.0 + z, -y, x, jnp.zeros_like(z)], axis=-1)
    quat = jnp.where((z < -0.9999)[..., None], jnp.array([0.0, 1.0, 0.0, 0.0]), quat)
    return quat / jnp.linalg.norm(quat, axis=-1, keepdims=True)
