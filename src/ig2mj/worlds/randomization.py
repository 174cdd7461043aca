"""`Randomization`: draws what `Randomize` names when an episode begins.

All values follow from the episode's key (`random_streams.episode_keys`), and thereby from seed, world and episode:
neither the engine nor the number of worlds matters. Fields of the model become part of the world's physics
(`ModelFields`), all else of the batch (`Draw`), so that snapshots, files of states and recordings have them.

Axes: W worlds, V variants, O objects, B bodies, G geoms, M materials, L lights, nv degrees of freedom.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Float, Int, UInt

from ig2mj.engine.model_fields import MASSES, ModelFields, with_masses
from ig2mj.engine.view import Array
from ig2mj.geometry.poses import namespace
from ig2mj.scene.tables import SceneTables
from ig2mj.worlds.draw import SPARE_LIGHTS, Draw
from ig2mj.worlds.randomize import Randomize, Range

VARIANTS = 64
"""Sets of masses that are made when an environment is: what MuJoCo derives from masses is computed on the host. Each
episode has one of them. Friction and damping are drawn freely."""

VARIANT_SEED = 20_000_003
"""Of the variants' masses: the same ones in every process."""

STREAMS = {"mass": 0x6D617373, "friction": 0x66726963, "damping": 0x64616D70}
"""Folded into an episode's key, one for each quantity; those that are not here take the checksum of their name."""


NO_TURN = np.array([1.0, 0.0, 0.0, 0.0], np.float32)


