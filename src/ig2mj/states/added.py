"""`STATES`: states by name, with those of plug-ins; `ig2mj.states.registry` adds ig2mj's own."""

from __future__ import annotations

from collections.abc import Iterable

from ig2mj.plugins import Registry
from ig2mj.states.spec import StateSpec

STATES: Registry[StateSpec] = Registry(
    "state",
    "an ig2mj.states.StateSpec",
    lambda thing: isinstance(thing, StateSpec),
    words=lambda spec: (*spec.aliases, *(name for name in spec.fields if name != spec.name)),
)
"""Every state of table A.4 of the paper, iGibson's others that can be asked, and those of plug-ins."""


_OF_SUBSTANCES: list[StateSpec] = []


def ship_substance_states(specs: Iterable[StateSpec]) -> None:
    """Makes the states known that a scene with substances has, in the order of their updates."""
    _OF_SUBSTANCES[:] = specs


def substance_states() -> tuple[StateSpec, ...]:
    """The states that a scene has that names substances, and no other scene (`ig2mj.states.substances`)."""
    return tuple(_OF_SUBSTANCES)


_EXTRAS: list[StateSpec] = []


def ship_extra_states(specs: Iterable[StateSpec]) -> None:
    """Makes the further states known that a scene may ask for, in the order of their updates."""
    _EXTRAS[:] = specs


def extra_states(names: Iterable[str] | None = None) -> tuple[StateSpec, ...]:
    """The states of a scene that asks for these further states (`ig2mj.scene.extras`); None: all."""
    return tuple(spec for spec in _EXTRAS if names is None or spec.extra in names)


def added_states() -> tuple[StateSpec, ...]:
    """States of plug-ins, in the order in which they are updated: registered ones, then those of installed packages.

    Raises:
      PluginError: one cannot be imported, is no state, or has a name that is taken.
    """
    return tuple(STATES.added().values())
