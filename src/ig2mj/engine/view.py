"""`PhysicsView`: what states, predicates, sensors and tasks know of physics. Every engine can produce it.

It is the narrow waist between engines and everything above them. All arrays begin with the world axis. The annotations
of the two classes are the one schema of the view (`SCHEMA`), from which engines, programs and tests know its fields.

Axes: W worlds, O objects (order of the manifest), B bodies of the MuJoCo model (0 is the world), L annotated links
(order of `SceneTables.link_*`), J openable joints (order of `SceneTables.openable_*`), A agents, Q scalar joints of all
agents, H hands, F finger links, Y graspable bodies (orders of `SceneTables.agent_joint_*`, `hand_*`, `finger_*`,
`graspable_*`).
"""

from __future__ import annotations

import dataclasses
import functools
import operator
import typing
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeVar

import jax
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.scene.tables import SceneTables

Array = jax.Array | np.ndarray
"""The native engine gives numpy arrays, the MJX engines JAX's; jitted functions take both."""


def _field(doc: str) -> Any:
    return dataclasses.field(metadata={"doc": doc})


V = TypeVar("V")


class LazyFields(dict[str, Any]):
    """Fields of a view by name; those that are missing are computed when they are read first.

    Attributes:
      make: computes a field from its name; raises AttributeError where there is none of that name. but_agents: see the
        function `but_agents`.
    """

    def __init__(self, known: Mapping[str, Any], make: Callable[[str], Any], but_agents: object | None = None):
        super().__init__(known)
        self.make, self.but_agents = make, but_agents

    def __missing__(self, name: str) -> Any:
        array = self[name] = self.make(name)
        return array


