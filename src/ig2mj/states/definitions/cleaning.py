"""Cleaning tools: what they touch they wipe off (spec/states.md 8.3).

A tool removes, at once, every particle of an object it touches whose centre is in the world box of its annotated
cleaning area, or of the whole tool where the model has none. Stains go only when the tool is soaked. No movement or
force is asked for. A tool with a switch cleans only while it is on (iGibson's vacuum cleaner works when it is off,
spec/states.md 19.17).

Axes: W worlds, T tools, R rows of particles, N particles.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_to_matrix
from ig2mj.states.model import StateModel
from ig2mj.states.particles import Particles, world_positions

BOX_MARGIN = 0.003
"""Metres that Bullet adds to a link's box (spec/states.md section 24)."""


def working(model: StateModel, toggled: Bool[Array, "W O"]) -> Bool[Array, "W T"]:
    """Tools that are switched on, or have no switch."""
    tools = model.parameters.tool_object
    return toggled[:, tools] | ~model.parameters.has("toggleable")[tools]


def update(
    model: StateModel,
    particles: Particles,
    rows: Int[np.ndarray, "R"],
    can_clean: Bool[Array, "W T"],
    view: PhysicsView,
) -> Particles:
    """One step of all tools on one kind of particles.

    Args:
      model: constants.
      particles: of one kind.
      rows: the objects of its rows.
      can_clean: the tool can take this kind of particle now.
      view: physics.
    """
    tools = model.parameters.tool_object
    if len(tools) == 0 or len(rows) == 0:
        return particles
    touching = jnp.asarray(view.touching)[:, tools][:, :, rows] & can_clean[..., None]  # [W, T, R]
    touching &= jnp.any(particles.alive, axis=-1)[:, None]
    alive = jax.lax.cond(
        jnp.any(touching),
        lambda: particles.alive & ~_wiped(model, particles, touching, view),
        lambda: particles.alive,
    )
    return dataclasses.replace(particles, alive=alive)


def _wiped(
    model: StateModel, particles: Particles, touching: Bool[Array, "W T R"], view: PhysicsView
) -> Bool[Array, "W R N"]:
    low, high = regions(model, view)
    pos = world_positions(particles, view)
    wiped = jnp.zeros(particles.alive.shape, bool)
    for tool in range(touching.shape[1]):
        in_region = jnp.all((low[:, tool, None, None] <= pos) & (pos <= high[:, tool, None, None]), axis=-1)
        wiped |= in_region & touching[:, tool, :, None]
    return wiped


def regions(model: StateModel, view: PhysicsView) -> tuple[Float[Array, "W T 3"], Float[Array, "W T 3"]]:
    """World box in which each tool cleans."""
    p, tables = model.parameters, model.tables
    low, high = jnp.asarray(view.aabb_low)[:, p.tool_object], jnp.asarray(view.aabb_high)[:, p.tool_object]
    if len(tables.link_kind) == 0 or len(p.tool_link) == 0:
        return low, high
    link = np.maximum(p.tool_link, 0)
    half = tables.link_half[link]
    axes = jnp.abs(quat_to_matrix(jnp.asarray(view.link_quat)[:, link]))
    reach = jnp.sum(axes * half[:, None, :], axis=-1) + BOX_MARGIN
    centre = jnp.asarray(view.link_pos)[:, link]
    has_area = ((p.tool_link >= 0) & np.any(half > 0, axis=-1))[:, None]
    return jnp.where(has_area, centre - reach, low), jnp.where(has_area, centre + reach, high)
