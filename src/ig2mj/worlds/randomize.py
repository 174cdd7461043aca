"""`Randomize`: what differs between the worlds and the episodes of a batch, axis by axis.

    env = ig2mj.make("CookingMeat", worlds=64, randomize=ig2mj.Randomize(physics=True, lights=True))
    env = ig2mj.make("CookingMeat", randomize=ig2mj.Randomize(physics=Physics(mass=(0.5, 2.0))))
    env = ig2mj.make("CookingMeat", randomize={"camera": {"turn": 5.0}})

`ig2mj.worlds.randomization` draws it when an episode begins. docs/design/randomization.md
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

from ig2mj.engine.model_fields import MASSES
from ig2mj.errors import EngineError, UnknownNameError

Range = tuple[float, float]
"""Least and largest factor; factors between them are drawn evenly on a logarithmic scale."""


class _Axis:
    """Settings of an axis, which are checked when they are made.

    Attributes:
      model_fields: fields of the model that an engine must have for each world.
    """

    model_fields: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Raises EngineError: a setting is none."""
        for field in dataclasses.fields(self):  # pyright: ignore
            value = getattr(self, field.name)
            if isinstance(field.default, tuple):
                object.__setattr__(self, field.name, _range(field.name, value))
            else:
                object.__setattr__(self, field.name, _number(field, value))


@dataclasses.dataclass(frozen=True)
class Objects(_Axis):
    """Models of the objects that a task adds to its home: others of the same category.

    Attributes:
      count: models of each object that an environment has in all its worlds; each costs memory.
      models: names such as "steak/steak_02", in place of those of the environment's split; of the others none is taken.
    """

    count: int = 4
    models: Sequence[str] = dataclasses.field(default_factory=tuple)

    def __post_init__(self) -> None:
        """Raises EngineError: a setting is none."""
        object.__setattr__(self, "count", _number(dataclasses.fields(self)[0], self.count))
        names = self.models
        if isinstance(names, str) or not all(isinstance(name, str) and "/" in name for name in names):
            raise EngineError(f"randomize: models = {names!r}: names such as 'steak/steak_02' (ig2mj objects list)")
        object.__setattr__(self, "models", tuple(names))


@dataclasses.dataclass(frozen=True)
class ObjectPoses(_Axis):
    """Where a task's objects start: start states that the sampler draws on other supports within reach, too.

    Attributes:
      count: start states of all supports together; each is sampled once and kept in the cache.
    """

    count: int = 64


@dataclasses.dataclass(frozen=True)
class Materials(_Axis):
    """Colours and textures, as iGibson's `texture_randomization` varies them.

    Attributes:
      colour: factors of each material's and each object's red, green and blue.
      textures: probability that an object's material is exchanged for another one of its kind (wood, fabric, ...).
    """

    model_fields: ClassVar[tuple[str, ...]] = ("geom_rgba", "mat_rgba", "geom_matid")
    colour: Range = (0.7, 1.25)
    textures: float = 0.7


@dataclasses.dataclass(frozen=True)
class Lights(_Axis):
    """The lamps of the home.

    Attributes:
      intensity: factors of each light's brightness. colour: factors of red, green and blue.
      direction: degrees, largest turn of a light.
      off: probability that a light of the home is off; one stays on. spare: that each of two more lights is on.
    """

    intensity: Range = (0.6, 1.5)
    colour: Range = (0.85, 1.18)
    direction: float = 25.0
    off: float = 0.25
    spare: float = 0.3


@dataclasses.dataclass(frozen=True)
class Camera(_Axis):
    """Pose and field of view of the robot's cameras. Predicates go by the usual pose.

    Attributes:
      shift: m, largest displacement. turn: degrees, largest turn about each axis.
      fovy: factors of the tangent of half the vertical field of view.
    """

    shift: float = 0.02
    turn: float = 3.0
    fovy: Range = (0.92, 1.09)


@dataclasses.dataclass(frozen=True)
class Physics(_Axis):
    """Factors by which physics differs from the scene's.

    Attributes:
      mass: of each movable object, with its inertia; halves have their whole's.
      friction: of each object's contacts, sliding, torsional and rolling alike.
      damping: of the joints of objects (doors, drawers, lids).
    """

    model_fields: ClassVar[tuple[str, ...]] = (*MASSES, "geom_friction", "dof_damping")
    mass: Range = (0.8, 1.25)
    friction: Range = (0.7, 1.4)
    damping: Range = (0.7, 1.4)


@dataclasses.dataclass(frozen=True)
class RobotStart(_Axis):
    """Pose of the robot's base at the start of episodes: free of collisions, and with the task's objects within reach.

    Attributes:
      shift: m, largest displacement. turn: degrees, largest turn about the vertical.
    """

    shift: float = 0.1
    turn: float = 10.0


@dataclasses.dataclass(frozen=True)
class SensorNoise(_Axis):
    """Noise of observations. Each episode has a strength between 0 and 1, by which these deviations are multiplied.

    Attributes:
      rgb: standard deviation of each colour, of the whole range. depth: of each depth, as a share of it.
      proprioception: of each number of proprioception.
    """

    rgb: float = 0.04
    depth: float = 0.01
    proprioception: float = 0.01


@dataclasses.dataclass(frozen=True)
class Instructions(_Axis):
    """Wording of the task; those of the environment's split."""


