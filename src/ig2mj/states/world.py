"""`ExtendedStates` and `WorldState`: everything of a world that changes, as pytrees. Saving a world is saving these.

Axes: W worlds, O objects, C water sources, R rows of particles (the dustyable, or the stainable, objects only), N
particles of a row or drops of a source.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from flax import struct
from jaxtyping import Float, Int, UInt

from ig2mj.engine.view import Array, PhysicsView, counted, length
from ig2mj.errors import PluginError, StateError
from ig2mj.states.added import added_states, extra_states, substance_states
from ig2mj.states.registry import SPECS
from ig2mj.states.spec import Cut, StateSpec
from ig2mj.states.swap import Swap

if TYPE_CHECKING:
    _Fields = Any
else:
    _Fields = dataclasses.make_dataclass(
        "_Fields", [(name, kind) for spec in SPECS for name, kind in spec.fields.items()], frozen=True
    )


class NewStateError(StateError, AttributeError):
    """A state that a scene does not have: of a plug-in that was registered later, or of substances."""


@struct.dataclass
class ExtendedStates(_Fields):
    """The extended states of all objects (paper table A.4). Physical states are in the view.

    One attribute for each of `StateSpec.fields` of `registry.SPECS`: `states.temperature[w, o]`. Scalars are kept for
    every object, because that is small and plain to read; an object without the ability keeps the initial value.
    Particles and drops are kept only for those that have them. States of plug-ins are attributes of a subclass
    (`states_class`).
    """

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name not in {field for spec in _others() for field in spec.fields}:
            raise AttributeError(f"states have no '{name}'")
        if name in {field for spec in substance_states() for field in spec.fields}:
            raise NewStateError(f"there is no '{name}': load the scene with substances=['water', ...]")
        for spec in extra_states():
            if name in spec.fields:
                raise NewStateError(f"there is no '{name}': load the scene with objects=['with:{spec.extra}...']")
        raise NewStateError(f"state '{name}' was registered after these states were made: load the scene again")

    def inherited(self, cut: Cut) -> ExtendedStates:
        """The states after halves took over what their wholes have."""
        taken: dict[str, Any] = {}
        for spec in (*SPECS, *cut.model.added):
            if spec.inherit is not None:
                taken.update(spec.inherit(self, cut))
        return dataclasses.replace(self, **taken)

    def __repr__(self) -> str:
        temperature = getattr(self, "temperature", None)
        return counted(self, worlds=length(temperature), objects=length(temperature, 1))


def with_fields(states: ExtendedStates, fields: Mapping[str, Any]) -> ExtendedStates:
    """A copy with other values of some fields, in less time than a constructor takes, which sets each by itself."""
    new: Any = object.__new__(type(states))
    vars(new).update(vars(states), **fields)
    return new


def _others() -> tuple[StateSpec, ...]:
    """States that not every scene has."""
    return (*substance_states(), *extra_states(), *added_states())


def states_class(added: Iterable[StateSpec]) -> type[ExtendedStates]:
    """The class of states that has also the fields of these; the same class for the same fields."""
    return _class_with(tuple(sorted(((n, kind) for spec in added for n, kind in spec.fields.items()), key=_first)))


def added_fields(states: ExtendedStates | type[ExtendedStates]) -> list[str]:
    """Names of the fields of plug-ins' states."""
    own = {field.name for field in dataclasses.fields(ExtendedStates)}
    return [field.name for field in dataclasses.fields(states) if field.name not in own]


def _first(pair: tuple[str, Any]) -> str:
    return pair[0]


@functools.cache
def _class_with(fields: tuple[tuple[str, Any], ...]) -> type[ExtendedStates]:
    if not fields:
        return ExtendedStates
    body = {"__annotations__": dict(fields), "__module__": __name__, "__reduce__": _reduced, "__doc__": _DOC}
    return struct.dataclass(type("ExtendedStates", (ExtendedStates,), body))


_DOC = "The extended states of all objects, with those of plug-ins."


def _reduced(states: ExtendedStates) -> tuple[Any, ...]:
    """For pickles: the class has no name that could be imported."""
    values = {field.name: getattr(states, field.name) for field in dataclasses.fields(states)}
    return _unreduced, (added_fields(states), values)


def _unreduced(added: list[str], values: Mapping[str, Any]) -> ExtendedStates:
    known = {name: spec for spec in _others() for name in spec.fields}
    if missing := [name for name in added if name not in known]:
        raise PluginError(f"state '{missing[0]}' is not registered in this process: register it where it starts")
    return states_class({known[name].name: known[name] for name in added}.values())(**values)


@struct.dataclass
class WorldState:
    """All worlds of a batch at the end of a control step.

    Attributes:
      physics: the engine's own (see `ig2mj.engine.base`). view: the snapshot states and predicates read.
      states: extended states. key: JAX random key data of each world. step: control steps since reset. time: seconds.
    """

    physics: Any
    view: PhysicsView
    states: ExtendedStates
    key: UInt[Array, "W 2"]
    step: Int[Array, "W"]
    time: Float[Array, "W"]

    def __repr__(self) -> str:
        return counted(self, worlds=length(self.step))


__all__ = ["ExtendedStates", "Swap", "WorldState"]