class _FieldsOf:
    """Lets an engine make a view of a mapping, such as `LazyFields`, in place of the constructor's arguments."""

    _mapping: ClassVar[Mapping[str, Any]] = {}

    @classmethod
    def over(cls: type[V], fields: Mapping[str, Any]) -> V:
        """A view whose fields are those of a mapping, read when they are asked for."""
        view = object.__new__(cls)
        object.__setattr__(view, "_mapping", fields)
        return view

    if not typing.TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            try:
                return self._mapping[name]
            except KeyError:
                raise AttributeError(name) from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles have all fields; a mapping belongs to an engine."""
        names = [field.name for field in dataclasses.fields(typing.cast(Any, self))]
        return type(self), tuple(getattr(self, name) for name in names)


def counted(thing: Any, **counts: int | None) -> str:
    """A short `repr`: the class and counts of its contents, e.g. `Batch(3 worlds)`. Counts that are None are left
    out."""
    facts = (f"{n} {what if n != 1 else what.rstrip('s')}" for what, n in counts.items() if n is not None)
    return f"{type(thing).__name__}({', '.join(facts)})"


def length(array: Any, axis: int = 0) -> int | None:
    """How long an axis is; None where it is no array with such an axis. Never reads the array."""
    shape = getattr(array, "shape", ())
    return int(shape[axis]) if len(shape) > axis else None


@struct.dataclass
class AgentView(_FieldsOf):
    """All agents, their hands and fingers at the end of a control step; world frame, SI units, w-x-y-z quaternions."""

    base_pos: Float[Array, "W A 3"] = _field("origin of the base body")
    base_quat: Float[Array, "W A 4"] = _field("orientation of the base body")
    base_linvel: Float[Array, "W A 3"] = _field("velocity of the base body's origin, m/s")
    base_angvel: Float[Array, "W A 3"] = _field("angular velocity of the base body, rad/s")
    eye_pos: Float[Array, "W A 3"] = _field(
        "camera, where the agent's controller has it in views of the core, where it is compiled in views of an engine; "
        "the base body's origin for an agent without a camera"
    )
    eye_quat: Float[Array, "W A 4"] = _field("orientation of the camera (MuJoCo's axes: -z forward, y up)")
    joint_pos: Float[Array, "W Q"] = _field("positions of scalar joints, rad or m")
    joint_vel: Float[Array, "W Q"] = _field("velocities of scalar joints, rad/s or m/s")
    hand_pos: Float[Array, "W H 3"] = _field("origin of the palm or end effector")
    hand_quat: Float[Array, "W H 4"] = _field("orientation of the palm or end effector")
    hand_linvel: Float[Array, "W H 3"] = _field("velocity of the palm's origin, m/s")
    hand_angvel: Float[Array, "W H 3"] = _field("angular velocity of the palm, rad/s")
    finger_pos: Float[Array, "W F 3"] = _field("origin of each finger link")
    finger_quat: Float[Array, "W F 4"] = _field("orientation of each finger link")
    finger_force: Float[Array, "W F Y"] = _field(
        "N; normal forces of all contacts of the finger link with the graspable body added up, the largest such sum of "
        "any physics step of this control step"
    )
    touching: Bool[Array, "W A O"] = _field("any part of the agent touches the object; as `touching` of objects")

    def __repr__(self) -> str:
        return f"{type(self).__name__}(agents, hands and fingers)"


@struct.dataclass
class PhysicsView(_FieldsOf):
    """A snapshot of physics at the end of a control step: world frame, SI units, w-x-y-z quaternions, float32.

    Contacts, and with them `touching` and forces, are those of the engine's last collision stage (see the engines).
    """

    object_pos: Float[Array, "W O 3"] = _field("origin of the object's main body")
    object_quat: Float[Array, "W O 4"] = _field("orientation of the main body")
    object_linvel: Float[Array, "W O 3"] = _field("velocity of the main body's origin, m/s; 0 for fixed objects")
    object_angvel: Float[Array, "W O 3"] = _field("angular velocity of the main body, rad/s; 0 for fixed objects")
    object_com: Float[Array, "W O 3"] = _field(
        "centre of mass of the main body; iGibson's position of an object (pose.py)"
    )
    aabb_low: Float[Array, "W O 3"] = _field(
        "lowest corner of the world box over all bodies of the object, by the engine's box rule"
    )
    aabb_high: Float[Array, "W O 3"] = _field("highest corner of that box")
    body_pos: Float[Array, "W B 3"] = _field("every body's origin; collision pieces are posed with it")
    body_quat: Float[Array, "W B 4"] = _field("every body's orientation")
    link_pos: Float[Array, "W L 3"] = _field("annotated links: origin of the site, or of the geom")
    link_quat: Float[Array, "W L 4"] = _field("annotated links: orientation of the site, or of the geom")
    joint_pos: Float[Array, "W J"] = _field("positions of openable joints, rad or m")
    touching: Bool[Array, "W O O"] = _field(
        "surfaces no further apart than the engine's tolerance (3 mm); symmetric, the diagonal is false. Remembered "
        "for pairs that sleep"
    )
    link_force: Float[Array, "W L O"] = _field(
        "N; largest normal force of any contact and any physics step of this control step of the annotated link's geom "
        "with the object; 0 for links that are sites"
    )
    awake: Bool[Array, "W O"] = _field("some body of the object moves or may move now; never where it has no joints")
    held: Bool[Array, "W H O"] = _field("a grasp equality of the hand is active on the object")
    agent: AgentView = _field("agents, hands and fingers")

    def __repr__(self) -> str:
        pos, bodies = (getattr(self, name, None) for name in ("object_pos", "body_pos"))
        return counted(self, worlds=length(pos), objects=length(pos, 1), bodies=length(bodies, 1))


@dataclasses.dataclass(frozen=True)
class ViewField:
    """One array of the view.

    Attributes:
      name: its path, such as "object_pos" or "agent.hand_pos". axes: letters of axes with a size of the scene, numbers.
      dtype: float32 or bool. doc: what it is.
    """

    name: str
    axes: tuple[str | int, ...]
    dtype: np.dtype
    doc: str

    def shape(self, sizes: Mapping[str, int]) -> tuple[int, ...]:
        """Its shape where the axes have these sizes (see `axis_sizes`)."""
        return tuple(axis if isinstance(axis, int) else sizes[axis] for axis in self.axes)


def _schema(view: type, prefix: str = "") -> dict[str, ViewField]:
    found: dict[str, ViewField] = {}
    hints = typing.get_type_hints(view)
    for field in dataclasses.fields(view):
        name, hint = prefix + field.name, hints[field.name]
        if dataclasses.is_dataclass(hint):
            found |= _schema(typing.cast(type, hint), f"{name}.")
            continue
        annotation = typing.get_args(hint)[0]  # of numpy's array and of JAX's: the same for both
        axes = tuple(int(axis) if axis.isdigit() else axis for axis in annotation.dim_str.split())
        dtype = np.dtype(bool if "bool" in annotation.dtypes else np.float32)
        found[name] = ViewField(name, axes, dtype, field.metadata["doc"])
    return found


SCHEMA: dict[str, ViewField] = _schema(PhysicsView)
"""All arrays of the view by path, in the order of its leaves as a pytree."""


def axis_sizes(tables: SceneTables, num_worlds: int) -> dict[str, int]:
    """How long each axis of the view is in a scene."""
    return {
        "W": num_worlds,
        "O": tables.num_objects,
        "B": len(tables.body_object),
        "L": len(tables.link_object),
        "J": len(tables.openable_object),
        "A": len(tables.agent_body),
        "Q": len(tables.agent_joint_qposadr),
        "H": len(tables.hand_body),
        "F": len(tables.finger_body),
        "Y": len(tables.graspable_body),
    }


def read_field(view: PhysicsView, name: str) -> Array:
    """The array at a path of `SCHEMA`."""
    return getattr(view.agent, name[6:]) if name.startswith("agent.") else getattr(view, name)


def fields_of(view: PhysicsView | AgentView) -> Mapping[str, Any]:
    """The mapping behind a view; empty for one that a constructor made."""
    return view._mapping


def but_agents(view: PhysicsView) -> object | None:
    """An object that identifies all of a view but its agents and their bodies: the same in views between which nothing
    else changed. None where the engine does not provide it."""
    return getattr(view._mapping, "but_agents", None)


def read_fields(view: PhysicsView, names: tuple[str, ...]) -> list[Array]:
    """The arrays at some paths of `SCHEMA`."""
    return [getter(view) for getter in _getters(names)]


@functools.cache
def _getters(names: tuple[str, ...]) -> list[Callable[[PhysicsView], Array]]:
    return [operator.attrgetter(name) for name in names]


def assemble(fields: Mapping[str, Any]) -> PhysicsView:
    """A view from all of its arrays by path."""
    agent = AgentView(**{name[6:]: array for name, array in fields.items() if name.startswith("agent.")})
    return PhysicsView(**{n: a for n, a in fields.items() if not n.startswith("agent.")}, agent=agent)


def replace_fields(view: PhysicsView, fields: Mapping[str, Any]) -> PhysicsView:
    """The view with other arrays at some paths."""
    return assemble({name: fields[name] if name in fields else read_field(view, name) for name in SCHEMA})


EYES = ("eye_pos", "eye_quat")
"""Fields of the view's agents that a controller may decide."""


