"""The states of substances, in the order of their updates. Only scenes that name substances have them."""

from __future__ import annotations

from ig2mj.states.spec import StateSpec
from ig2mj.states.substances import coat, solid, volume

SUBSTANCE_STATES: tuple[StateSpec, ...] = (volume.SPEC, coat.SPEC, solid.SPEC)
"""What flows and falls, what tools wipe off, what is frozen."""
