"""States of every object that are read from physics and have no arrays of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ig2mj.engine.view import PhysicsView
from ig2mj.states.model import StateModel
from ig2mj.states.relations import rooms, traced
from ig2mj.states.spec import Get, StateSpec

if TYPE_CHECKING:
    from ig2mj.states.world import ExtendedStates


def _pose(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> Any:
    return _numbers(view.object_pos[w, o]), _numbers(view.object_quat[w, o])


def _aabb(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> Any:
    return _numbers(view.aabb_low[w, o]), _numbers(view.aabb_high[w, o])


def _joints(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> Any:
    return _numbers(np.asarray(view.joint_pos)[w, model.tables.openable_object == o])


def _contacts(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> list[str]:
    return [model.tables.object_names[i] for i in np.flatnonzero(np.asarray(view.touching)[w, o])]


def _rooms(model: StateModel, states: ExtendedStates, view: PhysicsView, o: int, w: int) -> list[str]:
    return rooms.rooms_of(model.tables, view, o, w)


def _neighbours(which: str) -> Get:
    return lambda model, states, view, o, w: traced.neighbours(model, view, o, w)[which]


def _numbers(values: Any) -> list[float]:
    return [float(v) for v in np.asarray(values).ravel()]


def _of_all(name: str, get: Get, unit: str = "", aliases: tuple[str, ...] = ()) -> StateSpec:
    return StateSpec(name=name, get=get, abilities=None, unit=unit, aliases=aliases)


POSE = _of_all("pose", _pose, "m, w-x-y-z")
AABB = _of_all("aabb", _aabb, "m")
JOINT_STATES = _of_all("joint_states", _joints, "rad or m")
CONTACTS = _of_all("in_contact_objs", _contacts, aliases=("contact_bodies", "contacts"))
ABOVE = _of_all("in_same_positive_vertical_axis_objs", _neighbours("above"))
BELOW = _of_all("in_same_negative_vertical_axis_objs", _neighbours("below"))
BESIDE = _of_all("in_same_horizontal_plane_objs", _neighbours("beside"), aliases=("horizontal_adjacency",))
ROOMS = _of_all("rooms", _rooms, aliases=("inside_room_types",))
