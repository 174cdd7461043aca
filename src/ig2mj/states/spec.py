"""`StateSpec`: the complete description of one extended state, which stands in the state's own file.

`registry.SPECS` lists ig2mj's own. All else is derived: the arrays of `ExtendedStates`, what they are at the start and
what a manifest says of them, what halves inherit at a cut, what can be asked and set by name, what is saved.
`update.EVENTS` and `update.HEAT` are the order in which those that change by themselves are updated.

Axes: W worlds, O objects, S heat sources.
"""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.states.swap import Swap

if TYPE_CHECKING:
    from ig2mj.states.model import StateModel
    from ig2mj.states.relations.plan import Query
    from ig2mj.states.relations.relations import Relations
    from ig2mj.states.world import ExtendedStates

Values = Mapping[str, Any]
"""New values of some fields of `ExtendedStates`, by name."""

DTYPES: dict[type, Any] = {float: np.float32, int: np.int32, bool: np.bool_}
JAXTYPES: dict[type, Any] = {float: Float, int: Int, bool: Bool}


class Cut(NamedTuple):
    """What halves inherit from.

    Attributes:
      takes: halves that come into the world in this step. source: of each object the one it inherits from, its whole;
      itself for all others.
    """

    model: StateModel
    takes: Bool[Array, "W O"]
    source: Int[np.ndarray, "O"]

    def of_whole(self, field: Array) -> Array:
        """A field with one number per object, in which the halves have their wholes' numbers."""
        return jnp.where(self.takes, field[:, self.source], field)


class Saved(NamedTuple):
    """What a manifest says of one object (`ObjectEntry.state`), and where to write it.

    Attributes:
      states: NumPy arrays of one world, written in place. obj: the object. values: the manifest's, by key. bodies:
      MuJoCo ids of body names.
    """

    model: StateModel
    states: ExtendedStates
    obj: int
    values: Mapping[str, Any]
    bodies: Mapping[str, int]


@dataclasses.dataclass(frozen=True)
class EventStep:
    """A control step on its way through `update.EVENTS`.

    Attributes:
      states: as the updates so far have left them. view: physics after the step. drops: how many touched each soakable
      object. cut_now: objects that were cut. swap: teleports that follow. relations: answers for `view` to what
      `StateSpec.queries` ask.
    """

    model: StateModel
    states: ExtendedStates
    view: PhysicsView
    drops: Int[Array, "W O"]
    cut_now: Bool[Array, "W O"]
    swap: Swap
    relations: Relations

    @classmethod
    def start(cls, model: StateModel, states: ExtendedStates, view: PhysicsView, relations: Relations) -> EventStep:
        """The step before its first update."""
        shape = states.temperature.shape
        still = Swap.nothing(shape[0], len(model.swap_objects))
        return cls(model, states, view, jnp.zeros(shape, jnp.int32), jnp.zeros(shape, bool), still, relations)

    def having(self, **fields: Any) -> EventStep:
        """The step with other values in some fields of the states."""
        return dataclasses.replace(self, states=dataclasses.replace(self.states, **fields))


@dataclasses.dataclass(frozen=True)
class HeatStep:
    """A control step on its way through `update.HEAT`, after the events.

    Attributes:
      acts: heat source on object. view: physics after the step, in which halves that come into the world in this step
      are still parked. in_use: false for parked objects.
    """

    model: StateModel
    states: ExtendedStates
    acts: Bool[Array, "W O S"]
    view: PhysicsView
    in_use: Bool[Array, "W O"]

    def having(self, **fields: Any) -> HeatStep:
        """The step with other values in some fields of the states."""
        return dataclasses.replace(self, states=dataclasses.replace(self.states, **fields))


Part = Literal["events", "heat"]

Get = Callable[["StateModel", "ExtendedStates", PhysicsView, int, int], Any]
Initial = Callable[["StateModel"], Values]
Queries = Callable[["StateModel"], "list[Query]"]
Inherit = Callable[["ExtendedStates", Cut], Values]
Set = Callable[["ExtendedStates", Bool[Array, "#W O"], Any], Values]
Idle = Callable[[EventStep], Bool[Array, ""]]
Update = Callable[[Any], Any]


def nothing_inherited(states: ExtendedStates, cut: Cut) -> Values:
    """For states that no half takes over."""
    return {}


def nothing_saved(saved: Saved) -> None:
    """For states of which a manifest says nothing."""


def given_from_outside(step: Any) -> Any:
    """For states that change only when they are set."""
    return step


