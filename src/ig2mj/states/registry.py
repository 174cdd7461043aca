"""All object states, one line each, and by name.

Names are those of `ig2mj.knowledge`; the paper's (table A.4) and iGibson's class names, in snake_case, are aliases.
"""

from __future__ import annotations

from ig2mj.errors import UnknownNameError
from ig2mj.states.definitions import from_physics, heat_source, open
from ig2mj.states.spec import StateSpec
from ig2mj.states.update import EVENTS, HEAT

SPECS: tuple[StateSpec, ...] = (
    from_physics.POSE,
    from_physics.AABB,
    from_physics.JOINT_STATES,
    from_physics.CONTACTS,
    from_physics.ABOVE,
    from_physics.BELOW,
    from_physics.BESIDE,
    *HEAT,
    *EVENTS,
    open.SPEC,
    heat_source.SPEC,
    from_physics.ROOMS,
)
"""Every state of table A.4, and iGibson's others that can be asked. What keeps something has its line in the order of
update (`ig2mj.states.update`)."""

STATES: dict[str, StateSpec] = {s.name: s for s in SPECS}

_ALIASES = {alias: s for s in SPECS for alias in s.aliases}


def find(name: str) -> StateSpec:
    """The state of that name or alias. Raises UnknownNameError."""
    found = STATES.get(name.lower()) or _ALIASES.get(name.lower())
    if found is None:
        raise UnknownNameError("state", name, [*STATES, *_ALIASES])
    return found
