"""The states of substances, in the order of their updates. Only scenes that name substances have them."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import jax.numpy as jnp

from ig2mj.engine.view import Array
from ig2mj.states.branches import changed_where
from ig2mj.states.definitions.dust import DUST
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.spec import EventStep, StateSpec
from ig2mj.states.substances import applying, coat, drying, reactions, solid, things, volume, washing

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def _cleaned(step: EventStep) -> EventStep:
    """The step after appliers acted, tools wiped and machines washed. On a GPU the host waits for each question whether
    something is to be done: it is asked once."""
    model = step.model
    applies = applying.exist(model)
    if not applies and not washing.has_machines(model):
        return coat.wipe(step)
    acts = ~(coat.wipes_nothing(step) & washing.rests(step))
    if applies:
        acts |= applying.may_act(step)

    def act(fields: tuple[list[Array], list[Array]]) -> tuple[list[Array], list[Array]]:
        now = _having(step, fields)
        if applies:
            now = applying.update(now, applying.applied(now, applying.dipped(now)))
        return _changing(washing.update(coat.wipe(now)).states)

    return _having(step, changed_where(acts, act, _changing(step.states)))


def _having(step: EventStep, fields: tuple[list[Array], list[Array]]) -> EventStep:
    particles = [
        dataclasses.replace(getattr(step.states, kind.name), alive=a) for kind, a in zip(DIRT, fields[1], strict=True)
    ]
    return step.having(**dict(zip((*CLEANED, *(kind.name for kind in DIRT)), (*fields[0], *particles), strict=True)))


def _changing(states: ExtendedStates) -> tuple[list[Array], list[Array]]:
    return (
        [jnp.asarray(getattr(states, name)) for name in CLEANED],
        [jnp.asarray(getattr(states, kind.name).alive) for kind in DIRT],
    )


def _idle(step: EventStep) -> Array:
    rests = coat.wipes_nothing(step) & washing.idle(step) & reactions.idle(step) & drying.idle(step)
    if applying.exist(step.model):
        rests &= applying.rests(applying.applied(step, applying.dipped(step)))
    return rests


CLEANED, DIRT = ("coat", "absorbed", "wetness", "volume", "lost", "drawn"), (DUST, STAIN)
"""What appliers, tools and machines change: fields of states, and of these the particles that are left."""

COAT = dataclasses.replace(
    coat.SPEC,
    update=lambda step: reactions.update(drying.update(_cleaned(step))),
    idle=_idle,
)
"""What appliers apply, tools wipe off and machines wash, and then what transition rules make of contents and coats."""

SUBSTANCE_STATES: tuple[StateSpec, ...] = (volume.SPEC, COAT, things.SPEC, solid.SPEC)
"""Volumes and streams; coats and reactions; objects that exist; solids."""