class Randomization:
    """Draws for the episodes of a scene; `fields` and `draw` may be part of a compiled program."""

    def __init__(self, randomize: Randomize, model: mujoco.MjModel, tables: SceneTables):
        """model, tables: of the scene with its robots."""
        self.physics = randomize.settings("physics")
        self.noise, self.instructions = randomize.settings("sensor_noise"), randomize.settings("instructions")
        self._objects = len(tables.object_names)
        self.materials, self.lights = randomize.settings("materials"), randomize.settings("lights")
        self.camera, self._lights = randomize.settings("camera"), model.nlight
        if self.physics is not None:
            self._plan_physics(model, tables)
        if self.materials is not None:
            self._plan_materials(model, tables)

    def fields(self, key: UInt[Array, "W 2"]) -> ModelFields:
        """Of worlds whose episodes have these keys."""
        values = self.values(key)
        found = {}
        if self.physics is not None:
            variant = values["variant"]
            found |= {name: jnp.asarray(getattr(self._masses, name))[variant] for name in MASSES}
            found |= self._contact_fields(values)
        if self.materials is not None:
            found |= self._material_fields(values)
        return ModelFields(**found)

    def fields_of(self, values: Mapping[str, Array]) -> ModelFields:
        """Of worlds with these values, those of `values` or from a file. On the host."""
        found = {}
        if self.physics is not None:
            found |= self._mass_fields(np.asarray(values["mass"], float)) | self._contact_fields(values)
        if self.materials is not None:
            found |= self._material_fields(values)
        return ModelFields(**found)

    def values(self, key: UInt[Array, "W 2"]) -> dict[str, Array]:
        """What fields of the model of worlds whose episodes have these keys are made of: factors of objects (mass,
        friction, damping, object_colour), of materials (material_colour), and which objects exchange their material."""
        found, objects = {}, self._objects
        if self.physics is not None:
            found["variant"] = pick(key, "mass", VARIANTS)
            found["mass"] = jnp.asarray(self._mass_factors, jnp.float32)[found["variant"]]
            found["friction"] = factors(key, "friction", self.physics.friction, (objects,))
            found["damping"] = factors(key, "damping", self.physics.damping, (objects,))
        if self.materials is not None:
            found["object_colour"] = factors(key, "object_colour", self.materials.colour, (objects + 1, 3))
            found["material_colour"] = factors(key, "material_colour", self.materials.colour, (len(self._mat_rgba), 3))
            exchanged = uniform(key, "exchanged", (objects + 1,)) < self.materials.textures
            found["exchanged"] = jnp.where(exchanged, uniform(key, "material", (objects + 1,)), -1.0)
        return found

    def neutral(self, worlds: int) -> dict[str, np.ndarray]:
        """Values, those of `values` and of `Draw`, with which worlds are as the scene has them, of the axes that are
        on."""
        found: dict[str, np.ndarray] = {}
        objects, one = self._objects, np.ones
        if self.physics is not None:
            found |= {name: one((worlds, objects), np.float32) for name in ("mass", "friction", "damping")}
        if self.materials is not None:
            found["object_colour"] = one((worlds, objects + 1, 3), np.float32)
            found["material_colour"] = one((worlds, len(self._mat_rgba), 3), np.float32)
            found["exchanged"] = np.full((worlds, objects + 1), -1.0, np.float32)
        if self.lights is not None:
            found["light_colour"] = one((worlds, 1 + self._lights + SPARE_LIGHTS, 3), np.float32)
            found["light_colour"][:, 1 + self._lights :] = 0.0  # the spare ones are off
            found["light_quat"] = np.tile(NO_TURN, (worlds, 1 + self._lights + SPARE_LIGHTS, 1))
        if self.camera is not None:
            found |= {"camera_pos": np.zeros((worlds, 3), np.float32), "camera_quat": np.tile(NO_TURN, (worlds, 1))}
            found["camera_slope"] = one(worlds, np.float32)
        if self.noise is not None:
            found["noise"] = np.zeros(worlds, np.float32)
        if self.instructions is not None:
            found["instruction"] = np.zeros(worlds, np.int32)
        return found

    def used(self) -> dict[str, np.ndarray]:
        """Which entries of `values` change anything."""
        found, objects = {}, np.arange(self._objects)
        if self.physics is not None:
            found["mass"] = np.isin(objects, self._mass_owner)
            found["friction"] = np.isin(objects, self._geom_object)
            found["damping"] = np.isin(objects, self._dof_object)
        if self.materials is not None:
            seen = np.isin(np.arange(self._objects + 1), self._look_object)
            found |= {"object_colour": seen, "exchanged": seen, "material_colour": self._of_home}
        return found

    def draw(self, key: UInt[Array, "W 2"]) -> Draw:
        """All else, of worlds whose episodes have these keys."""
        found = {}
        if self.lights is not None:
            found |= self._light_draw(key)
        if self.camera is not None:
            found |= self._camera_draw(key)
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
        self._model = model
        owner = np.where(np.append(tables.object_fixed, True)[tables.body_object], -1, whole[tables.body_object])
        low, high = (math.log(value) for value in self.physics.mass)
        rng = np.random.default_rng(VARIANT_SEED)
        self._mass_owner = owner
        self._mass_factors = np.exp(rng.uniform(low, high, (VARIANTS, self._objects)))
        factor = np.where(owner >= 0, self._mass_factors[:, np.maximum(owner, 0)], 1.0)
        self._masses = with_masses(model, model.body_mass * factor)

    def _mass_fields(self, factors: Float[np.ndarray, "W O"]) -> dict[str, np.ndarray]:
        """Masses of worlds with these factors; those of equal worlds are derived once, which takes milliseconds."""
        different, which = np.unique(factors, axis=0, return_inverse=True)
        of_body = np.where(self._mass_owner >= 0, different[:, np.maximum(self._mass_owner, 0)], 1.0)
        masses = with_masses(self._model, self._model.body_mass * of_body)
        return {name: getattr(masses, name)[which.ravel()] for name in MASSES}

    def _contact_fields(self, values: Mapping[str, Array]) -> dict[str, Array]:
        friction = _of_owner(values["friction"], self._geom_object)
        damping = _of_owner(values["damping"], self._dof_object)
        return {
            "geom_friction": self._friction * friction[:, :, None],
            "dof_damping": self._damping * damping,
        }

    # Materials.

    def _plan_materials(self, model: mujoco.MjModel, tables: SceneTables) -> None:
        whole = _wholes(tables)
        self._look_object = whole[tables.geom_object]
        self._rgba, self._mat_rgba = np.array(model.geom_rgba, np.float32), np.array(model.mat_rgba, np.float32)
        self._material = np.array(model.geom_matid, np.int32)
        self._of_home = np.isin(np.arange(model.nmat), self._material[self._look_object >= 0])
        kinds = [kind_of_material(model.material(m).name) for m in range(model.nmat)]
        self._kinds = [np.flatnonzero([kind == one for kind in kinds]) for one in dict.fromkeys(filter(None, kinds))]

    def _material_fields(self, values: Mapping[str, Array]) -> dict[str, Array]:
        of_object, colour, share = self._look_object, values["object_colour"], values["exchanged"]
        xp = namespace(colour, share, values["material_colour"])
        own = xp.where((of_object >= 0)[:, None], colour[:, of_object], np.float32(1.0))
        own = xp.concatenate([own, xp.ones_like(own[..., :1])], axis=-1)
        plain = (self._rgba == UNCOLOURED).all(1)  # what a material colours
        rgba = xp.where(plain[:, None], self._rgba, xp.clip(self._rgba * own, 0.0, 1.0))
        shade = xp.where(self._of_home[:, None], values["material_colour"], np.float32(1.0))
        shade = xp.concatenate([shade, xp.ones_like(shade[..., :1])], axis=-1)
        found = xp.broadcast_to(self._material, (share.shape[0], len(self._material)))
        for kind in self._kinds:
            number = xp.clip((share * len(kind)).astype(np.int32), 0, len(kind) - 1)
            other = xp.asarray(kind, np.int32)[number][:, of_object]
            replaced = (share >= 0)[:, of_object] & np.isin(self._material, kind) & (of_object >= 0)
            found = xp.where(replaced, other, found)
        mat_rgba = xp.clip(self._mat_rgba * shade, 0.0, 1.0)
        return {"geom_rgba": rgba, "mat_rgba": mat_rgba, "geom_matid": found.astype(np.int32)}

    # Light and cameras.

    def _light_draw(self, key: UInt[Array, "W 2"]) -> dict[str, Array]:
        own, count = self._lights, 1 + self._lights + SPARE_LIGHTS
        brightness = factors(key, "light_intensity", self.lights.intensity, (count, 1))
        colour = brightness * factors(key, "light_colour", self.lights.colour, (count, 3))
        chance = uniform(key, "light_on", (count,))
        on = jnp.concatenate(
            [
                jnp.ones_like(chance[:, :1], bool),
                chance[:, 1 : 1 + own] >= self.lights.off,
                chance[:, 1 + own :] < self.lights.spare,
            ],
            axis=1,
        )
        if own:
            on = on.at[:, 1].set(on[:, 1] | ~on[:, 1:].any(1))
        angle = jnp.deg2rad(self.lights.direction) * uniform(key, "light_direction", (count, 2), -1.0, 1.0)
        axis = jnp.concatenate([angle, jnp.zeros_like(angle[..., :1])], axis=-1)
        return {"light_colour": jnp.where(on[..., None], colour, 0.0), "light_quat": quat_of(axis)}

    def _camera_draw(self, key: UInt[Array, "W 2"]) -> dict[str, Array]:
        turn = jnp.deg2rad(self.camera.turn) * uniform(key, "camera_turn", (3,), -1.0, 1.0)
        return {
            "camera_pos": self.camera.shift * uniform(key, "camera_shift", (3,), -1.0, 1.0) / math.sqrt(3.0),
            "camera_quat": quat_of(turn),
            "camera_slope": factors(key, "camera_slope", self.camera.fovy, ()),
        }


