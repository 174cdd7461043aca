"""How predicates of substances are made true or false: covered, saturated, filled, contains, insource, empty.

A container gets `FILL` of its litres to be filled and `SOME` to contain something, but no more than has room next to
its other contents.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

from ig2mj.errors import StateError
from ig2mj.states.model import StateModel
from ig2mj.states.substances import coat, volume
from ig2mj.states.substances.model import of
from ig2mj.states.world import ExtendedStates

FILL = 0.6
"""Share of a container's litres."""

SOME = 0.1
"""The same."""

Setter = Callable[[StateModel, ExtendedStates, int, str | None, bool], ExtendedStates]


def _covered(model: StateModel, states: ExtendedStates, obj: int, substance: str | None, value: bool) -> ExtendedStates:
    if of(model).row[obj] == len(of(model).covered):
        raise StateError(f"'{model.tables.object_names[obj]}' has no surface that can be covered")
    return coat.set_covered(model, states, obj, str(substance), value)


def _saturated(
    model: StateModel, states: ExtendedStates, obj: int, substance: str | None, value: bool
) -> ExtendedStates:
    absorbs = {"soakable", "cleaningTool"}
    if not absorbs & set(model.parameters.abilities[obj]) or of(model).row[obj] == len(of(model).covered):
        raise StateError(
            f"'{model.tables.object_names[obj]}' absorbs nothing: it is neither soakable nor a cleaningTool"
        )
    return coat.set_saturated(model, states, obj, str(substance), value)


def _with_share(share: float) -> Setter:
    def setter(
        model: StateModel, states: ExtendedStates, obj: int, substance: str | None, value: bool
    ) -> ExtendedStates:
        row, column = _row(model, obj), _column(model, str(substance))
        if not value:
            return volume.set_volume(model, states, obj, str(substance), 0.0)
        now = np.asarray(states.volume)[:, row]
        litres = float(of(model).containers.litres[row])
        room = litres - now.sum(-1) + now[:, column]
        if (room < share * litres).any() and share == FILL:
            share_now = max(float(room.min()) / litres, 0.0)
            if share_now <= volume.FILLED:
                raise StateError(
                    f"'{model.tables.object_names[obj]}' has no room for {substance} next to what it holds"
                )
            wanted = np.minimum(share, share_now) * litres
        else:
            wanted = np.minimum(share * litres, room)
        return volume.set_volume(model, states, obj, str(substance), np.maximum(now[:, column], wanted))

    return setter


def _insource(
    model: StateModel, states: ExtendedStates, obj: int, substance: str | None, value: bool
) -> ExtendedStates:
    if obj in model.parameters.water_object and substance == "water":
        if not value:
            raise StateError(f"'{model.tables.object_names[obj]}' is a tap, and stays a source of water")
        return states
    row, column = _row(model, obj), _column(model, str(substance))
    own = (np.arange(states.stock.shape[1]) == row)[:, None] & (np.arange(states.stock.shape[2]) == column)
    xp: Any = np if isinstance(states.stock, np.ndarray) else jnp
    states = dataclasses.replace(states, stock=xp.where(own, value, states.stock))
    return _with_share(FILL)(model, states, obj, substance, True) if value else states


def _empty(model: StateModel, states: ExtendedStates, obj: int, substance: str | None, value: bool) -> ExtendedStates:
    if not value:
        raise StateError("predicate 'empty' can only be made true: say what the container contains instead")
    own = (np.arange(states.stock.shape[1]) == _row(model, obj))[:, None]
    xp: Any = np if isinstance(states.stock, np.ndarray) else jnp
    return dataclasses.replace(
        states,
        stock=xp.where(own, False, states.stock),
        volume=xp.where(own, np.float32(0.0), states.volume),
    )


def _row(model: StateModel, obj: int) -> int:
    row = of(model).containers.row_of(obj)
    if row is None:
        name, category = model.tables.object_names[obj], model.tables.object_categories[obj]
        raise StateError(f"'{name}' ({category}) is no container: its model has no inside")
    return row


def _column(model: StateModel, substance: str) -> int:
    names = of(model).names
    if substance not in names:
        raise StateError(f"'{substance}' is not in use in this scene: load it with substances=['{substance}']")
    if not of(model).has_volume[names.index(substance)]:
        raise StateError(f"'{substance}' covers objects, and does not fill containers")
    return names.index(substance)


SUBSTANCE_SETTERS: dict[str, Setter] = {
    "covered": _covered,
    "saturated": _saturated,
    "filled": _with_share(FILL),
    "contains": _with_share(SOME),
    "insource": _insource,
    "empty": _empty,
}
"""By the name of the predicate: (model, states, object, substance, truth) to states. NumPy arrays stay that."""
