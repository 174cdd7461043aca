"""Particles stuck to surfaces: what dust and stains share.

A particle is a point with a normal in the frame of a body; it moves with the body for free. It is `placed` when
sampling put it there and `alive` until something wipes it off. Levels are relative to the placed ones, and `placed` is
part of the state, so that a half-cleaned object is still half cleaned after saving and loading (iGibson forgets it,
spec/states.md section 16).

Axes: W worlds, R rows (one per object that can be dirty this way; `StateParameters.dust_rows`, `.stain_rows`), N = 20
particles.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate

NUM_PARTICLES = 20
"""Particles that dirty an object (paper table A.5, iGibson's particles.py)."""

MIN_PLACED = {"paper": NUM_PARTICLES, "igibson": 5}
"""Fewer placed particles than this are a failure that leaves the object clean: the paper's number is fixed (table A.5),
iGibson's code puts up with five (spec/states.md section 17, row 19)."""

DUST_RADIUS = 0.0075
"""Metres. Dust is drawn as spheres of 15 mm, half sunk into the surface (spec/states.md 8.2)."""

STAIN_THICKNESS = 0.004
"""Metres. Stains are drawn as flat patches (spec/states.md 8.2)."""


@struct.dataclass
class Particles:
    """Rows of particles.

    Attributes:
      alive: still there. placed: was put there by the last sampling. body: MuJoCo body each sticks to.
      pos, normal: in that body's frame; on the surface, outward, unit length.
    """

    alive: Bool[Array, "W R N"]
    placed: Bool[Array, "W R N"]
    body: Int[Array, "W R N"]
    pos: Float[Array, "W R N 3"]
    normal: Float[Array, "W R N 3"]


def no_particles(num_worlds: int, num_rows: int) -> Particles:
    """Clean objects."""
    shape = (num_worlds, num_rows, NUM_PARTICLES)
    return Particles(
        alive=jnp.zeros(shape, bool),
        placed=jnp.zeros(shape, bool),
        body=jnp.zeros(shape, jnp.int32),
        pos=jnp.zeros((*shape, 3), jnp.float32),
        normal=jnp.zeros((*shape, 3), jnp.float32).at[..., 2].set(1.0),
    )


def level(particles: Particles) -> Float[Array, "W R"]:
    """Fraction of the placed particles that remain (table A.4); 0 where none was placed."""
    placed = jnp.sum(particles.placed, axis=-1)
    return jnp.sum(particles.alive, axis=-1) / jnp.maximum(placed, 1)


def exceeds(particles: Particles, threshold: Float[np.ndarray, "R"]) -> Bool[Array, "W R"]:
    """Whether more than `threshold` of the placed particles remain, strictly; false where none was placed."""
    return jnp.sum(particles.alive, axis=-1) > threshold * jnp.sum(particles.placed, axis=-1)


def world_positions(particles: Particles, view: PhysicsView) -> Float[Array, "W R N 3"]:
    """Where the particles are, world frame."""
    return _gathered(view.body_pos, particles.body) + quat_rotate(
        _gathered(view.body_quat, particles.body), particles.pos
    )


def world_normals(particles: Particles, view: PhysicsView) -> Float[Array, "W R N 3"]:
    """Outward normals, world frame."""
    return quat_rotate(_gathered(view.body_quat, particles.body), particles.normal)


def place(
    particles: Particles,
    row: int,
    body: Int[Array, "#W N"],
    pos: Float[Array, "#W N 3"],
    normal: Float[Array, "#W N 3"],
    valid: Bool[Array, "#W N"],
    minimum: int,
    worlds: Bool[Array, "W"] | None = None,
) -> tuple[Particles, Bool[Array, "W"]]:
    """Puts particles on the object of a row at sampled surface points; those that were there go.

    Args:
      particles: all rows.
      row: which row.
      body, pos, normal: surface points in the bodies' frames; a leading axis of 1 serves all worlds.
      valid: points whose sampling succeeded. minimum: `MIN_PLACED` of the rules in force.
      worlds: where to do it; None: everywhere.

    Returns:
      The rows, and where it succeeded: with fewer than `minimum` valid points the object is left clean.
    """
    num_worlds = particles.alive.shape[0]
    valid = jnp.broadcast_to(valid, (num_worlds, NUM_PARTICLES))
    enough = jnp.sum(valid, axis=-1) >= minimum
    valid = valid & enough[:, None]
    chosen = jnp.ones(num_worlds, bool) if worlds is None else jnp.asarray(worlds)

    def put(field: Array, value: Array) -> Array:
        mask = chosen.reshape(-1, *[1] * (field.ndim - 2))
        return jnp.asarray(field).at[:, row].set(jnp.where(mask, value, field[:, row]))

    placed = Particles(
        alive=put(particles.alive, valid),
        placed=put(particles.placed, valid),
        body=put(particles.body, body),
        pos=put(particles.pos, pos),
        normal=put(particles.normal, normal),
    )
    return placed, enough & chosen


def remove(particles: Particles, row: int, worlds: Bool[Array, "W"] | None = None) -> Particles:
    """Cleans the object of a row (paper table A.5, Dusty(o)=False)."""
    keep = jnp.zeros((particles.alive.shape[0], 1), bool) if worlds is None else ~jnp.asarray(worlds)[:, None]
    return dataclasses.replace(
        particles,
        alive=jnp.asarray(particles.alive).at[:, row].set(particles.alive[:, row] & keep),
        placed=jnp.asarray(particles.placed).at[:, row].set(particles.placed[:, row] & keep),
    )


def stain_sizes(bounding_box: Float[np.ndarray, "R 3"]) -> Float[np.ndarray, "R N"]:
    """Edge lengths, metres, of an object's stain patches from its bounding box (spec/states.md section 0)."""
    median = np.median(bounding_box, axis=-1)
    low, high = np.clip(0.06 * median, 0.01, 0.02), np.clip(0.1 * median, 0.02, 0.1)
    return np.linspace(low, high, NUM_PARTICLES, axis=-1)


def _gathered(field: Float[Array, "W B d"], body: Int[Array, "W R N"]) -> Float[Array, "W R N d"]:
    flat = body.reshape(body.shape[0], -1, 1)
    return jnp.take_along_axis(jnp.asarray(field), flat, axis=1).reshape(*body.shape, field.shape[-1])
