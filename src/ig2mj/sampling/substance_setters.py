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
from ig2mj.knowledge.substances import FILL, WATER
from ig2mj.knowledge.transitions import Transition
from ig2mj.states.definitions import wetness
from ig2mj.states.model import StateModel
from ig2mj.states.substances import coat, volume
from ig2mj.states.substances.model import of
from ig2mj.states.world import ExtendedStates

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


def brought(
    model: StateModel, states: ExtendedStates, source: int, predicate: str, obj: int, substance: str
) -> ExtendedStates:
    """The states after a container gave an object as much of a substance as makes a predicate true.

    Args:
      source: number of the container, which has so much less, unless it is a source. predicate: contains, filled,
        covered or saturated. obj: number of the object that gets it.

    Raises:
      StateError: the container has too little, or what the setter of the predicate raises.
    """
    row, column, found = _row(model, source), _column(model, substance), of(model)
    before = np.asarray(states.volume)[0, :, column].astype(float)
    endless = bool(np.asarray(states.stock)[0, row, column])
    if before[row] < volume.CONTAINS and not endless:
        raise StateError(f"'{model.tables.object_names[source]}' contains no {substance}")
    if predicate in ("contains", "filled"):
        target = _row(model, obj)
        after = np.asarray(SUBSTANCE_SETTERS["filled"](model, states, obj, substance, True).volume)[0, target, column]
        given = max(float(after) - before[target], 0.0) if endless else min(float(after) - before[target], before[row])
        states = volume.set_volume(model, states, obj, substance, before[target] + given)
        least = volume.FILLED * float(found.containers.litres[target]) if predicate == "filled" else volume.CONTAINS
        if before[target] + given < least:
            raise StateError(f"'{model.tables.object_names[source]}' contains too little {substance}")
        lost = 0.0
    else:
        drops = float(model.parameters.wetness_soaked[obj]) if predicate == "saturated" else 1.0
        given = lost = coat.DROP * drops
        if given > before[row] and not endless:
            raise StateError(f"'{model.tables.object_names[source]}' contains too little {substance}")
        if predicate == "saturated" and substance == WATER:
            mask = np.arange(model.tables.num_objects) == obj
            states = dataclasses.replace(states, wetness=wetness.set_soaked(model, states.wetness, mask[None], True))
        else:
            states = SUBSTANCE_SETTERS[predicate](model, states, obj, substance, True)
    own = np.arange(len(found.names)) == column
    return dataclasses.replace(
        volume.set_volume(model, states, source, substance, before[row] if endless else before[row] - given),
        lost=np.asarray(states.lost) + np.where(own, np.float32(lost), 0.0).astype(np.float32),
        drawn=np.asarray(states.drawn) + np.where(own & endless, np.float32(given), 0.0).astype(np.float32),
    )


def mixed(model: StateModel, states: ExtendedStates, obj: int, recipe: Transition) -> ExtendedStates:
    """The states after stirring: all inputs of a rule in a container have become its output, litre by litre."""
    columns, row = [_column(model, name) for name in recipe.inputs], _row(model, obj)
    now = np.asarray(states.volume)[0, row].astype(float)
    for name in recipe.inputs:
        states = volume.set_volume(model, states, obj, name, 0.0)
    total = now[_column(model, recipe.output)] + now[columns].sum()
    return volume.set_volume(model, states, obj, recipe.output, total)


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
