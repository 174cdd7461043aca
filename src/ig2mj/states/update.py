"""The one order in which extended states are updated after physics (design: spec/states.md section 2).

    view -> toggled -> sliced -> water -> wetness -> cleaning -> open -> heat sources -> temperature -> max temperature

A state that depends on another sees this step's value of it, but for water: a tap that is switched on in this step lets
the first drop go in the next, as in iGibson.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.definitions import (
    cleaning,
    heat_source,
    max_temperature,
    open,
    sliced,
    temperature,
    toggled,
    water,
    wetness,
)
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query, RelationPlan, Relations
from ig2mj.states.world import ExtendedStates, Swap


def queries(model: StateModel) -> list[Query]:
    """The relations between objects that an update needs."""
    return heat_source.queries(model)


def update(
    model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations | None = None
) -> tuple[ExtendedStates, Swap]:
    """One control step of all extended states of all worlds. Pure; to be jitted with `model` closed over.

    Args:
      model: constants.
      states: before.
      view: physics after this control step.
      relations: answers for `view` to at least `queries(model)`; None: they are computed here.

    Returns:
      The states after the step, and the teleports that slicing asks of the engine.
    """
    if relations is None:
        relations = RelationPlan.build(model, queries(model)).evaluate(view)
    states, swap, acts = events(model, states, view, relations)
    return heat(model, states, acts, view.touching), swap


def events(
    model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations
) -> tuple[ExtendedStates, Swap, Bool[Array, "W O S"]]:
    """The first part of a step: everything but temperatures, and which source acts on what.

    It reads no temperature (but slicing copies them); with the same view and the same other states it does the same.
    """
    p = model.parameters

    switch, press_count = toggled.update(model, states.toggled, states.press_count, view)
    states = dataclasses.replace(states, toggled=switch, press_count=press_count)

    cut_now = sliced.cut(model, states.sliced, view)
    states, swap = sliced.apply(model, states, cut_now, view)

    drops, contacts = water.update(model, states.water, view, states.toggled)
    wet = wetness.update(model, states.wetness, contacts)
    states = dataclasses.replace(states, water=drops, wetness=wet)

    working = cleaning.working(model, states.toggled)
    soaked = wetness.soaked(model, wet)[:, p.tool_object]
    states = dataclasses.replace(
        states,
        dust=cleaning.update(model, states.dust, p.dust_rows, working, view),
        stain=cleaning.update(model, states.stain, p.stain_rows, working & soaked, view),
    )

    opened = open.is_open(model, view.joint_pos)
    on = heat_source.switched_on(model, states.toggled, opened)
    acts = heat_source.acts_on(model, on, view, relations)
    return states, swap, _as_wholes(model, cut_now, acts)


def heat(
    model: StateModel, states: ExtendedStates, acts: Bool[Array, "W O S"], touching: Bool[Array, "W O O"]
) -> ExtendedStates:
    """The second part of a step: temperature and its maximum.

    Args:
      acts: from `events`. touching: read only where heat passes by contact.
    """
    in_use = sliced.in_use(model, states.sliced)
    warm = temperature.update(model, states.temperature, acts, in_use, touching)
    hottest = max_temperature.update(model, states.max_temperature, warm, in_use)
    return dataclasses.replace(states, temperature=warm, max_temperature=hottest)


def _as_wholes(model: StateModel, cut_now: Bool[Array, "W O"], acts: Bool[Array, "W O S"]) -> Bool[Array, "W O S"]:
    """On halves in the step of their birth act the sources that act on the whole: the view still has them parked."""
    p = model.parameters
    if len(p.half_object) == 0 or acts.shape[-1] == 0:
        return acts
    source = np.arange(model.tables.num_objects)
    source[p.half_object] = p.half_whole
    born = cut_now[:, source] & (source != np.arange(len(source)))
    return jnp.where(born[..., None], acts[:, source], acts)
