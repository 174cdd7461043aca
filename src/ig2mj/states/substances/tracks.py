"""What robots carry on under feet and wheels: part of getting dirty (`StateOptions.soiling`).

A robot that passes a covered point of a floor takes on what covers it, and leaves it on points of floors that it
passes afterwards, until it has made `PRINTS` of them. It stands on a floor that it touches, or whose point is at most
`HEIGHT` below the origin of its base: bases that slide on planes touch nothing.

Axes: W worlds, A agents, F floors, N = 20 points, D objects that can be covered, U substances.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import quat_rotate
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat
from ig2mj.states.substances.model import of

PRINTS = 8.0
"""Points that a robot covers after it has passed a covered one."""

REACH, HEIGHT = 0.3, 0.25
"""m from the base to points that a robot passes, along the floor; and above it."""


def update(step: EventStep) -> EventStep:
    """One control step of all robots."""
    if not len(step.model.tables.agent_names) or not len(_floors(step.model)):
        return step
    passed, covers = _passed(step)
    acts = _takes(step, passed, covers) | _leaves(step, passed, covers)
    fields = {name: jnp.asarray(getattr(step.states, name)) for name in ("coat", "tracked")}
    return step.having(**jax.lax.cond(jnp.any(acts), lambda: _tracked(step, passed, covers), lambda: fields))


def idle(step: EventStep) -> Bool[Array, ""]:
    """No robot takes on or leaves anything."""
    if not len(step.model.tables.agent_names) or not len(_floors(step.model)):
        return jnp.array(True)
    passed, covers = _passed(step)
    return ~jnp.any(_takes(step, passed, covers) | _leaves(step, passed, covers))


def _floors(model: StateModel) -> Int[np.ndarray, "F"]:
    """Rows of floors on the D axis."""
    return np.flatnonzero(model.tables.object_is_floor[of(model).covered])


def _passed(step: EventStep) -> tuple[Bool[Array, "W A F N"], Bool[Array, "W F U N"]]:
    """Points of floors that each robot passes, and which points each substance covers."""
    found, view, floors = of(step.model), step.view, _floors(step.model)
    turned, origin = (jnp.asarray(x)[:, found.body[floors]] for x in (view.body_quat, view.body_pos))
    points = origin + quat_rotate(turned, found.pos[floors])  # [W, F, N, 3]
    offset = jnp.asarray(view.agent.base_pos)[:, :, None, None] - points[:, None]
    low = (offset[..., 2] <= HEIGHT) & (offset[..., 2] >= -HEIGHT)
    stands = jnp.asarray(view.agent.touching)[:, :, found.covered[floors], None] | low
    near = jnp.sum(offset[..., :2] ** 2, axis=-1) <= REACH**2
    return near & stands, coat.as_points(jnp.asarray(step.states.coat)[:, floors])


def _takes(step: EventStep, passed: Bool[Array, "W A F N"], covers: Bool[Array, "W F U N"]) -> Bool[Array, "W A U"]:
    """What robots take on that they do not carry in full."""
    full = jnp.asarray(step.states.tracked) >= PRINTS
    return jnp.any(passed[:, :, :, None] & covers[:, None], axis=(2, 4)) & ~full


def _leaves(step: EventStep, passed: Bool[Array, "W A F N"], covers: Bool[Array, "W F U N"]) -> Bool[Array, "W A U"]:
    """What robots leave on points that it does not cover yet."""
    carries = jnp.asarray(step.states.tracked) > 0
    return jnp.any(passed[:, :, :, None] & ~covers[:, None], axis=(2, 4)) & carries


def _tracked(step: EventStep, passed: Bool[Array, "W A F N"], covers: Bool[Array, "W F U N"]) -> dict[str, Array]:
    model, tracked = step.model, jnp.asarray(step.states.tracked)
    takes = jnp.any(passed[:, :, :, None] & covers[:, None], axis=(2, 4))
    left = passed[:, :, :, None] & ~covers[:, None] & (tracked > 0)[:, :, None, :, None]  # [W, A, F, U, N]
    prints = jnp.sum(left, axis=(2, 4)).astype(jnp.float32)
    bits = coat.as_bits(jnp.any(left, axis=1))  # [W, F, U]
    coats = jnp.asarray(step.states.coat)
    return {
        "coat": coats.at[:, _floors(model)].set(coats[:, _floors(model)] | bits),
        "tracked": jnp.where(takes, PRINTS, jnp.maximum(tracked - prints, 0.0)),
    }
