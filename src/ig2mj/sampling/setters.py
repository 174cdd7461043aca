"""Setting states and predicates of one object by name, as the paper samples them (table A.5): those without placement.

State changes are made here; the physics changes that follow (teleports of slicing, joints of doors) are returned.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import AbilityError, StateError, UnknownNameError
from ig2mj.knowledge.substances import WATER
from ig2mj.predicates.base import Predicate
from ig2mj.predicates.literals import object_index
from ig2mj.predicates.registry import PREDICATES, SHIPPED
from ig2mj.predicates.registry import find as find_predicate
from ig2mj.predicates.substances import substance_index
from ig2mj.sampling.substance_setters import SUBSTANCE_SETTERS
from ig2mj.sampling.surface_particles import sample_places
from ig2mj.states import particles, registry
from ig2mj.states.definitions import broken, max_temperature, on_fire, sliced, temperature, toggled_on, wetness
from ig2mj.states.definitions.dirt import Dirt
from ig2mj.states.definitions.dust import DUST
from ig2mj.states.definitions.open import sample_open
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.host import Randomness
from ig2mj.states.model import StateModel
from ig2mj.states.spec import StateSpec
from ig2mj.states.substances import things
from ig2mj.states.world import ExtendedStates, Swap

Value = bool | float | int


class Change(NamedTuple):
    """The changes by which a state is set.

    Attributes:
      states: the new ones. swap: teleports, or None. joints: positions [W, J] of openable joints and which move, or
      None.
    """

    states: ExtendedStates
    swap: Swap | None = None
    joints: tuple[np.ndarray, np.ndarray] | None = None


class _Task(NamedTuple):
    """A setter's input: constants, the current state, the objects (one and its halves), a random key."""

    model: StateModel
    states: ExtendedStates
    view: PhysicsView
    object_name: str
    objects: tuple[int, ...]
    mask: Bool[Array, "1 O"]
    key: Randomness


def set_by_name(
    model: StateModel,
    states: ExtendedStates,
    view: PhysicsView,
    name: str,
    object_name: str,
    value: Value,
    key: Randomness,
    substance: str | None = None,
) -> Change:
    """Sets a state to a value, or a predicate of one object to a truth, in every world of `states`.

    Args:
      name: a state that is a number or a switch (`StateSpec.set`), or a predicate: cooked, burnt, frozen, soaked,
        dusty, stained, toggled_on, open, sliced, those of substances, or one of a plug-in (`Predicate.set`).
      object_name: its halves are set alike.
      value: a finite number, or a truth.
      states: given as NumPy arrays, they stay that, and nothing is compiled (but for `sliced`).
      key: of what is drawn at random; a generator on the host.
      substance: second argument of covered, saturated, filled, contains and insource.

    Raises:
      UnknownNameError: no such state, predicate or object. AbilityError: the object lacks the ability.
      StateError: it cannot be set, or not to this value.
    """
    if name == "present":
        raise StateError("predicate 'present' cannot be set (fill a container with the substance, or cover an object)")
    index = object_index(model, object_name)
    objects = (index, *model.parameters.halves_of(index))
    mask = np.isin(np.arange(model.tables.num_objects), objects)[None]
    task = _Task(model, states, view, object_name, objects, mask, key)
    predicate = _predicate(name)
    if predicate is not None and (predicate.name in SUBSTANCE_SETTERS or substance is not None):
        if value not in (True, False):
            raise StateError(f"predicate '{predicate.name}' is set to true or false, not to {value!r}")
        return _of_substance(task, predicate, bool(value), substance)
    if predicate is not None and (setter := _SETTERS.get(predicate.name) or _setter_of(predicate)):
        if predicate.ability is not None and predicate.ability not in model.parameters.abilities[index]:
            raise AbilityError(lacks(f"predicate '{predicate.name}'", object_name, model, (str(predicate.ability),)))
        if value not in (True, False):
            raise StateError(f"predicate '{predicate.name}' is set to true or false, not to {value!r}")
        return setter(task, bool(value))
    kind = _state(name)
    if not kind.belongs_to(model, index):
        raise AbilityError(lacks(f"state '{kind.name}'", object_name, model, kind.abilities or ()))
    if kind.set is None:
        raise StateError(f"state '{kind.name}' cannot be set (settable: {', '.join(settable())})")
    kept = np.asarray(getattr(states, kind.name)).dtype if kind.name in kind.fields else np.dtype(bool)
    kinds = "b" if kept.kind == "b" else ""  # a truth is no number, though Python counts with it
    if np.ndim(value) or np.asarray(value).dtype.kind not in kinds + "iuf":
        raise StateError(f"state '{kind.name}' is set to a number, not to {value!r}")
    with np.errstate(over="ignore"):
        finite = np.isfinite(np.float32(value))  # as states are kept
    if not finite:
        raise StateError(f"state '{kind.name}' of '{object_name}' cannot be {value}")
    return Change(dataclasses.replace(states, **kind.set(states, mask, value)))


