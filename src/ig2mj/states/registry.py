"""All object states of ig2mj, one line each, and all states by name.

Names are those of `ig2mj.knowledge`; the paper's (table A.4) and iGibson's class names, in snake_case, are aliases.
"""

from __future__ import annotations

from ig2mj.errors import UnknownNameError
from ig2mj.states.added import STATES, ship_extra_states, ship_substance_states
from ig2mj.states.definitions import attached, broken, from_physics, heat_source, on_fire, open
from ig2mj.states.spec import StateSpec
from ig2mj.states.substances.specs import SUBSTANCE_STATES
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
update (`ig2mj.states.update`). States of plug-ins are in `STATES` only."""

EXTRA_STATES: tuple[StateSpec, ...] = (attached.SPEC, broken.SPEC, on_fire.SPEC)
"""States of scenes that ask for them (`ig2mj.scene.extras`)."""

STATES.ship({s.name: s for s in (*SPECS, *SUBSTANCE_STATES, *EXTRA_STATES)})
ship_substance_states(SUBSTANCE_STATES)
ship_extra_states(EXTRA_STATES)

_ALIASES = {alias: s for s in SPECS for alias in s.aliases}


def find(name: str) -> StateSpec:
    """The state of that name or alias. Raises UnknownNameError; PluginError: it is of a plug-in, which is at fault."""
    key = name.lower()
    found = STATES.get(key) or _ALIASES.get(key)
    if found is None:
        added = STATES.added().values()
        found = next((spec for spec in added if key in spec.aliases), None)
        if found is None:
            aliases = [*_ALIASES, *(alias for spec in added for alias in spec.aliases)]
            raise UnknownNameError("state", name, [*STATES, *aliases])
    return found
