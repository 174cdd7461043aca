"""`Randomize`: what differs between the worlds and the episodes of a batch, axis by axis, and `Randomization`, which
draws it when an episode begins.

    env = ig2mj.make("CookingMeat", worlds=64, randomize=ig2mj.Randomize(physics=True))
    env = ig2mj.make("CookingMeat", randomize=ig2mj.Randomize(physics=Physics(mass=(0.5, 2.0))))

All values follow from the episode's key (`random_streams.episode_keys`), and thereby from seed, world and episode:
neither the engine nor the number of worlds matters. What is drawn becomes part of the world's physics (`ModelFields`),
so that snapshots, recordings and replays have it. docs/design/randomization.md

Axes: W worlds, V variants, O objects, B bodies, G geoms, nv degrees of freedom.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float, UInt

from ig2mj.engine.model_fields import MASSES, ModelFields, with_masses
from ig2mj.engine.view import Array
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.scene.tables import SceneTables

Range = tuple[float, float]
"""Least and largest factor; factors between them are drawn evenly on a logarithmic scale."""

VARIANTS = 64
"""Sets of masses that are made when an environment is: what MuJoCo derives from masses is computed on the host. Each
episode has one of them. Friction and damping are drawn freely."""

VARIANT_SEED = 20_000_003
"""Of the variants' masses: the same ones in every process."""

STREAMS = {"mass": 0x6D617373, "friction": 0x66726963, "damping": 0x64616D70}
"""Folded into an episode's key, one for each quantity."""


@dataclasses.dataclass(frozen=True)
class Physics:
    """Factors by which physics differs from the scene's.

    Attributes:
      mass: of each movable object, with its inertia; halves have their whole's.
      friction: of each object's contacts, sliding, torsional and rolling alike.
      damping: of the joints of objects (doors, drawers, lids).
    """

    mass: Range = (0.8, 1.25)
    friction: Range = (0.7, 1.4)
    damping: Range = (0.7, 1.4)

    def __post_init__(self) -> None:
        """Raises EngineError: a range is none."""
        for field in dataclasses.fields(self):
            _range(field.name, getattr(self, field.name))


