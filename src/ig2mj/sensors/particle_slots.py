"""Which particles a camera shows: the first `count` that exist, of dust, stains and water, in every world.

Axes: W worlds, N particles of all kinds, S slots.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_to_matrix
from ig2mj.sensors.render_model import NOWHERE
from ig2mj.sensors.tints import DUST_COLOUR, STAIN_COLOUR, WATER_COLOUR
from ig2mj.states.definitions.water import DROP_RADIUS, NUM_DROPS
from ig2mj.states.model import StateModel
from ig2mj.states.particles import (
    DUST_RADIUS,
    NUM_PARTICLES,
    STAIN_THICKNESS,
    stain_sizes,
    world_normals,
    world_positions,
)
from ig2mj.states.world import ExtendedStates

DUST, STAIN, WATER = range(3)


@struct.dataclass
class Slots:
    """Ellipsoids to draw.

    Attributes:
      pos, rotation: world frame. size: half axes, m. colour: rgb, 0..1.
      owner: the object that is dirty, -1 none. kind: one of `DUST`, `STAIN`, `WATER`, or -1 where the slot is free.
      body: that the particle sticks to; 0, the world, for water.
    """

    pos: Float[Array, "W S 3"]
    rotation: Float[Array, "W S 3 3"]
    size: Float[Array, "W S 3"]
    colour: Float[Array, "W S 3"]
    owner: Int[Array, "W S"]
    kind: Int[Array, "W S"]
    body: Int[Array, "W S"]


def fill_slots(model: StateModel, states: ExtendedStates, view: PhysicsView, count: int) -> Slots:
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
    upright = jnp.broadcast_to(jnp.array([0.0, 0.0, 1.0]), (worlds, sources * NUM_DROPS, 3))

    def rows(dust: Array, stain: Array, water: Array, width: int) -> Array:
        return jnp.concatenate([a.reshape(worlds, -1, width) for a in (dust, stain, water)], axis=1)

    no_body = jnp.zeros((worlds, sources * NUM_DROPS), jnp.int32)
    there = rows(states.dust.alive, states.stain.alive, states.water.active, 1)[..., 0]
    pos = rows(world_positions(states.dust, view), world_positions(states.stain, view), states.water.pos, 3)
    normal = rows(world_normals(states.dust, view), world_normals(states.stain, view), upright, 3)
    slot = _slot_of(there, count)
    world = jnp.arange(worlds)[:, None]

    def put(blank: Array, values: Array) -> Array:
        return jnp.broadcast_to(blank, (worlds, count, *blank.shape)).at[world, slot].set(values, mode="drop")

    shape = (worlds, len(sizes))
    quat = _turn_to(put(jnp.array([0.0, 0.0, 1.0]), normal))
    return Slots(
        pos=put(jnp.array(NOWHERE, jnp.float32), pos),
        rotation=quat_to_matrix(quat),
        size=put(jnp.full(3, 1e-4, jnp.float32), jnp.broadcast_to(sizes, (*shape, 3))),
        colour=put(jnp.zeros(3, jnp.float32), jnp.broadcast_to(colours, (*shape, 3))),
        owner=put(jnp.array(-1, jnp.int32), jnp.broadcast_to(owners, shape)),
        kind=put(jnp.array(-1, jnp.int32), jnp.broadcast_to(kinds, shape)),
        body=put(jnp.array(0, jnp.int32), rows(states.dust.body, states.stain.body, no_body, 1)[..., 0]),
    )


def _slot_of(there: Bool[Array, "W N"], count: int) -> Int[Array, "W N"]:
    """The slot of each particle; `count`, which is out of range, for those that are not shown."""
    rank = jnp.cumsum(there.astype(jnp.int32), axis=1) - 1
    return jnp.where(there & (rank < count), rank, count)


def _turn_to(normal: Float[Array, "W S 3"]) -> Float[Array, "W S 4"]:
    """A rotation that takes z to the normal (unit length); about x by half a turn where it points down."""
    x, y, z = normal[..., 0], normal[..., 1], normal[..., 2]
    quat = jnp.stack([1.0 + z, -y, x, jnp.zeros_like(z)], axis=-1)
    quat = jnp.where((z < -0.9999)[..., None], jnp.array([0.0, 1.0, 0.0, 0.0]), quat)
    return quat / jnp.linalg.norm(quat, axis=-1, keepdims=True)
