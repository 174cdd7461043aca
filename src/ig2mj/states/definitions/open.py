"""Open: whether an articulated object's relevant joints are open (iGibson's open.py, paper table A.1).

A joint is open strictly beyond 5 % of its range from the closed end towards the open end. The paper calls the closed
end the lower limit; where a model's annotation says that it closes at the upper one, that end counts. An object is open
when any joint is. iGibson's code knows models that open to both sides (a sliding door in the middle of its range is
open, at either end it is not): there, every side must be open (docs/design/rules.md#open).

Axes: W worlds, O objects, J openable joints.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.states.host import Randomness, namespace, split, uniform
from ig2mj.states.model import StateModel
from ig2mj.states.spec import StateSpec

OPEN_FRACTION = 0.05
"""For a joint whose object lacks the ability: it opens nothing, but can be asked."""

SHARE = (0.001, 0.999)
"""Part of the way from a threshold to an end that is sampled; not quite from 0: at the threshold itself it is shut."""


def joints_open(model: StateModel, joint_pos: Float[Array, "W J"]) -> Bool[Array, "W J"]:
    """Whether each joint is beyond its threshold."""
    tables = model.tables
    direction = np.sign(tables.openable_open - tables.openable_closed)
    return direction * (joint_pos - thresholds(model)) > 0


def thresholds(model: StateModel) -> Float[np.ndarray, "J"]:
    """Joint position at which each joint begins to be open."""
    tables = model.tables
    return _between(model, tables.openable_closed, tables.openable_open)


def other_thresholds(model: StateModel) -> Float[np.ndarray, "J"]:
    """The same, seen from the open end."""
    return _between(model, model.tables.openable_open, model.tables.openable_closed)


def _between(model: StateModel, start: Float[np.ndarray, "J"], end: Float[np.ndarray, "J"]) -> Float[np.ndarray, "J"]:
    fraction = model.parameters.open_fraction[model.tables.openable_object]
    fraction = np.where(np.isfinite(fraction), fraction, OPEN_FRACTION)
    return ((1 - fraction) * start + fraction * end).astype(np.float32)


def is_open(model: StateModel, joint_pos: Float[Array, "W J"]) -> Bool[Array, "W O"]:
    """Whether each object is open; false for objects without the ability or without relevant joints."""
    tables = model.tables
    opened = _any_of_object(model, joints_open(model, jnp.asarray(joint_pos)))
    if not model.paper and np.any(tables.object_both_sides):
        direction = np.sign(tables.openable_closed - tables.openable_open)
        from_other_side = direction * (jnp.asarray(joint_pos) - other_thresholds(model)) > 0
        opened &= ~tables.object_both_sides | _any_of_object(model, from_other_side)
    return opened & model.parameters.has("openable")


def sample_open(
    model: StateModel,
    joint_pos: Float[Array, "W J"],
    objects: Bool[Array, "#W O"],
    value: bool,
    key: Randomness,
    fully: bool = False,
) -> tuple[Float[Array, "W J"], Bool[Array, "W J"]]:
    """Joint positions with which the masked objects are open, or closed (paper table A.5).

    True: a random, not empty subset of the relevant joints moves to a uniformly random position between the threshold
    and the open end; `fully`: all of them to the open end. False: all move to a random position between the closed end
    and the threshold; `fully`: to the closed end. In iGibson's rules a joint that opens to both sides
    moves to a place between its two thresholds. Every joint uses its own annotated direction (iGibson pairs joints
    with the wrong ones). To be written to the engine with zero velocity.

    Returns:
      Positions, and which joints move.
    """
    tables = model.tables
    pick, place = split(key)
    mine = objects[:, tables.openable_object] & model.parameters.has("openable")[tables.openable_object]
    xp = namespace(joint_pos)
    moves = xp.broadcast_to(mine, joint_pos.shape)
    if value and not fully:
        moves = moves & _random_subset(model, moves.shape[0], pick)
    end = tables.openable_open if value else tables.openable_closed
    if value and not model.paper:
        both_sides = tables.object_both_sides[tables.openable_object]
        end = np.where(both_sides, other_thresholds(model), end)
    share = 1.0 if fully else uniform(place, joint_pos.shape, SHARE[0], SHARE[1])
    target = thresholds(model) + share * (end - thresholds(model))
    return xp.where(moves, target, joint_pos).astype(np.float32), moves


def _random_subset(model: StateModel, worlds: int, key: Randomness) -> Bool[Array, "W J"]:
    """Of each object's joints a subset whose size is uniform from 1 to all of them (iGibson's open.py)."""
    tables = model.tables
    order, size = split(key)
    rank_of = uniform(order, (worlds, len(tables.openable_object)))
    same = tables.openable_object[:, None] == tables.openable_object
    xp = namespace(rank_of)
    rank = xp.sum(same & (rank_of[:, None, :] < rank_of[:, :, None]), axis=-1)
    count = same.sum(axis=-1)
    requested = uniform(size, (worlds, tables.num_objects))[:, tables.openable_object]
    return rank < 1 + xp.floor(requested * count)


def _any_of_object(model: StateModel, of_joint: Bool[Array, "W J"]) -> Bool[Array, "W O"]:
    """Reduces joints to objects."""
    owner = model.tables.openable_object
    members = [np.flatnonzero(owner == o) for o in range(model.tables.num_objects)]
    width = max((len(m) for m in members), default=0)
    slots = np.array([np.concatenate([m, np.full(width - len(m), len(owner))]) for m in members], int)
    padded = jnp.concatenate([of_joint, jnp.zeros((of_joint.shape[0], 1), bool)], axis=-1)
    return jnp.any(padded[:, slots.reshape(model.tables.num_objects, width)], axis=-1)


_is_open = jax.jit(is_open, static_argnums=0)

SPEC = StateSpec(
    name="open",
    get=lambda model, states, view, o, w: bool(np.asarray(_is_open(model, view.joint_pos))[w, o]),
    abilities=("openable",),
)
