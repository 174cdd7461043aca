"""A step in which nothing but contents and coats change: the part of a control step that is left where all other events
are known to be idle. `ig2mj.worlds.incremental` takes it on the native engine.

Axes: W worlds, O objects.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Bool

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.model import StateModel
from ig2mj.states.relations.relations import Relations
from ig2mj.states.spec import EventStep
from ig2mj.states.substances import coat, reactions, volume, washing
from ig2mj.states.substances.volume import Streams
from ig2mj.states.world import ExtendedStates

FIELDS = ("volume", "lost", "drawn", "coat", "absorbed")
"""Fields that the step changes."""


class Flowed(NamedTuple):
    """What a step gives.

    Attributes:
      states: after it. streams: see `volume.flow`. complete: the step changes nothing else, `states` are those of a
        whole step.
    """

    states: ExtendedStates
    streams: Streams
    complete: Bool[Array, ""]


def possible(model: StateModel) -> bool:
    """Whether a scene has such steps."""
    return (
        model.substances is not None
        and volume.has_outlets(model)
        and all(spec.idle is not None for spec in _others(model))
    )


def _others(model: StateModel) -> list:
    """Added states of the first part that are not of substances."""
    return [s for s in model.added if s.part == "events" and s.update is not None and not s.of_substances]


def flowed(
    model: StateModel,
    states: ExtendedStates,
    view: PhysicsView,
    relations: Relations,
    before: Streams,
    same: Bool[Array, ""],
) -> Flowed:
    """One control step. Pure.

    Args:
      before: streams of the last step. same: nothing has moved since.
    """
    start = EventStep.start(model, states, view, relations)
    step, streams = volume.flow(start, before, same)
    assert streams is not None
    quiet = washing.rests(step)
    step = reactions.update(coat.wipe(step))
    quiet &= ~jnp.any(step.swap.mask) & jnp.all(step.states.wetness == states.wetness)
    if len(model.substances.things.object):  # pyright: ignore[reportOptionalMemberAccess]
        quiet &= jnp.all(step.states.absent == states.absent) & jnp.all(step.states.hatched == states.hatched)
    for spec in _others(model):
        assert spec.idle is not None
        quiet &= spec.idle(step)
    return Flowed(step.states, streams, quiet)
