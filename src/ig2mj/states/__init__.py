"""Extended states: temperature, wetness, dust, stains, switches, cuts, as JAX arrays updated by pure functions.

A state is one file; `update.update` calls them in their one order; `world.ExtendedStates` holds what they keep.
"""

from ig2mj.process.public_names import offer_modules
from ig2mj.states.initial import initial_states, states_of_manifest
from ig2mj.states.model import StateModel
from ig2mj.states.options import StateOptions
from ig2mj.states.relations.plan import PlannedRelations, RelationPlan
from ig2mj.states.relations.relations import Relations
from ig2mj.states.spec import EventStep, HeatStep, StateSpec
from ig2mj.states.update import queries, update
from ig2mj.states.world import ExtendedStates, Swap, WorldState

__all__ = [
    "EventStep",
    "ExtendedStates",
    "HeatStep",
    "PlannedRelations",
    "RelationPlan",
    "Relations",
    "StateModel",
    "StateOptions",
    "StateSpec",
    "Swap",
    "WorldState",
    "initial_states",
    "queries",
    "states_of_manifest",
    "update",
]

offer_modules(__name__)
