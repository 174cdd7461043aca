"""The one order in which extended states are updated after physics (iGibson's simulator.py): `EVENTS`, then `HEAT`.

A state that depends on another reads this step's value of it, except for water: a tap that is switched on in this step
releases the first drop in the next one, as in iGibson. Between the two parts it is found which heat source acts on
what; a caller that knows that nothing else has changed since the last step may run `heat` alone.

States of plug-ins (`StateModel.added`) come after ig2mj's own in the part that they name.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.process import entry_point
from ig2mj.states.definitions import (
    dust,
    heat_source,
    max_temperature,
    open,
    sliced,
    stain,
    temperature,
    toggled_on,
    water,
    wetness,
)
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import Query, RelationPlan
from ig2mj.states.relations.relations import Relations
from ig2mj.states.spec import EventStep, HeatStep, Part, StateSpec
from ig2mj.states.swap import Swap

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates

EVENTS: tuple[StateSpec, ...] = (
    toggled_on.SPEC,  # fingers at buttons
    sliced.SPEC,  # blades; halves inherit what their whole has at this point
    water.SPEC,  # drops fall, land and are taken
    wetness.SPEC,  # what is touched by drops absorbs them
    dust.SPEC,  # cleaning tools
    stain.SPEC,  # the same, soaked
)
"""The first part of a step. Nothing in it reads a temperature."""

HEAT: tuple[StateSpec, ...] = (
    temperature.SPEC,  # heat sources act, or the room does
    max_temperature.SPEC,
)
"""The second part of a step."""


def queries(model: StateModel) -> list[Query]:
    """The relations between objects that an update needs."""
    added = [query for spec in model.added if spec.queries is not None for query in spec.queries(model)]
    return [*heat_source.queries(model), *added]


def heat_fields(model: StateModel) -> tuple[str, ...]:
    """Names of the fields that the second part changes."""
    return tuple(name for spec in (*HEAT, *_added(model, "heat")) for name in spec.fields)


def _added(model: StateModel, part: Part) -> tuple[StateSpec, ...]:
    """States of plug-ins that are updated in this part."""
    return tuple(spec for spec in model.added if spec.part == part and spec.update is not None)


@entry_point
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
    return heat(model, states, acts, view), swap


@entry_point
def events(
    model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations
) -> tuple[ExtendedStates, Swap, Bool[Array, "W O S"]]:
    """The first part of a step: everything but temperatures, and which source acts on what.

    It reads no temperature (but slicing copies them); with the same view and the same other states it does the same.
    """
    step = EventStep.start(model, states, view, relations)
    for spec in (*EVENTS, *_added(model, "events")):
        assert spec.update is not None
        step = spec.update(step)
    return step.states, step.swap, _as_wholes(model, step.cut_now, sources(model, step.states, view, relations))


def can_be_idle(model: StateModel) -> bool:
    """Whether `idle` is ever true, and ig2mj's own states of the second part then depend on nothing but temperatures
    and sources. Those that are added may read the view (`AddedUpdates.heat_reads_view`)."""
    every = (*EVENTS, *_added(model, "events"))
    return not model.options.contact_heat_rate and all(s.idle is not None for s in every)


@entry_point
def idle(model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations) -> Bool[Array, ""]:
    """Whether `events` changes no state of any world and moves nothing; false where a state cannot tell
    (`StateSpec.idle`)."""
    step, found = EventStep.start(model, states, view, relations), jnp.array(True)
    for spec in (*EVENTS, *_added(model, "events")):
        found &= False if spec.idle is None else spec.idle(step)
    return found


@entry_point
def own_idle(model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations) -> Bool[Array, ""]:
    """`idle` of ig2mj's own states, without those that were added."""
    step, found = EventStep.start(model, states, view, relations), jnp.array(True)
    for spec in EVENTS:
        found &= False if spec.idle is None else spec.idle(step)
    return found


@entry_point
def sources(model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations) -> Bool[Array, "W O S"]:
    """Which heat source acts on what, where nothing was cut in this step."""
    on = heat_source.switched_on(model, states.toggled_on, open.is_open(model, view.joint_pos))
    return heat_source.acts_on(model, on, view, relations)


@entry_point
def heat(
    model: StateModel,
    states: ExtendedStates,
    acts: Bool[Array, "W O S"],
    view: PhysicsView,
    specs: Sequence[StateSpec] | None = None,
) -> ExtendedStates:
    """The second part of a step: temperatures and what follows from them.

    Args:
      acts: from `events`. view: of ig2mj's own states, only heat that passes by contact reads it. specs: only these, of
        `heat_parts`.
    """
    step = HeatStep(model, states, acts, view, sliced.in_use(model, states.sliced))
    for spec in (*HEAT, *_added(model, "heat")) if specs is None else specs:
        assert spec.update is not None
        step = spec.update(step)
    return step.states


def heat_parts(model: StateModel) -> tuple[tuple[StateSpec, ...], tuple[StateSpec, ...]]:
    """The states of `heat` that depend on what they were, and those that follow from these alone
    (`StateSpec.follows`)."""
    added = _added(model, "heat")
    if all(spec.follows is not None and spec.follows(model) for spec in added):
        return HEAT, added
    return (*HEAT, *added), ()  # others may read those that follow


def _as_wholes(model: StateModel, cut_now: Bool[Array, "W O"], acts: Bool[Array, "W O S"]) -> Bool[Array, "W O S"]:
    """On halves in the step of their birth act the sources that act on the whole: the view still has them parked."""
    p = model.parameters
    if len(p.half_object) == 0 or acts.shape[-1] == 0:
        return acts
    source = np.arange(model.tables.num_objects)
    source[p.half_object] = p.half_whole
    born = cut_now[:, source] & (source != np.arange(len(source)))
    return jnp.where(born[..., None], acts[:, source], acts)
