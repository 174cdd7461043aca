"""Washing machines, dishwashers and dryers: what is done to the objects in them while they run.

A machine runs while it is closed and switched on; one without a switch, while it is closed. A washing machine soaks
what absorbs water, takes dust and stains off, and every substance that water removes, or what else is in the machine:
on or in its objects (OmniGibson's washer rules). A dryer takes water away.

Axes: W worlds, O objects, D objects that can be covered, U substances, M machines.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.engine.view import Array
from ig2mj.knowledge.transitions import DRYERS, WASHERS
from ig2mj.states.definitions import open
from ig2mj.states.definitions.dust import DUST
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep
from ig2mj.states.substances.model import of


def _machines(model: StateModel, categories: Sequence[str]) -> Int[np.ndarray, "M"]:
    return np.flatnonzero([category in categories for category in model.tables.object_categories])


def has_machines(model: StateModel) -> bool:
    """Whether a scene has any."""
    return any(len(_machines(model, categories)) for categories, _ in KINDS)


def _running(step: EventStep, machines: Int[np.ndarray, "M"]) -> Bool[Array, "W M"]:
    """Which machines run."""
    has_switch = step.model.parameters.has("toggleable")[machines]
    on = jnp.where(has_switch, jnp.asarray(step.states.toggled_on)[:, machines], True)
    return on & ~open.is_open(step.model, step.view.joint_pos)[:, machines]


def _inside(step: EventStep, machines: Int[np.ndarray, "M"], runs: Bool[Array, "W M"]) -> Bool[Array, "W M O"]:
    """Which loose objects are in which machine that runs: their centre is in its box."""
    model, view = step.model, step.view
    com = jnp.asarray(view.object_com)[:, None]
    low, high = jnp.asarray(view.aabb_low)[:, machines, None], jnp.asarray(view.aabb_high)[:, machines, None]
    loose = ~model.tables.object_fixed & (np.arange(model.tables.num_objects) != machines[:, None])
    return jnp.all((com >= low) & (com <= high), axis=-1) & loose & runs[..., None]


def _washed(step: EventStep, inside: Bool[Array, "W M O"]) -> dict[str, Any]:
    """States after washing machines have run for a step."""
    model, states, found = step.model, step.states, of(step.model)
    coat, of_covered = jnp.asarray(states.coat), inside[:, :, found.covered]
    there = jnp.any(of_covered[..., None] & ((coat > 0) | (jnp.asarray(states.absorbed) > 0))[:, None], axis=2)
    if len(found.containers.object):
        holds = inside[:, :, found.containers.object, None] & (jnp.asarray(states.volume) > 0)[:, None]
        there |= jnp.any(holds, axis=2)  # [W, M, U]
    able = found.dry | found.wet | jnp.any(there[:, :, None] & found.cleaners, axis=-1)
    gone = jnp.any(of_covered[..., None] & able[:, :, None], axis=1)  # [W, D, U]
    washed = jnp.any(inside, axis=1)
    soaked = np.where(np.isfinite(model.parameters.wetness_soaked), model.parameters.wetness_soaked, 0.0)
    wet = jnp.asarray(states.wetness)
    new: dict[str, Any] = {
        "coat": jnp.where(gone, np.uint32(0), coat),
        "wetness": jnp.where(washed, jnp.maximum(wet, soaked.astype(np.float32)), wet),
    }
    for dirt in (DUST, STAIN):
        new[dirt.name] = jnp.asarray(getattr(states, dirt.name).alive) & ~washed[:, dirt.rows(model), None]
    return new


def _dried(step: EventStep, inside: Bool[Array, "W M O"]) -> dict[str, Any]:
    """States after dryers have run for a step."""
    states, found = step.states, of(step.model)
    dried = jnp.any(inside, axis=1)
    coat = jnp.asarray(states.coat)
    water = np.arange(len(found.names)) == found.water
    wet = jnp.asarray(states.wetness)
    return {
        "coat": jnp.where(dried[:, found.covered, None] & water, np.uint32(0), coat),
        "wetness": jnp.where(dried & np.isfinite(step.model.parameters.wetness_soaked), 0.0, wet),
    }


KINDS = ((WASHERS, _washed), (DRYERS, _dried))


def update(step: EventStep) -> EventStep:
    """One control step of all machines."""
    for categories, act in KINDS:
        machines = _machines(step.model, categories)
        if len(machines):
            step = _having(step, act(step, _inside(step, machines, _running(step, machines))))
    return step


def _having(step: EventStep, made: dict[str, Any]) -> EventStep:
    """The step with what machines made: fields of states, and of dust and stains the particles that are left."""
    particles = {
        dirt.name: dataclasses.replace(getattr(step.states, dirt.name), alive=made[dirt.name])
        for dirt in (DUST, STAIN)
        if dirt.name in made
    }
    return step.having(**{**made, **particles})


def rests(step: EventStep) -> Bool[Array, ""]:
    """No machine runs."""
    found = jnp.array(True)
    for categories, _ in KINDS:
        machines = _machines(step.model, categories)
        if len(machines):
            found &= ~jnp.any(_running(step, machines))
    return found


def idle(step: EventStep) -> Bool[Array, ""]:
    """No machine changes anything."""
    found = jnp.array(True)
    for categories, act in KINDS:
        machines = _machines(step.model, categories)
        if len(machines):
            runs = _running(step, machines)
            found &= ~_any_changes(step, machines, runs, act)
    return found


def _any_changes(
    step: EventStep, machines: Int[np.ndarray, "M"], runs: Bool[Array, "W M"], act: Any
) -> Bool[Array, ""]:
    return jax.lax.cond(jnp.any(runs), lambda: _changes(step, machines, runs, act), lambda: jnp.array(False))


def _changes(step: EventStep, machines: Int[np.ndarray, "M"], runs: Bool[Array, "W M"], act: Any) -> Bool[Array, ""]:
    """Whether machines that run change some state."""
    made = act(step, _inside(step, machines, runs))
    before = {
        n: getattr(step.states, n).alive if n in (DUST.name, STAIN.name) else getattr(step.states, n) for n in made
    }
    return jnp.any(jnp.stack([jnp.any(made[n] != jnp.asarray(before[n])) for n in made]))