def _of_substance(task: _Task, predicate: Predicate, value: bool, substance: str | None) -> Change:
    if len(predicate.arguments) != 1 + (substance is not None):
        raise StateError(f"predicate '{predicate.name}' takes an object{' and a substance' * (predicate.arity > 1)}")
    if substance is not None:
        substance_index(task.model, substance)  # refuses unknown ones
    same = {("covered", DUST.name): "dusty", ("covered", STAIN.name): "stained", ("saturated", WATER): "soaked"}
    if known := same.get((predicate.name, str(substance))):
        ability = find_predicate(known).ability
        if ability not in task.model.parameters.abilities[task.objects[0]]:
            raise AbilityError(lacks(f"predicate '{predicate.name}'", task.object_name, task.model, (str(ability),)))
        return _SETTERS[known](task, value)
    states = task.states
    for obj in task.objects if predicate.name in ("covered", "saturated") else task.objects[:1]:
        states = SUBSTANCE_SETTERS[predicate.name](task.model, states, obj, substance, value)
    return Change(states)


def settable() -> list[str]:
    """Names that `set_by_name` takes."""
    own = [s.name for s in registry.STATES.values() if s.set is not None]
    return [*own, *_SETTERS, *SUBSTANCE_SETTERS, *(p.name for p in PREDICATES.added().values() if p.set is not None)]


def lacks(what: str, object_name: str, model: StateModel, abilities: tuple[str, ...]) -> str:
    """The line of an AbilityError."""
    category = model.tables.object_categories[object_index(model, object_name)]
    return f"{what} of '{object_name}': its category '{category}' is not {' or '.join(abilities)}"


def _predicate(name: str) -> Predicate | None:
    try:
        return find_predicate(name)
    except UnknownNameError:
        return None


def _setter_of(predicate: Predicate) -> Callable[[_Task, bool], Change] | None:
    """That of a predicate which says itself how it is set."""
    if (values := predicate.set) is None or predicate.arity != 1:
        return None
    return lambda t, value: Change(dataclasses.replace(t.states, **values(t.model, t.states, t.mask, value)))


def _state(name: str) -> StateSpec:
    try:
        return registry.find(name)
    except UnknownNameError:
        if found := _predicate(name):
            fix = "place the object instead" if found.name in SHIPPED else "its plug-in gives it no `set`"
            raise StateError(f"predicate '{found.name}' cannot be set by itself: {fix}") from None
        raise UnknownNameError("state or predicate", name, [*registry.STATES, *PREDICATES]) from None


def _cooked(t: _Task, value: bool) -> Change:
    new = max_temperature.set_cooked(t.model, t.states.max_temperature, t.mask, value)
    return Change(dataclasses.replace(t.states, max_temperature=new))


def _burnt(t: _Task, value: bool) -> Change:
    new = max_temperature.set_burnt(t.model, t.states.max_temperature, t.mask, value)
    return Change(dataclasses.replace(t.states, max_temperature=new))


def _frozen(t: _Task, value: bool) -> Change:
    new = temperature.set_frozen(t.model, t.states.temperature, t.mask, value, t.key)
    return Change(dataclasses.replace(t.states, temperature=new))


