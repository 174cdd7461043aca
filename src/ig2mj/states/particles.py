"""Particles on surfaces: the common part of dust and stains.

A particle is a point with a normal in the frame of a body; it moves with the body for free. It is `placed` when
sampling put it there and `alive` until something wipes it off. Levels are relative to the placed ones, and `placed` is
part of the state, so that a half-cleaned object is still half cleaned after saving and loading (iGibson forgets it).

Axes: W worlds, R rows (one per object that can be dirty this way; `StateParameters.dust_rows`, `.stain_rows`), N = 20
particles.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate, quat_rotate_inverse
from ig2mj.states.host import namespace, put
from ig2mj.states.model import StateModel
from ig2mj.states.spec import Cut, EventStep, Saved, StateSpec

NUM_PARTICLES = 20
"""Particles that dirty an object (paper table A.5, iGibson's particles.py)."""

MIN_PLACED = {"paper": NUM_PARTICLES, "igibson": 5}
"""Fewer placed particles than this are a failure that leaves the object clean: the paper's number is fixed (table A.5),
iGibson's code accepts five (docs/design/rules.md#placed)."""

DUST_RADIUS = 0.0075
"""Metres. Dust is drawn as spheres of 15 mm, half sunk into the surface (iGibson's particles.py)."""

STAIN_THICKNESS = 0.004
"""Metres. Stains are drawn as flat patches (iGibson's particles.py)."""


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
    """Clean objects. NumPy arrays."""
    shape = (num_worlds, num_rows, NUM_PARTICLES)
    return Particles(
        alive=np.zeros(shape, bool),
        placed=np.zeros(shape, bool),
        body=np.zeros(shape, np.int32),
        pos=np.zeros((*shape, 3), np.float32),
        normal=np.tile(np.array([0.0, 0.0, 1.0], np.float32), (*shape, 1)),
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
    """Puts particles on the object of a row at sampled surface points; earlier ones are removed.

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
    xp = namespace(particles.alive, valid)
    valid = xp.broadcast_to(valid, (num_worlds, NUM_PARTICLES))
    enough = xp.sum(valid, axis=-1) >= minimum
    valid = valid & enough[:, None]
    chosen = xp.ones(num_worlds, bool) if worlds is None else xp.asarray(worlds)

    def put_row(field: Array, value: Array) -> Array:
        mask = chosen.reshape(-1, *[1] * (field.ndim - 2))
        return put(field, (slice(None), row), xp.where(mask, value, field[:, row]))

    placed = Particles(
        alive=put_row(particles.alive, valid),
        placed=put_row(particles.placed, valid),
        body=put_row(particles.body, body),
        pos=put_row(particles.pos, pos),
        normal=put_row(particles.normal, normal),
    )
    return placed, enough & chosen


def remove(particles: Particles, row: int, worlds: Bool[Array, "W"] | None = None) -> Particles:
    """Cleans the object of a row (paper table A.5, Dusty(o)=False)."""
    keep = np.zeros((particles.alive.shape[0], 1), bool) if worlds is None else ~worlds[:, None]
    at = (slice(None), row)
    return dataclasses.replace(
        particles,
        alive=put(particles.alive, at, particles.alive[at] & keep),
        placed=put(particles.placed, at, particles.placed[at] & keep),
    )


def stain_sizes(bounding_box: Float[np.ndarray, "R 3"]) -> Float[np.ndarray, "R N"]:
    """Edge lengths, metres, of an object's stain patches from its bounding box (iGibson's object_states)."""
    median = np.median(bounding_box, axis=-1)
    low, high = np.clip(0.06 * median, 0.01, 0.02), np.clip(0.1 * median, 0.02, 0.1)
    return np.linspace(low, high, NUM_PARTICLES, axis=-1)


def _gathered(field: Float[Array, "W B d"], body: Int[Array, "W R N"]) -> Float[Array, "W R N d"]:
    flat = body.reshape(body.shape[0], -1, 1)
    return jnp.take_along_axis(jnp.asarray(field), flat, axis=1).reshape(*body.shape, field.shape[-1])


def particle_state(
    name: str,
    ability: str,
    rows_of: Callable[[StateModel], Int[np.ndarray, "R"]],
    update: Callable[[EventStep], Particles],
    idle: Callable[[EventStep], Bool[Array, ""]],
    aliases: tuple[str, ...],
) -> StateSpec:
    """A state that is a row of particles for every object with an ability; its value is the level.

    Args:
      name: also of the field of `ExtendedStates`, and of the manifest's list of particles: null, or {"body", "pos",
        "quat"} whose z axis is the normal. What is there counts as placed.
      rows_of: objects of the rows. update: the particles after a step. idle: see `StateSpec`.
    """

    def get(model: StateModel, states: Any, view: PhysicsView, obj: int, world: int) -> float:
        row = row_of(rows_of(model), obj)
        levels: Any = np.asarray(_level(getattr(states, name)))
        return 0.0 if row is None else float(levels[world, row])

    def from_manifest(saved: Saved) -> None:
        row = row_of(rows_of(saved.model), saved.obj)
        if row is not None:
            _fill(getattr(saved.states, name), row, saved)

    def _fill(rows: Particles, row: int, saved: Saved) -> None:
        for n, entry in enumerate(saved.values.get(name, ())[:NUM_PARTICLES]):
            if entry is not None and entry["body"] in saved.bodies:
                rows.alive[0, row, n] = rows.placed[0, row, n] = True
                rows.body[0, row, n] = saved.bodies[entry["body"]]
                rows.pos[0, row, n] = entry["pos"]
                rows.normal[0, row, n] = _z_axis(np.asarray(entry["quat"], float))

    return StateSpec(
        name=name,
        get=get,
        abilities=(ability,),
        unit="of placed",
        aliases=aliases,
        fields={name: Particles},
        initial=lambda model: {name: no_particles(1, len(rows_of(model)))},
        update=lambda step: step.having(**{name: update(step)}),
        idle=idle,
        inherit=lambda states, cut: {name: inherit(getattr(states, name), rows_of(cut.model), cut)},
        from_manifest=from_manifest,
    )


def row_of(rows: Int[np.ndarray, "R"], obj: int) -> int | None:
    """The row of an object, or None."""
    mine = np.flatnonzero(rows == obj)
    return int(mine[0]) if len(mine) else None


def inherit(particles: Particles, rows: Int[np.ndarray, "R"], cut: Cut) -> Particles:
    """Rows of halves become copies of their wholes' rows, in the halves' frames.

    Particles keep their place in the world: those of the side that a half lost come to lie on its cut.
    """
    p, tables = cut.model.parameters, cut.model.tables
    place = {int(o): r for r, o in enumerate(rows)}
    moves = [
        (place[h], place[w], m)
        for m, (h, w) in enumerate(zip(p.half_object.tolist(), p.half_whole.tolist(), strict=True))
        if h in place and w in place
    ]
    if not moves:
        return particles
    to, start, half = (np.array(column) for column in zip(*moves, strict=True))
    mask = cut.takes[:, rows[to]]
    offset, turn = p.half_pos[half][:, None], p.half_quat[half][:, None]
    obj = p.half_object[half]
    pos = quat_rotate_inverse(turn, particles.pos[:, start] - offset)
    centre, reach = tables.object_bbox_center[obj][:, None], tables.object_bbox[obj][:, None] / 2
    pos = jnp.clip(pos, centre - reach, centre + reach)
    normal = quat_rotate_inverse(turn, particles.normal[:, start])
    root = np.broadcast_to(tables.object_root[obj][:, None], particles.body[:, start].shape)

    at = np.zeros(len(rows), int)  # by selection: XLA fuses that, but not a scatter
    at[to] = np.arange(len(to))
    chosen = mask[:, at] & np.isin(np.arange(len(at)), to)

    def put_rows(field: Array, value: Array) -> Array:
        these = chosen.reshape(*chosen.shape, *[1] * (field.ndim - 2))
        return jnp.where(these, jnp.asarray(value)[:, at].astype(field.dtype), field)

    return Particles(
        alive=put_rows(particles.alive, particles.alive[:, start]),
        placed=put_rows(particles.placed, particles.placed[:, start]),
        body=put_rows(particles.body, root),
        pos=put_rows(particles.pos, pos),
        normal=put_rows(particles.normal, normal),
    )


_level = jax.jit(level)


def _z_axis(quat: Float[np.ndarray, "4"]) -> Float[np.ndarray, "3"]:
    w, x, y, z = quat / np.linalg.norm(quat)
    return np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