AXES: dict[str, type[_Axis]] = {
    "objects": Objects,
    "object_poses": ObjectPoses,
    "materials": Materials,
    "lights": Lights,
    "camera": Camera,
    "physics": Physics,
    "robot_start": RobotStart,
    "sensor_noise": SensorNoise,
    "instructions": Instructions,
}
"""Settings of each axis, in the order of `Randomize`."""


@dataclasses.dataclass(frozen=True)
class Randomize:
    """What differs between episodes; an axis that is False or None is as the scene has it, True takes the axis' usual
    settings.

    Attributes:
      objects: models of the task's objects, of the same category.
      object_poses: where the task's objects start.
      materials: colours and textures.
      lights: number, direction, intensity and colour of lights.
      camera: pose and field of view of the robot's cameras.
      physics: masses, friction and damping of objects.
      robot_start: pose of the robot's base.
      sensor_noise: noise of observations.
      instructions: wording of the task.
    """

    objects: bool | Objects | Mapping[str, Any] | None = None
    object_poses: bool | ObjectPoses | Mapping[str, Any] | None = None
    materials: bool | Materials | Mapping[str, Any] | None = None
    lights: bool | Lights | Mapping[str, Any] | None = None
    camera: bool | Camera | Mapping[str, Any] | None = None
    physics: bool | Physics | Mapping[str, Any] | None = None
    robot_start: bool | RobotStart | Mapping[str, Any] | None = None
    sensor_noise: bool | SensorNoise | Mapping[str, Any] | None = None
    instructions: bool | Instructions | Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        """Raises EngineError, UnknownNameError: an axis is neither True nor settings of it."""
        for name in AXES:
            object.__setattr__(self, name, self.settings(name))

    @classmethod
    def of(cls, given: Any) -> Randomize | None:
        """What `make(randomize=...)` takes: a `Randomize`, its settings by name, names of axes, or nothing.

        Raises:
          EngineError: it is none of these. UnknownNameError: no such axis.
        """
        if given is None or isinstance(given, Randomize):
            found = given
        elif isinstance(given, Mapping):
            found = cls(**_known("axis of Randomize", given, cls))
        elif isinstance(given, list | tuple | set | frozenset) and all(isinstance(name, str) for name in given):
            found = cls(**_known("axis of Randomize", dict.fromkeys(given, True), cls))
        else:
            raise EngineError(f"randomize = {given!r}: ig2mj.Randomize(physics=True), or its settings by name")
        if found is None or not found.axes:
            return None
        return cls(**{name: found.settings(name) for name in AXES})

    @classmethod
    def every(cls) -> Randomize:
        """All axes with their usual settings."""
        usual: dict[str, Any] = {name: kind() for name, kind in AXES.items()}
        return cls(**usual)

    def settings(self, axis: str) -> Any:
        """Settings of an axis; None: it is off. Raises EngineError, UnknownNameError: they are none."""
        given, kind = getattr(self, axis), AXES[axis]
        if isinstance(given, kind):
            return given
        if isinstance(given, Mapping):
            return kind(**_known(f"setting of the axis {axis}", given, kind))
        if given is None or isinstance(given, bool) or type(given).__name__ == "bool":
            return kind() if given else None
        if axis == "physics":
            raise EngineError(f"randomize: physics = {given!r}: True, or Physics(mass=(0.8, 1.25), ...)")
        raise EngineError(f"randomize: {axis} = {given!r}: True, or {kind.__name__}(...)")

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that differ."""
        return tuple(name for name in AXES if self.settings(name) is not None)

    @property
    def model_fields(self) -> tuple[str, ...]:
        """Fields of the model that an engine must have for each world."""
        return tuple(field for name in self.axes for field in AXES[name].model_fields)

    def as_dict(self) -> dict[str, Any]:
        """Its settings in plain values, for files; `of` reads them."""
        return {name: _plain(dataclasses.asdict(self.settings(name))) for name in self.axes}


def _range(name: str, given: Any) -> Range:
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not 0 < low <= high < math.inf:
        raise EngineError(f"randomize: {name} = {given!r}: the least and the largest factor, such as (0.8, 1.25)")
    return low, high


_PROBABILITIES = ("off", "spare", "textures")


def _number(field: dataclasses.Field[Any], given: Any) -> float | int:
    """A setting that is no range. Raises EngineError."""
    name, whole = field.name, isinstance(field.default, int)
    try:
        value = float(given)
    except (TypeError, ValueError):
        value = math.nan
    if isinstance(given, bool) or not 0 <= value < math.inf or (whole and (value < 1 or value != int(value))):
        kind = "a whole number from 1" if whole else "a finite number of at least 0"
        raise EngineError(f"randomize: {name} = {given!r}: {kind}, such as {field.default}")
    if name in _PROBABILITIES and value > 1:
        raise EngineError(f"randomize: {name} = {given!r}: a probability is between 0 and 1")
    return int(value) if whole else value


def _known(kind: str, given: Mapping[str, Any], of: type) -> dict[str, Any]:
    names = [field.name for field in dataclasses.fields(of)]
    for name in given:
        if name not in names:
            raise UnknownNameError(kind, str(name), names)
    return dict(given)


def _plain(values: Any) -> Any:
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}