KINDS = {
    "wood": ("wood",),
    "cloth": ("fabric", "knit", "canvas", "pile", "checks", "leather", "tissue", "towel", "carpet"),
    "metal": ("metal", "steel", "chrome"),
    "cover": ("cover",),
    "stone": ("stone", "marble", "granite", "tile", "tiles", "concrete"),
}
"""Kinds of materials within which objects exchange them, and how names of such materials begin."""

UNCOLOURED = np.array([0.5, 0.5, 0.5, 1.0], np.float32)
"""MuJoCo's colour of geoms that have the one of their material."""


def kind_of_material(name: str) -> str | None:
    """By the beginning of its name, behind those of folders; None: it is made for one object."""
    first = re.split(r"[_\-.\d]", name.rpartition("/")[2].lower(), maxsplit=1)[0]
    return next((kind for kind, words in KINDS.items() if first in words), None)


def quat_of(turn: Float[Array, "... 3"]) -> Float[Array, "... 4"]:
    """w-x-y-z of rotation vectors (rad)."""
    half = 0.5 * jnp.linalg.norm(turn, axis=-1, keepdims=True)
    return jnp.concatenate([jnp.cos(half), 0.5 * turn * jnp.sinc(half / jnp.pi)], axis=-1)


def stream(key: UInt[Array, "W 2"], name: str) -> UInt[Array, "W 2"]:
    """Keys of one quantity of each world's episode."""
    number = STREAMS.get(name, zlib.crc32(name.encode()) >> 1)
    return jax.vmap(lambda one: jax.random.fold_in(one, number))(key)


def uniform(
    key: UInt[Array, "W 2"], name: str, shape: tuple[int, ...] = (), low: float = 0.0, high: float = 1.0
) -> Float[Array, "W ..."]:
    """Numbers [W, *shape] between two, all equally likely."""
    return jax.vmap(lambda one: jax.random.uniform(one, shape, minval=low, maxval=high))(stream(key, name))


def pick(key: UInt[Array, "W 2"], name: str, count: int) -> Int[Array, "W"]:
    """Whole numbers below `count`, all equally likely."""
    return jax.vmap(lambda one: jax.random.randint(one, (), 0, count))(stream(key, name)).astype(jnp.int32)


def factors(key: UInt[Array, "W 2"], name: str, between: Range, shape: tuple[int, ...]) -> Float[Array, "W ..."]:
    """Factors [W, *shape] between two, evenly on a logarithmic scale."""
    low, high = (math.log(value) for value in between)
    return jnp.exp(uniform(key, name, shape, low, high))


def _wholes(tables: SceneTables) -> np.ndarray:
    """[O + 1] the whole of each object, itself where it is no half; -1 at index -1."""
    own = np.arange(len(tables.object_names))
    return np.append(np.where(tables.object_part_of >= 0, tables.object_part_of, own), -1)


def _of_owner(of_object: Array, owner: np.ndarray) -> Float[Array, "W n"]:
    """A factor for each entry of a field: its object's; 1 where `owner` is -1."""
    return (
        namespace(of_object).where(owner >= 0, of_object[:, np.maximum(owner, 0)], np.float32(1.0)).astype(np.float32)
    )
