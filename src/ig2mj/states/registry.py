"""All object states by name: one line each. For asking and setting by name, one object of one world at a time.

Names are those of `ig2mj.knowledge`; the paper's (table A.4) and iGibson's class names, in snake_case, are aliases.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import UnknownNameError
from ig2mj.states import particles
from ig2mj.states.definitions import dust, heat_source, stain
from ig2mj.states.definitions.open import is_open
from ig2mj.states.model import StateModel
from ig2mj.states.relations import adjacency, rooms
from ig2mj.states.world import ExtendedStates

THERMAL = ("cookable", "burnable", "freezable")

Get = Callable[[StateModel, ExtendedStates, PhysicsView, int, int], Any]


@dataclasses.dataclass(frozen=True)
class ObjectState:
    """One state of an object.

    Attributes:
      name: snake_case. unit: of its numbers, or "". get: value of one object in one world, plain Python, from (model,
      states, view, object, world). abilities: any of these gives an object the state; None: every object has it.
      field: the array of `ExtendedStates`, one number per object, that holds it and may be set. aliases: other names.
    """

    name: str
    unit: str
    get: Get
    abilities: tuple[str, ...] | None = None
    field: str | None = None
    aliases: tuple[str, ...] = ()

    def belongs_to(self, model: StateModel, obj: int) -> bool:
        """Whether the object has the state."""
        return self.abilities is None or bool(set(self.abilities) & set(model.parameters.abilities[obj]))


_particle_level = jax.jit(particles.level)
_is_open = jax.jit(is_open, static_argnums=0)


@functools.partial(jax.jit, static_argnums=0)
def _switched_on(model: StateModel, toggled: Bool[Array, "W O"], joint_pos: Float[Array, "W J"]) -> Bool[Array, "W S"]:
    return heat_source.switched_on(model, toggled, is_open(model, joint_pos))


def _field(name: str, kind: type) -> Get:
    return lambda model, states, view, o, w: kind(np.asarray(getattr(states, name))[w, o])


def _pose(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> Any:
    return _numbers(view.object_pos[w, o]), _numbers(view.object_quat[w, o])


def _aabb(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> Any:
    return _numbers(view.aabb_low[w, o]), _numbers(view.aabb_high[w, o])


def _joints(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> Any:
    return _numbers(np.asarray(view.joint_pos)[w, model.tables.openable_object == o])


def _contacts(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> list[str]:
    return [model.tables.object_names[i] for i in np.flatnonzero(np.asarray(view.touching)[w, o])]


def _beside(which: str) -> Get:
    return lambda model, states, view, o, w: adjacency.neighbours(model, view, o, w)[which]


def _level(field: str, row_of: Callable[[StateModel, int], int | None]) -> Get:
    def get(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> float:
        row = row_of(model, o)
        return 0.0 if row is None else float(np.asarray(_particle_level(getattr(states, field)))[w, row])

    return get


def _open(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> bool:
    return bool(np.asarray(_is_open(model, view.joint_pos))[w, o])


def _heat_source(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> bool:
    on = np.asarray(_switched_on(model, states.toggled, view.joint_pos))
    mine = np.flatnonzero(model.parameters.heat_object == o)
    return bool(len(mine) and on[w, mine[0]])


def _water_source(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> int:
    mine = np.flatnonzero(model.parameters.water_object == o)
    return int(np.asarray(states.water.active)[w, mine].sum()) if len(mine) else 0


def _rooms(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> list[str]:
    return rooms.rooms_of(model.tables, view, o, w)


def _numbers(values: Any) -> list[float]:
    return [float(v) for v in np.asarray(values).ravel()]


UP, DOWN, AROUND = (
    f"in_same_{n}_objs" for n in ("positive_vertical_axis", "negative_vertical_axis", "horizontal_plane")
)

STATES: dict[str, ObjectState] = {
    s.name: s
    for s in (
        ObjectState("pose", "m, w-x-y-z", _pose),
        ObjectState("aabb", "m", _aabb),
        ObjectState("joint_states", "rad or m", _joints),
        ObjectState("in_contact_objs", "", _contacts, aliases=("contact_bodies", "contacts")),
        ObjectState(UP, "", _beside("above")),
        ObjectState(DOWN, "", _beside("below")),
        ObjectState(AROUND, "", _beside("beside"), aliases=("horizontal_adjacency",)),
        ObjectState("temperature", "C", _field("temperature", float), THERMAL, "temperature"),
        ObjectState("max_temperature", "C", _field("max_temperature", float), THERMAL, "max_temperature"),
        ObjectState("wetness", "droplets", _field("wetness", float), ("soakable",), "wetness", ("wetness_level",)),
        ObjectState("dust", "of placed", _level("dust", dust.row_of), ("dustyable",), None, ("dustiness_level",)),
        ObjectState("stain", "of placed", _level("stain", stain.row_of), ("stainable",), None, ("stain_level",)),
        ObjectState("toggled", "", _field("toggled", bool), ("toggleable",), "toggled", ("toggled_state",)),
        ObjectState("sliced", "", _field("sliced", bool), ("sliceable",), None, ("sliced_state",)),
        ObjectState("open", "", _open, ("openable",)),
        ObjectState("heat_source", "", _heat_source, ("heatSource", "coldSource"), None, ("heat_source_or_sink",)),
        ObjectState("water_source", "drops out", _water_source, ("waterSource",)),
        ObjectState("rooms", "", _rooms, aliases=("inside_room_types",)),
    )
}
"""Every state of table A.4, and iGibson's others that can be asked."""

_ALIASES = {alias: s for s in STATES.values() for alias in s.aliases}


def find(name: str) -> ObjectState:
    """The state of that name or alias. Raises UnknownNameError."""
    found = STATES.get(name.lower()) or _ALIASES.get(name.lower())
    if found is None:
        raise UnknownNameError("state", name, [*STATES, *_ALIASES])
    return found