def with_eyes_later(view: PhysicsView, eyes: Callable[[], tuple[Array, Array]]) -> PhysicsView:
    """The view with other poses of eyes [W, A, 3], [W, A, 4], computed when one of them is read first; never traced."""
    agent = view.agent

    def make(name: str) -> Any:
        return eyes()[EYES.index(name)] if name in EYES else getattr(agent, name)

    fields = {name: array for name, array in fields_of(agent).items() if name not in EYES}
    own = {"agent": AgentView.over(LazyFields(fields, make))}
    return PhysicsView.over(LazyFields({**fields_of(view), **own}, lambda name: getattr(view, name), but_agents(view)))


OF_CONSTRAINTS = ("touching", "link_force", "awake", "held", "agent.finger_force", "agent.touching")
"""Fields of a view that change with constraints and ignored contacts while nothing moves."""


def blank_view(sizes: Mapping[str, int]) -> PhysicsView:
    """A view of zeros and falses (numpy)."""
    return assemble({name: np.zeros(field.shape(sizes), field.dtype) for name, field in SCHEMA.items()})


def faults(view: PhysicsView, sizes: Mapping[str, int]) -> list[str]:
    """Errors in shapes and dtypes of a view, a sentence each; empty for a correct view."""
    found = []
    for name, field in SCHEMA.items():
        array = read_field(view, name)
        if tuple(array.shape) != field.shape(sizes) or np.dtype(array.dtype) != field.dtype:
            axes = " ".join(map(str, field.axes))
            found.append(
                f"{name} is {array.dtype}{list(array.shape)}, not {field.dtype}{list(field.shape(sizes))} [{axes}]"
            )
    return found