@dataclasses.dataclass(frozen=True)
class Randomize:
    """What differs between episodes; an axis that is False or None is as the scene has it.

    Attributes:
      physics: masses, friction and damping of objects; True: `Physics()`.
    """

    physics: bool | Physics | Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        """Raises EngineError, UnknownNameError: an axis is neither True nor settings of it."""
        _physics(self.physics)

    @classmethod
    def of(cls, given: Any) -> Randomize | None:
        """What `make(randomize=...)` takes: a `Randomize`, its settings by name, or nothing.

        Raises:
          EngineError: it is none of these. UnknownNameError: no such axis.
        """
        if given is None or isinstance(given, Randomize):
            found = given and cls(physics=_physics(given.physics))
        elif isinstance(given, Mapping):
            found = cls(**{name: _physics(value) for name, value in _known("axis of Randomize", given, cls).items()})
        else:
            raise EngineError(f"randomize = {given!r}: ig2mj.Randomize(physics=True), or its settings by name")
        return found if found is not None and found.axes else None

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that differ."""
        return tuple(field.name for field in dataclasses.fields(self) if getattr(self, field.name))

    @property
    def model_fields(self) -> tuple[str, ...]:
        """Fields of the model that an engine must have for each world."""
        return (*MASSES, "geom_friction", "dof_damping") if self.physics else ()

    def as_dict(self) -> dict[str, Any]:
        """Its settings in plain values, for files; `of` reads them."""
        settings = {"physics": _physics(self.physics)}
        return {name: _plain(dataclasses.asdict(found)) for name, found in settings.items() if found is not None}


class Randomization:
    """Draws the fields of a scene's model for episodes; `fields` may be part of a compiled program."""

    def __init__(self, randomize: Randomize, model: mujoco.MjModel, tables: SceneTables):
        """model, tables: of the scene with its robots."""
        self.physics, whole = _physics(randomize.physics) or Physics(), _wholes(tables)
        self._geom_object, self._objects = whole[tables.geom_object], len(tables.object_names)
        self._friction = np.array(model.geom_friction, np.float32)
        joint_object = whole[tables.body_object[model.jnt_bodyid]]
        hinged = np.isin(model.jnt_type, [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)])
        self._dof_object = np.where(hinged, joint_object, -1)[model.dof_jntid]
        self._damping = np.array(model.dof_damping, np.float32)
        self._masses = _mass_variants(model, tables, whole, self.physics.mass)

    def fields(self, key: UInt[Array, "W 2"]) -> ModelFields:
        """Of worlds whose episodes have these keys."""
        variant = jax.vmap(lambda k: jax.random.randint(jax.random.fold_in(k, STREAMS["mass"]), (), 0, VARIANTS))(key)
        masses = {name: jnp.asarray(getattr(self._masses, name))[variant] for name in MASSES}
        friction = self._factors(key, "friction", self.physics.friction, self._geom_object)
        damping = self._factors(key, "damping", self.physics.damping, self._dof_object)
        return ModelFields(
            **masses, geom_friction=self._friction * friction[:, :, None], dof_damping=self._damping * damping
        )

    def _factors(self, key: UInt[Array, "W 2"], stream: str, between: Range, owner: np.ndarray) -> Float[Array, "W n"]:
        """A factor for each entry of a field: its object's; 1 where `owner` is -1."""
        low, high = (math.log(value) for value in between)

        def draw(one: Array) -> Array:
            return jax.random.uniform(
                jax.random.fold_in(one, STREAMS[stream]), (self._objects,), minval=low, maxval=high
            )

        of_object = jnp.exp(jax.vmap(draw)(key))
        return jnp.where(owner >= 0, of_object[:, np.maximum(owner, 0)], 1.0).astype(jnp.float32)


def _wholes(tables: SceneTables) -> np.ndarray:
    """[O + 1] the whole of each object, itself where it is no half; -1 at index -1."""
    own = np.arange(len(tables.object_names))
    return np.append(np.where(tables.object_part_of >= 0, tables.object_part_of, own), -1)


def _mass_variants(model: mujoco.MjModel, tables: SceneTables, whole: np.ndarray, between: Range) -> ModelFields:
    """The fields of masses, [V, ...]."""
    owner = np.where(np.append(tables.object_fixed, True)[tables.body_object], -1, whole[tables.body_object])
    low, high = (math.log(value) for value in between)
    rng = np.random.default_rng(VARIANT_SEED)
    of_object = np.exp(rng.uniform(low, high, (VARIANTS, len(tables.object_names))))
    factor = np.where(owner >= 0, of_object[:, np.maximum(owner, 0)], 1.0)
    return with_masses(model, model.body_mass * factor)


def _range(name: str, given: Any) -> Range:
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not 0 < low <= high < math.inf:
        raise EngineError(f"randomize: {name} = {given!r}: the least and the largest factor, such as (0.8, 1.25)")
    return low, high


def _physics(given: Any) -> Physics | None:
    """The axis `physics`. Raises EngineError, UnknownNameError."""
    if isinstance(given, Mapping):
        named = _known("setting of the axis physics", given, Physics)
        return Physics(**{name: _range(name, value) for name, value in named.items()})
    if given is None or isinstance(given, bool | np.bool_):
        return Physics() if given else None
    if not isinstance(given, Physics):
        raise EngineError(f"randomize: physics = {given!r}: True, or Physics(mass=(0.8, 1.25), ...)")
    return given


def _known(kind: str, given: Mapping[str, Any], of: type) -> dict[str, Any]:
    names = [field.name for field in dataclasses.fields(of)]
    for name in given:
        if name not in names:
            raise UnknownNameError(kind, str(name), names)
    return dict(given)


def _plain(values: Any) -> Any:
    return {name: list(value) for name, value in values.items()}
