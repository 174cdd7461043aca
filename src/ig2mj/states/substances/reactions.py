"""Transition rules: what contents of containers, and coats of objects, become (`ig2mj.knowledge.transitions`).

Rules are one table, applied at once: in each step the first rule that applies in a container turns all of its inputs
there into its output, at equal volume. A rule with one input works on what covers an object, too, at the object's
temperature.

Axes: W worlds, C containers, D objects that can be covered, U substances, Q rules in use.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.knowledge.transitions import MIXERS, STIRRERS, Transition
from ig2mj.scene.tables import SceneTables
from ig2mj.states.model import StateModel
from ig2mj.states.spec import EventStep
from ig2mj.states.substances.model import of
from ig2mj.states.substances.volume import CONTAINS


@dataclasses.dataclass(frozen=True, eq=False)
class Reactions:
    """The rules of a scene.

    Attributes:
      rules: the Q axis. inputs, output: of each, by substance. temperature: Celsius, least. stir: it takes stirring.
        single: it has one input. stirrers: objects that stir. mixers: containers that mix while they are on.
    """

    rules: tuple[Transition, ...]
    inputs: Bool[np.ndarray, "Q U"]
    output: Bool[np.ndarray, "Q U"]
    temperature: Float[np.ndarray, "Q"]
    stir: Bool[np.ndarray, "Q"]
    single: Bool[np.ndarray, "Q"]
    stirrers: Int[np.ndarray, "N"]
    mixers: Bool[np.ndarray, "C"]


def reactions(model: StateModel) -> Reactions:
    """Those of a scene with substances."""
    found = of(model)
    rules, names = found.rules, found.names
    return Reactions(
        rules=rules,
        inputs=np.array([[n in r.inputs for n in names] for r in rules], bool).reshape(len(rules), len(names)),
        output=np.array([[n == r.output for n in names] for r in rules], bool).reshape(len(rules), len(names)),
        temperature=np.array([r.temperature for r in rules], np.float32),
        stir=np.array([r.stir for r in rules], bool),
        single=np.array([len(r.inputs) == 1 for r in rules], bool),
        stirrers=_of_categories(model.tables, STIRRERS),
        mixers=np.isin(found.containers.object, _of_categories(model.tables, MIXERS)),
    )


def _of_categories(tables: SceneTables, wanted: tuple[str, ...]) -> Int[np.ndarray, "N"]:
    return np.flatnonzero([category in wanted for category in tables.object_categories])


def _stirred(step: EventStep, table: Reactions) -> Bool[Array, "W C"]:
    objects = of(step.model).containers.object
    found = jnp.asarray(step.states.toggled_on)[:, objects] & table.mixers
    if len(table.stirrers):
        found |= jnp.any(jnp.asarray(step.view.touching)[:, objects][:, :, table.stirrers], axis=-1)
    return found


def _in_containers(step: EventStep, table: Reactions) -> Bool[Array, "W C Q"]:
    """The first rule that applies in each container."""
    found = of(step.model)
    has = jnp.asarray(step.states.volume) >= CONTAINS
    complete = jnp.all(has[:, :, None] | ~table.inputs, axis=-1)
    warm = jnp.asarray(step.states.warm)[:, found.row[found.containers.object]]
    able = complete & warm & (~table.stir | _stirred(step, table)[..., None])
    return able & (jnp.cumsum(able, axis=-1) == 1)


def _on_objects(step: EventStep, table: Reactions) -> Bool[Array, "W D Q"]:
    """Rules that change what covers each object."""
    covers = jnp.any((jnp.asarray(step.states.coat) > 0)[:, :, None] & table.inputs, axis=-1)
    return covers & jnp.asarray(step.states.warm) & table.single & np.isfinite(table.temperature) & ~table.stir


def update(step: EventStep) -> EventStep:
    """One control step of all rules."""
    table = reactions(step.model)
    if not len(table.rules):
        return step
    volume, coat = jnp.asarray(step.states.volume), jnp.asarray(step.states.coat)
    if volume.shape[1]:
        first = _in_containers(step, table)
        taken = jnp.any(first[..., None] & table.inputs, axis=2)  # [W, C, U]
        made = jnp.any(first[..., None] & table.output, axis=2)
        amount = jnp.sum(jnp.where(taken, volume, 0.0), axis=-1, keepdims=True)
        volume = jnp.where(taken, 0.0, volume) + jnp.where(made, amount, 0.0)
    changes = _on_objects(step, table)
    for rule in np.flatnonzero(table.single & np.isfinite(table.temperature) & ~table.stir):
        source, target = int(table.inputs[rule].argmax()), int(table.output[rule].argmax())
        now = jnp.where(changes[..., rule], coat[..., source], np.uint32(0))
        columns = np.arange(coat.shape[-1])
        coat = jnp.where(columns == target, coat | now[..., None], coat)
        coat = jnp.where(columns == source, coat & ~now[..., None], coat)
    return step.having(volume=volume, coat=coat)


def idle(step: EventStep) -> Bool[Array, ""]:
    """No rule applies."""
    table = reactions(step.model)
    if not len(table.rules):
        return jnp.array(True)
    found = ~jnp.any(_on_objects(step, table))
    return found & ~jnp.any(_in_containers(step, table)) if step.states.volume.shape[1] else found