def _hot(t: _Task, value: bool) -> Change:
    if not t.model.parameters.thermal[t.objects[0]]:
        raise StateError(f"'{t.object_name}' has no temperature")
    new = temperature.set_hot(t.model, t.states.temperature, t.mask, value, t.key)
    return Change(dataclasses.replace(t.states, temperature=new))


def _soaked(t: _Task, value: bool) -> Change:
    return Change(dataclasses.replace(t.states, wetness=wetness.set_soaked(t.model, t.states.wetness, t.mask, value)))


def _toggled_on(t: _Task, value: bool) -> Change:
    new = toggled_on.set_toggled_on(t.model, t.states.toggled_on, t.mask, value)
    return Change(dataclasses.replace(t.states, toggled_on=new))


def _open(t: _Task, value: bool) -> Change:
    if not np.any(t.model.tables.openable_object == t.objects[0]):
        raise StateError(f"'{t.object_name}' has no relevant joints to open")
    joints, moves = sample_open(t.model, np.asarray(t.view.joint_pos), t.mask, value, t.key)
    return Change(t.states, joints=(np.asarray(joints), np.asarray(moves)))


def _sliced(t: _Task, value: bool) -> Change:
    if not value:
        if bool(np.any(t.states.sliced[:, t.objects[0]])):
            raise StateError(f"'{t.object_name}' is sliced, which cannot be undone")
        return Change(t.states)
    only = np.isin(np.arange(t.model.tables.num_objects), t.objects[:1])[None]
    return Change(*sliced.set_sliced(t.model, t.states, only, t.view))


def _extra(name: str, ability: str, able: Callable[[StateModel], Bool[np.ndarray, "O"]]) -> Callable[..., Change]:
    def setter(t: _Task, value: bool) -> Change:
        if name not in t.model.extras:
            fix = f"load it with objects=['with:{name}'], or --object with:{name}"
            raise StateError(f"the scene has no state '{name}': {fix}")
        if value and not able(t.model)[t.objects[0]]:
            raise AbilityError(lacks(f"predicate '{name}'", t.object_name, t.model, (ability,)))
        write = registry.STATES[name].set
        assert write is not None
        return Change(dataclasses.replace(t.states, **write(t.states, t.mask, value)))

    return setter


def _real(t: _Task, value: bool) -> Change:
    if t.model.substances is None or t.objects[0] not in t.model.substances.things.object:
        if value:
            return Change(t.states)
        raise StateError(f"'{t.object_name}' is in no transition rule of the scene, and always exists")
    return Change(things.set_real(t.model, t.states, t.objects[0], value))


def _dirty(dirt: Dirt) -> Callable[[_Task, bool], Change]:
    def setter(t: _Task, value: bool) -> Change:
        rows, done = getattr(t.states, dirt.name), True
        rng = _generator(t.key)
        for obj in t.objects:
            row = dirt.row_of(t.model, obj)
            if row is None:
                continue
            if value:
                p = sample_places(t.model.tables, t.view, obj, rng)
                rows, placed = dirt.place(t.model, rows, row, p.body, p.pos, p.normal, p.valid)
                done &= bool(np.all(placed))
            else:
                rows = particles.remove(rows, row)
        if not done:
            raise StateError(f"'{t.object_name}' has too little surface for particles")
        return Change(dataclasses.replace(t.states, **{dirt.name: rows}))

    return setter


def _generator(key: Randomness) -> np.random.Generator:
    return key if isinstance(key, np.random.Generator) else np.random.default_rng(np.asarray(jax.random.key_data(key)))


_SETTERS: dict[str, Callable[[_Task, bool], Change]] = {
    "cooked": _cooked,
    "burnt": _burnt,
    "frozen": _frozen,
    "hot": _hot,
    "soaked": _soaked,
    "toggled_on": _toggled_on,
    "open": _open,
    "sliced": _sliced,
    "real": _real,
    "on_fire": _extra("on_fire", "flammable", on_fire.flammable),
    "broken": _extra("broken", "breakable", broken.of_breakable_category),
    "dusty": _dirty(DUST),
    "stained": _dirty(STAIN),
}
"""Predicates that need no placement, and how each is set."""