@dataclasses.dataclass(frozen=True, kw_only=True)
class StateSpec:
    """One extended state. A state with arrays gives all of `KEEPS`; one that is read from physics gives none.

    Attributes:
      name: snake_case.
      get: value of one object in one world, plain Python, from (model, states, view, object, world).
      abilities: any of these gives an object the state; None: every object has it.
      unit: of its numbers, or "".
      aliases: other names.
      fields: names and jaxtyping annotations of its arrays (or pytrees of arrays) in `ExtendedStates`, W first.
      initial: all its fields at the start, in one world: NumPy arrays whose world axis is 1 long.
      update: from `EventStep` or `HeatStep` to the same; `given_from_outside` where it changes only when set.
      idle: of a state in `update.EVENTS`: whether `update` changes no state of any world in this step, cheaper to find
        than by updating; None: it is always updated.
      inherit: its fields after halves took over what their wholes had, from (states, `Cut`); `nothing_inherited`.
      from_manifest: writes what a manifest says of one object into `Saved.states`; `nothing_saved`.
      set: new fields from (states, mask of objects, number or switch); None: cannot be set by name.
      part: of the step in which `update` runs. "events": after switches, cuts, water and dirt, with an `EventStep`, in
        which temperatures are those of the step before. "heat": after the temperatures, with a `HeatStep`.
      queries: relations between objects that `update` reads (`EventStep.relations`), as of `RelationPlan.build`.
      follows: of a state of the part "heat": whether, in a scene, its fields follow from ig2mj's own temperatures of
        the same step alone, and `update` changes no others; None: never.
      of_substances: only scenes that name substances have it. extra: only scenes that ask for this have it
        (`ig2mj.scene.extras`).

    Raises:
      ValueError: a field is missing or superfluous, or `part` is neither "events" nor "heat".
    """

    name: str
    get: Get
    abilities: tuple[str, ...] | None
    unit: str = ""
    aliases: tuple[str, ...] = ()
    fields: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    initial: Initial | None = None
    update: Update | None = None
    idle: Idle | None = None
    inherit: Inherit | None = None
    from_manifest: Callable[[Saved], None] | None = None
    set: Set | None = None
    part: str = "events"
    queries: Queries | None = None
    follows: Callable[[StateModel], bool] | None = None
    of_substances: bool = False
    extra: str = ""

    def __post_init__(self):
        if self.part not in typing.get_args(Part):
            raise ValueError(f"state '{self.name}' is of part {self.part!r}, and parts are 'events' and 'heat'")
        if self.queries is not None and (self.part == "heat" or self.update is None):
            raise ValueError(f"state '{self.name}' has queries, which only an update of the part 'events' can read")
        missing = [piece for piece in KEEPS if getattr(self, piece) is None]
        if self.fields and missing:
            raise ValueError(f"state '{self.name}' keeps {', '.join(self.fields)} but lacks {', '.join(missing)}")
        if not self.fields and len(missing) < len(KEEPS):
            given = [piece for piece in KEEPS if piece not in missing]
            raise ValueError(f"state '{self.name}' has {', '.join(given)} but no fields")

    @classmethod
    def of_objects(
        cls,
        name: str,
        kind: type[float] | type[int] | type[bool],
        start: float | int | bool,
        update: Update,
        *,
        settable: bool = True,
        saved_as: tuple[str, ...] | None = None,
        **others: Any,
    ) -> StateSpec:
        """A state that is one number, or one switch, of every object; halves inherit it.

        Args:
          kind: float, int or bool. start: its value in the beginning. settable: it can be set by name.
          saved_as: keys of a manifest that mean it; None: its name.
          others: `abilities`, and what else a `StateSpec` has.
        """
        return cls(
            name=name,
            get=lambda model, states, view, o, w: kind(np.asarray(getattr(states, name))[w, o]),
            fields={name: JAXTYPES[kind][Array, "W O"]},
            initial=lambda model: filled(model, name, kind, start),
            update=update,
            inherit=copied(name),
            from_manifest=numbers(dict.fromkeys(saved_as or (name,), name)),
            set=put(name) if settable else None,
            **others,
        )

    def belongs_to(self, model: StateModel, obj: int) -> bool:
        """Whether the object has the state."""
        if (self.of_substances and model.substances is None) or (self.extra and self.extra not in model.extras):
            return False
        return self.abilities is None or bool(set(self.abilities) & set(model.parameters.abilities[obj]))


KEEPS = ("initial", "update", "inherit", "from_manifest")
"""What a state with fields must say."""


def filled(model: StateModel, name: str, kind: type, value: float | int | bool) -> Values:
    """A field with one number per object, all alike."""
    return {name: np.full((1, model.tables.num_objects), value, DTYPES[kind])}


def copied(*names: str) -> Inherit:
    """Halves have the numbers of their wholes."""
    return lambda states, cut: {name: cut.of_whole(getattr(states, name)) for name in names}


def numbers(keys: Mapping[str, str]) -> Callable[[Saved], None]:
    """Manifest keys that are one number per object, and the fields they go to."""

    def write(saved: Saved) -> None:
        for key, field in keys.items():
            if key in saved.values:
                getattr(saved.states, field)[0, saved.obj] = saved.values[key]

    return write


def put(name: str) -> Set:
    """The number of the masked objects."""

    def write(states: ExtendedStates, mask: Bool[Array, "#W O"], value: Any) -> Values:
        field = jnp.asarray(getattr(states, name))
        return {name: jnp.where(mask, field.dtype.type(value), field)}

    return write
