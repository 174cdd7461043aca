"""The states of substances, in the order of their updates. Only scenes that name substances have them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp

from ig2mj.engine.view import Array
from ig2mj.states.definitions.dust import DUST
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.spec import EventStep, StateSpec
from ig2mj.states.substances import coat, reactions, solid, things, volume, washing

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def _cleaned(step: EventStep) -> EventStep:
    """The step after tools wiped and machines washed. On a GPU the host waits for each question whether something is
    to be done: it is asked once."""
    if not washing.has_machines(step.model):
        return coat.wipe(step)

    def act() -> tuple[list[Array], list[Array]]:
        states = washing.update(coat.wipe(step)).states
        return _changing(states)

    acts = ~(coat.wipes_nothing(step) & washing.rests(step))
    fields, alive = jax.lax.cond(acts, act, lambda: _changing(step.states))
    particles = [
        dataclasses.replace(getattr(step.states, kind.name), alive=a) for kind, a in zip(DIRT, alive, strict=True)
    ]
    return step.having(**dict(zip((*CLEANED, *(kind.name for kind in DIRT)), (*fields, *particles), strict=True)))


def _changing(states: ExtendedStates) -> tuple[list[Array], list[Array]]:
    return (
        [jnp.asarray(getattr(states, name)) for name in CLEANED],
        [jnp.asarray(getattr(states, kind.name).alive) for kind in DIRT],
    )


CLEANED, DIRT = ("coat", "absorbed", "wetness"), (DUST, STAIN)
"""What tools and machines change: fields of states, and of these the particles that are left."""

COAT = dataclasses.replace(
    coat.SPEC,
    update=lambda step: reactions.update(_cleaned(step)),
    idle=lambda step: coat.wipes_nothing(step) & washing.idle(step) & reactions.idle(step),
)
"""What tools wipe off and machines wash, and then what transition rules make of contents and coats."""

SUBSTANCE_STATES: tuple[StateSpec, ...] = (volume.SPEC, COAT, things.SPEC, solid.SPEC)
"""Volumes and streams; coats and reactions; objects that exist; solids."""
