"""All predicates by name, one line each, and those of plug-ins."""

from __future__ import annotations

from ig2mj.errors import StateError, UnknownNameError
from ig2mj.plugins import Registry
from ig2mj.predicates.base import Predicate
from ig2mj.predicates.definitions.attached import ATTACHED
from ig2mj.predicates.definitions.broken import BROKEN_PREDICATE
from ig2mj.predicates.definitions.burnt import BURNT
from ig2mj.predicates.definitions.contains import CONTAINS
from ig2mj.predicates.definitions.cooked import COOKED
from ig2mj.predicates.definitions.covered import COVERED
from ig2mj.predicates.definitions.dusty import DUSTY
from ig2mj.predicates.definitions.empty import EMPTY
from ig2mj.predicates.definitions.filled import FILLED
from ig2mj.predicates.definitions.frozen import FROZEN
from ig2mj.predicates.definitions.hot import HOT_PREDICATE
from ig2mj.predicates.definitions.in_contact_with import IN_CONTACT_WITH
from ig2mj.predicates.definitions.in_fov_of_agent import IN_FOV_OF_AGENT
from ig2mj.predicates.definitions.in_hand_of_agent import IN_HAND_OF_AGENT
from ig2mj.predicates.definitions.in_reach_of_agent import IN_REACH_OF_AGENT
from ig2mj.predicates.definitions.in_same_room_as_agent import IN_SAME_ROOM_AS_AGENT
from ig2mj.predicates.definitions.inside import INSIDE
from ig2mj.predicates.definitions.insource import INSOURCE
from ig2mj.predicates.definitions.next_to import NEXT_TO
from ig2mj.predicates.definitions.on_fire import ON_FIRE_PREDICATE
from ig2mj.predicates.definitions.on_floor import ON_FLOOR
from ig2mj.predicates.definitions.on_top import ON_TOP
from ig2mj.predicates.definitions.open import OPEN
from ig2mj.predicates.definitions.present import PRESENT
from ig2mj.predicates.definitions.real import REAL
from ig2mj.predicates.definitions.saturated import SATURATED
from ig2mj.predicates.definitions.sliced import SLICED
from ig2mj.predicates.definitions.soaked import SOAKED
from ig2mj.predicates.definitions.stained import STAINED
from ig2mj.predicates.definitions.toggled_on import TOGGLED_ON
from ig2mj.predicates.definitions.under import UNDER
from ig2mj.states import registry
from ig2mj.states.spec import StateSpec

OWN: dict[str, Predicate] = {
    p.name: p
    for p in (
        INSIDE,
        ON_TOP,
        NEXT_TO,
        IN_CONTACT_WITH,
        UNDER,
        ON_FLOOR,
        OPEN,
        COOKED,
        BURNT,
        FROZEN,
        SOAKED,
        DUSTY,
        STAINED,
        TOGGLED_ON,
        SLICED,
        IN_FOV_OF_AGENT,
        IN_HAND_OF_AGENT,
        IN_REACH_OF_AGENT,
        IN_SAME_ROOM_AS_AGENT,
    )
}
"""The 19 predicates of the paper's table A.1, under their snake_case names."""

OF_SUBSTANCES: dict[str, Predicate] = {
    p.name: p for p in (COVERED, SATURATED, FILLED, CONTAINS, EMPTY, INSOURCE, PRESENT, HOT_PREDICATE, REAL)
}
"""Predicates of what covers and fills objects (docs/guide/substances.md), and others beyond the paper."""

OF_EXTRAS: dict[str, Predicate] = {p.name: p for p in (ATTACHED, BROKEN_PREDICATE, ON_FIRE_PREDICATE)}
"""Predicates of states that a scene asks for (`ig2mj.scene.extras`)."""

SHIPPED: dict[str, Predicate] = {**OWN, **OF_SUBSTANCES, **OF_EXTRAS}

PREDICATES: Registry[Predicate] = Registry(
    "predicate",
    "an ig2mj.predicates.Predicate",
    lambda thing: isinstance(thing, Predicate),
    SHIPPED,
    words=lambda predicate: predicate.aliases,
)
"""`OWN`, and those of plug-ins."""

_ALIASES = {alias: p for p in SHIPPED.values() for alias in p.aliases}


def find_state(name: str) -> StateSpec:
    """The state of that name or alias. Raises UnknownNameError; StateError: it is the name of a predicate."""
    try:
        return registry.find(name)
    except UnknownNameError:
        if name.lower() in PREDICATES or name.lower() in _ALIASES:
            raise StateError(f"'{name}' is a predicate, not a state: ask predicate('{name}', ...)") from None
        raise


def find(name: str) -> Predicate:
    """The predicate of that name or alias, upper and lower case alike.

    Raises:
      UnknownNameError: there is none. PluginError: it is of a plug-in, which is at fault.
    """
    key = name.lower()
    found = SHIPPED.get(key) or _ALIASES.get(key) or PREDICATES.get(key)
    if found is None:
        added = PREDICATES.added().values()
        found = next((predicate for predicate in added if key in predicate.aliases), None)
        if found is None:
            aliases = [*_ALIASES, *(alias for predicate in added for alias in predicate.aliases)]
            raise UnknownNameError("predicate", name, [*PREDICATES, *aliases])
    return found
