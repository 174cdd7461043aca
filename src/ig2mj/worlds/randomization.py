"""`Randomization`: draws what `Randomize` names when an episode begins.

All values follow from the episode's key (`random_streams.episode_keys`), and thereby from seed, world and episode:
neither the engine nor the number of worlds matters. Fields of the model become part of the world's physics
(`ModelFields`), all else of the batch (`Draw`), so that snapshots, files of states and recordings have them.

Axes: W worlds, V variants, O objects, B bodies, G geoms, M materials, L lights, nv degrees of freedom.
"""

from __future__ import annotations

import math
import zlib

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float, UInt

from ig2mj.engine.model_fields import MASSES, ModelFields, with_masses
from ig2mj.engine.view import Array
from ig2mj.scene.tables import SceneTables
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.randomize import Range, Randomize

VARIANTS = 64
"""Sets of masses that are made when an environment is: what MuJoCo derives from masses is computed on the host. Each
episode has one of them. Friction and damping are drawn freely."""

VARIANT_SEED = 20_000_003
"""Of the variants' masses: the same ones in every process."""

STREAMS = {"mass": 0x6D617373, "friction": 0x66726963, "damping": 0x64616D70}
"""Folded into an episode's key, one for each quantity; those that are not here take the checksum of their name."""


class Randomization:
    """Draws for the episodes of a scene; `fields` and `draw` may be part of a compiled program."""

    def __init__(self, randomize: Randomize, model: mujoco.MjModel, tables: SceneTables):
        """model, tables: of the scene with its robots."""
        self.physics = randomize.settings("physics")
        self.noise, self.instructions = randomize.settings("sensor_noise"), randomize.settings("instructions")
        self._objects = len(tables.object_names)
        if self.physics is not None:
            self._plan_physics(model, tables)

    def fields(self, key: UInt[Array, "W 2"]) -> ModelFields:
        """Of worlds whose episodes have these keys."""
        found = {}
        if self.physics is not None:
            found |= self._physics_fields(key)
        return ModelFields(**found)

    def draw(self, key: UInt[Array, "W 2"]) -> Draw:
        """All else, of worlds whose episodes have these keys."""
        found = {}
        if self.noise is not None:
            found["noise"] = uniform(key, "noise")
        if self.instructions is not None:
            found["instruction"] = jax.vmap(lambda k: jax.random.randint(k, (), 0, 2**30))(stream(key, "instruction"))
        return Draw(**found)

    # Physics.

    def _plan_physics(self, model: mujoco.MjModel, tables: SceneTables) -> None:
        whole = _wholes(tables)
        self._geom_object = whole[tables.geom_object]
        self._friction = np.array(model.geom_friction, np.float32)
        joint_object = whole[tables.body_object[model.jnt_bodyid]]
        hinged = np.isin(model.jnt_type, [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)])
        self._dof_object = np.where(hinged, joint_object, -1)[model.dof_jntid]
        self._damping = np.array(model.dof_damping, np.float32)
        self._masses = _mass_variants(model, tables, whole, self.physics.mass)

    def _physics_fields(self, key: UInt[Array, "W 2"]) -> dict[str, Array]:
        variant = jax.vmap(lambda k: jax.random.randint(k, (), 0, VARIANTS))(stream(key, "mass"))
        masses = {name: jnp.asarray(getattr(self._masses, name))[variant] for name in MASSES}
        friction = self._factors(key, "friction", self.physics.friction, self._geom_object)
        damping = self._factors(key, "damping", self.physics.damping, self._dof_object)
        return masses | {
            "geom_friction": self._friction * friction[:, :, None],
            "dof_damping": self._damping * damping,
        }

    def _factors(self, key: UInt[Array, "W 2"], name: str, between: Range, owner: np.ndarray) -> Float[Array, "W n"]:
        """A factor for each entry of a field: its object's; 1 where `owner` is -1."""
        of_object = factors(key, name, between, (self._objects,))
        return jnp.where(owner >= 0, of_object[:, np.maximum(owner, 0)], 1.0).astype(jnp.float32)


def stream(key: UInt[Array, "W 2"], name: str) -> UInt[Array, "W 2"]:
    """Keys of one quantity of each world's episode."""
    number = STREAMS.get(name, zlib.crc32(name.encode()) >> 1)
    return jax.vmap(lambda one: jax.random.fold_in(one, number))(key)


def uniform(
    key: UInt[Array, "W 2"], name: str, shape: tuple[int, ...] = (), low: float = 0.0, high: float = 1.0
) -> Float[Array, "W ..."]:
    """Numbers [W, *shape] between two, all equally likely."""
    return jax.vmap(lambda one: jax.random.uniform(one, shape, minval=low, maxval=high))(stream(key, name))


def factors(key: UInt[Array, "W 2"], name: str, between: Range, shape: tuple[int, ...]) -> Float[Array, "W ..."]:
    """Factors [W, *shape] between two, evenly on a logarithmic scale."""
    low, high = (math.log(value) for value in between)
    return jnp.exp(uniform(key, name, shape, low, high))


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
