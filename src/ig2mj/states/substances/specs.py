"""The states of substances, in the order of their updates. Only scenes that name substances have them."""

from __future__ import annotations

import dataclasses

from ig2mj.states.spec import StateSpec
from ig2mj.states.substances import coat, reactions, solid, things, volume, washing

COAT = dataclasses.replace(
    coat.SPEC,
    update=lambda step: reactions.update(washing.update(coat.wipe(step))),
    idle=lambda step: coat.wipes_nothing(step) & washing.idle(step) & reactions.idle(step),
)
"""What tools wipe off and machines wash, and then what transition rules make of contents and coats."""

SUBSTANCE_STATES: tuple[StateSpec, ...] = (volume.SPEC, COAT, things.SPEC, solid.SPEC)
"""Volumes and streams; coats and reactions; objects that exist; solids."""
