"""Cleaning tools remove the particles that they touch (iGibson's cleaning_tool.py).

A tool removes, at once, every particle of an object it touches whose centre is in the world box of its annotated
cleaning area, or of the whole tool where the model has none. The boxes are Bullet's: local boxes, those of hulls with
their margin, turned together (`ig2mj.geometry.boxes.turned_boxes`). An annotated area is a box shape in Bullet, whose
box has no margin. Where the area has geometry, only contacts through it count, so
that the handle of a broom cleans nothing. Stains go only when the tool is soaked. No movement or minimum force is
required. A tool with a switch cleans only while it is on (iGibson's vacuum cleaner works even when it is off).

Axes: W worlds, T tools, R rows of particles, N particles.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.boxes import link_boxes, piece_cores, turned_boxes
from ig2mj.geometry.poses import quat_to_matrix
from ig2mj.states.model import StateModel
from ig2mj.states.particles import Particles, world_positions


def working(model: StateModel, toggled_on: Bool[Array, "W O"]) -> Bool[Array, "W T"]:
    """Tools that are switched on, or have no switch."""
    tools = model.parameters.tool_object
    return toggled_on[:, tools] | ~model.parameters.has("toggleable")[tools]


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
    if len(model.parameters.tool_object) == 0 or len(rows) == 0:
        return particles
    meets = meeting(model, particles, rows, can_clean, view)
    alive = jax.lax.cond(
        jnp.any(meets),
        lambda: particles.alive & ~_wiped(model, particles, meets, view),
        lambda: particles.alive,
    )
    return dataclasses.replace(particles, alive=alive)


def meeting(
    model: StateModel,
    particles: Particles,
    rows: Int[np.ndarray, "R"],
    can_clean: Bool[Array, "W T"],
    view: PhysicsView,
) -> Bool[Array, "W T R"]:
    """Which tool touches which object that has particles left; arguments as of `update`."""
    touched = touching(model, view)[:, :, rows] & can_clean[..., None]
    return touched & jnp.any(particles.alive, axis=-1)[:, None]


def _wiped(
    model: StateModel, particles: Particles, meets: Bool[Array, "W T R"], view: PhysicsView
) -> Bool[Array, "W R N"]:
    low, high = regions(model, view)
    pos = world_positions(particles, view)
    wiped = jnp.zeros(particles.alive.shape, bool)
    for tool in range(meets.shape[1]):
        wiped |= _in_region(low[:, tool], high[:, tool], pos) & meets[:, tool, :, None]
    return wiped


def within(model: StateModel, pos: Float[Array, "W R N 3"], view: PhysicsView) -> Bool[Array, "W T R N"]:
    """Which points (m, world frame) are in the area in which each tool cleans."""
    low, high = regions(model, view)
    return jnp.stack([_in_region(low[:, t], high[:, t], pos) for t in range(low.shape[1])], axis=1)


def _in_region(
    low: Float[Array, "W 3"], high: Float[Array, "W 3"], pos: Float[Array, "W R N 3"]
) -> Bool[Array, "W R N"]:
    return jnp.all((low[:, None, None] <= pos) & (pos <= high[:, None, None]), axis=-1)


def touching(model: StateModel, view: PhysicsView) -> Bool[Array, "W T O"]:
    """What each tool touches with the part that cleans.

    The view tells which contacts a link has by their force. A tool that sleeps has none, but what it touched before it
    fell asleep is remembered for the whole tool, and counts: water can still soak it and let it take a stain.
    """
    p, links = model.parameters, model.tables.link_geom
    touched = jnp.asarray(view.touching)[:, p.tool_object]
    if len(links) == 0:
        return touched
    link = np.maximum(p.tool_link, 0)
    by_area = (p.tool_link >= 0) & (links[link] >= 0)
    if not by_area.any():
        return touched
    pressing = (jnp.asarray(view.link_force)[:, link] > 0) | ~jnp.asarray(view.awake)[:, p.tool_object, None]
    return touched & (pressing | ~by_area[:, None])


def regions(model: StateModel, view: PhysicsView) -> tuple[Float[Array, "W T 3"], Float[Array, "W T 3"]]:
    """World box, low and high corners (m), in which each tool cleans."""
    p, areas = model.parameters, _boxes_of_tools(model)
    frames = [jnp.asarray(view.body_pos)[:, areas.body], jnp.asarray(view.link_pos)[:, areas.link]]
    turns = [jnp.asarray(view.body_quat)[:, areas.body], jnp.asarray(view.link_quat)[:, areas.link]]
    low, high = turned_boxes(quat_to_matrix(jnp.concatenate(turns, axis=1)), areas.center, areas.half)
    at = jnp.concatenate(frames, axis=1)
    low, high = low + at, high + at
    boxes = [np.flatnonzero(areas.tool == t) for t in range(len(p.tool_object))]
    rows = np.full((len(boxes), max(map(len, boxes), default=0)), len(areas.tool))  # beyond the last: a box of nothing
    for row, own in zip(rows, boxes, strict=True):
        row[: len(own)] = own
    nothing = jnp.full((len(low), 1, 3), jnp.inf)
    low, high = jnp.concatenate([low, nothing], axis=1), jnp.concatenate([high, -nothing], axis=1)
    return jnp.min(low[:, rows], axis=2), jnp.max(high[:, rows], axis=2)


class _Areas(NamedTuple):
    """Local boxes, first those in bodies' frames, then those in links'; `tool` is an index among the tools."""

    tool: Int[np.ndarray, "N"]
    body: Int[np.ndarray, "Nb"]
    link: Int[np.ndarray, "Nl"]
    center: Float[np.ndarray, "N 3"]
    half: Float[np.ndarray, "N 3"]


def _boxes_of_tools(model: StateModel) -> _Areas:
    """The box of a tool's cleaning area, or those of all its bodies. Host side, at tracing."""
    p, tables = model.parameters, model.tables
    area_half = tables.link_half[p.tool_link] if len(tables.link_half) else np.zeros((len(p.tool_link), 3))
    has_area = (p.tool_link >= 0) & np.any(area_half > 0, axis=-1)
    number = {int(o): t for t, o in enumerate(p.tool_object) if not has_area[t]}
    mine = np.isin(tables.piece_object, list(number))
    columns = (tables.piece_kind, tables.piece_size, tables.piece_vertices, tables.piece_pos, tables.piece_quat)
    body, center, half = link_boxes(tables.piece_body[mine], *piece_cores(*(c[mine] for c in columns)))
    with_area = np.flatnonzero(has_area)
    return _Areas(
        tool=np.array([*(number[int(o)] for o in tables.body_object[body]), *with_area], int),
        body=body.astype(int),
        link=p.tool_link[with_area],
        center=np.concatenate([center, np.zeros((len(with_area), 3))]).astype(np.float32),
        half=np.concatenate([half, area_half[with_area]]).astype(np.float32),
    )
