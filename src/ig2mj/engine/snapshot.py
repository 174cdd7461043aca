"""`Snapshot`: physics of worlds outside of any engine, in two parts: the scene's and the agents'.

It is what an engine needs to go on exactly where a world stood, and the form in which worlds go to files, to pools of
initial states and from one engine to another. Agents are compiled into a scene after everything else, so their part of
each of MuJoCo's arrays is its end. A snapshot of the bare scene can be loaded into the scene with any robot: the robot
then stands at its start.

Axes: V units of objects, X units of agents (see `ig2mj.engine.layout`), H hands, O objects; others as in MuJoCo, of one
part.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.model_fields import ModelFields, given
from ig2mj.engine.view import Array, counted, length
from ig2mj.errors import EngineError

FORMAT_VERSION = 2
"""Of what a file holds of a snapshot. 1: all arrays were of scene and agents together."""

FULLY_AWAKE = -(1 + 10)
"""`tree_asleep` of a tree that must rest for the full number of steps before it sleeps (mjMINAWAKE is 10)."""


@struct.dataclass
class ScenePart:
    """What belongs to the scene's objects and building. Fields are MuJoCo's of the same name.

    Attributes:
      tree_asleep: sleep state per kinematic tree: negative awake, else the next tree of its sleeping island.
      eq_data: parameters of equality constraints, per world.
      touching: remembered contact of units.
    """

    qpos: Float[Array, "*W nq"]
    qvel: Float[Array, "*W nv"]
    act: Float[Array, "*W na"]
    ctrl: Float[Array, "*W nu"]
    qacc_warmstart: Float[Array, "*W nv"]
    eq_active: Bool[Array, "*W E"]
    eq_data: Float[Array, "*W E 12"]
    mocap_pos: Float[Array, "*W M 3"]
    mocap_quat: Float[Array, "*W M 4"]
    tree_asleep: Int[Array, "*W T"]
    touching: Bool[Array, "*W V V"]


@struct.dataclass
class AgentsPart:
    """What belongs to agents: their coordinates, controls, and the equality constraints that one of their bodies has.

    Attributes:
      touching: remembered contact of agents' units with objects'.
      ignored_contacts: pairs of hand and object whose contacts are dropped (`ig2mj.engine.base.Write`).
      The others as in `ScenePart`.
    """

    qpos: Float[Array, "*W nq"]
    qvel: Float[Array, "*W nv"]
    act: Float[Array, "*W na"]
    ctrl: Float[Array, "*W nu"]
    qacc_warmstart: Float[Array, "*W nv"]
    eq_active: Bool[Array, "*W E"]
    eq_data: Float[Array, "*W E 12"]
    mocap_pos: Float[Array, "*W M 3"]
    mocap_quat: Float[Array, "*W M 4"]
    tree_asleep: Int[Array, "*W T"]
    touching: Bool[Array, "*W X V"]
    ignored_contacts: Bool[Array, "*W H O"]


AXIS: dict[str, int] = {
    "qpos": -1,
    "qvel": -1,
    "act": -1,
    "ctrl": -1,
    "qacc_warmstart": -1,
    "eq_active": -1,
    "eq_data": -2,
    "mocap_pos": -2,
    "mocap_quat": -2,
    "tree_asleep": -1,
}
"""Fields that are MuJoCo's arrays in two parts, and the axis along which they are."""


@struct.dataclass
class Snapshot:
    """Physics of one world, or of a batch of worlds (every array then begins with the world axis). Numpy's or JAX's.

    `qpos`, `qvel` and so on give MuJoCo's arrays of scene and agents together; the parts are what is stored.

    Attributes:
      scene, agents: the two parts. time: simulated seconds, of shape () or (W,).
      model_fields: fields of the model that are the world's own, but for `eq_data`, which is in the parts. Loaded where
        it has none, a world gets the scene's.
    """

    scene: ScenePart
    agents: AgentsPart
    time: Float[Array, "*W"]
    model_fields: ModelFields = ModelFields()

    def __repr__(self) -> str:
        return counted(self, worlds=length(self.time), coordinates=length(self.scene.qpos, -1))

    def whole(self, name: str) -> Array:
        """One of MuJoCo's arrays (`AXIS`), of scene and agents together. To change it: `with_whole`."""
        scene, agents, axis = getattr(self.scene, name), getattr(self.agents, name), AXIS[name]
        if not agents.shape[axis]:
            return scene
        if isinstance(scene, jax.Array) or isinstance(agents, jax.Array):
            return jnp.concatenate([scene, agents], axis)
        both = np.concatenate([scene, agents], axis)
        both.flags.writeable = False  # a copy: what is written to it would be lost without a word
        return both

    def with_whole(self, **fields: Any) -> Snapshot:
        """The snapshot with others of MuJoCo's arrays, of scene and agents together."""
        scene, agents = {}, {}
        for name, array in fields.items():
            scene[name], agents[name] = _split(array, AXIS[name], getattr(self.scene, name).shape[AXIS[name]])
        return dataclasses.replace(
            self,
            scene=dataclasses.replace(self.scene, **scene),
            agents=dataclasses.replace(self.agents, **agents),
        )

    def without_agents(self) -> Snapshot:
        """The scene's part alone, for a scene with other agents or none (numpy). What slept in one island with a part
        of an agent wakes. Fields of the model stay behind: they are of all bodies."""
        asleep = np.array(self.scene.tree_asleep)
        count = asleep.shape[-1]
        while True:
            following = np.take_along_axis(asleep, np.clip(asleep, 0, max(count - 1, 0)), -1)
            lost = (asleep >= count) | ((asleep >= 0) & (following < 0))
            if not lost.any():
                break
            asleep[lost] = FULLY_AWAKE
        agents = AgentsPart(
            **{name: _split(getattr(self.agents, name), axis, 0)[0] for name, axis in AXIS.items()},
            touching=np.asarray(self.agents.touching)[..., :0, :],
            ignored_contacts=np.asarray(self.agents.ignored_contacts)[..., :0, :],
        )
        scene = dataclasses.replace(self.scene, tree_asleep=asleep)
        return dataclasses.replace(self, scene=scene, agents=agents, model_fields=ModelFields())

    @property
    def qpos(self) -> Float[Array, "*W nq"]:
        return self.whole("qpos")

    @property
    def qvel(self) -> Float[Array, "*W nv"]:
        return self.whole("qvel")

    @property
    def act(self) -> Float[Array, "*W na"]:
        return self.whole("act")

    @property
    def ctrl(self) -> Float[Array, "*W nu"]:
        return self.whole("ctrl")

    @property
    def qacc_warmstart(self) -> Float[Array, "*W nv"]:
        return self.whole("qacc_warmstart")

    @property
    def eq_active(self) -> Bool[Array, "*W E"]:
        return self.whole("eq_active")

    @property
    def eq_data(self) -> Float[Array, "*W E 12"]:
        return self.whole("eq_data")

    @property
    def mocap_pos(self) -> Float[Array, "*W M 3"]:
        return self.whole("mocap_pos")

    @property
    def mocap_quat(self) -> Float[Array, "*W M 4"]:
        return self.whole("mocap_quat")

    @property
    def tree_asleep(self) -> Int[Array, "*W T"]:
        return self.whole("tree_asleep")


def woken(tree_asleep: Array, trees: Int[np.ndarray, "k"]) -> Int[np.ndarray, "*W T"]:
    """`tree_asleep` [..., T] (see `ScenePart`) in which some trees are awake, and those of the islands that they sleep
    in."""
    found = np.array(tree_asleep, np.int32)
    for asleep in found.reshape(-1, found.shape[-1]):
        for tree in trees.tolist():
            while asleep[tree] >= 0:
                asleep[tree], tree = FULLY_AWAKE, int(asleep[tree])
            asleep[tree] = FULLY_AWAKE
    return found


def closed_circles(tree_asleep: Array) -> np.ndarray:
    """`tree_asleep` [..., T] (see `ScenePart`) in which every tree of an open circle is awake.

    Trees that sleep name each other in circles, one for each island. MuJoCo walks along a circle to wake the island; of
    an open one it finds no end, or an awake tree. Engines leave circles open between a write and the next step, and so
    may files.
    """
    found = np.asarray(tree_asleep)
    count = found.shape[-1]
    order = -1 - np.arange(count)
    while True:
        asleep, target = found >= 0, np.clip(found, 0, max(count - 1, 0))
        whole = ~asleep | ((found < count) & (np.take_along_axis(found, target, -1) >= 0)) if count else ~asleep
        named = np.sort(np.where(asleep, found, order), axis=-1)
        if whole.all() and (found >= FULLY_AWAKE).all() and (np.diff(named, axis=-1) > 0).all():
            return found
        times = (target[..., :, None] == target[..., None, :]) & asleep[..., None, :]
        lost = ~whole | (asleep & (times.sum(-1) > 1)) | (found < FULLY_AWAKE)
        found = np.where(lost, np.asarray(FULLY_AWAKE, found.dtype), found)


def make_snapshot(
    fields: Mapping[str, Any],
    sizes: Mapping[str, int],
    time: Any,
    touching: Any,
    agents_touching: Any,
    ignored_contacts: Any,
    model_fields: ModelFields,
) -> Snapshot:
    """A snapshot of MuJoCo's arrays (`AXIS`).

    Args:
      fields: scene and agents together. sizes: how long the scene's part of each is (`ModelLayout.scene_sizes`).
      touching, agents_touching, ignored_contacts: `ScenePart.touching`, and the agents' two.
      model_fields: but for `eq_data`.
    """
    parts = {name: _split(fields[name], axis, sizes[name]) for name, axis in AXIS.items()}
    return Snapshot(
        scene=ScenePart(**{name: part[0] for name, part in parts.items()}, touching=touching),
        agents=AgentsPart(
            **{name: part[1] for name, part in parts.items()},
            touching=agents_touching,
            ignored_contacts=ignored_contacts,
        ),
        time=time,
        model_fields=model_fields,
    )


def fitted(snapshot: Snapshot, start: Snapshot, num_worlds: int, scene: str) -> Snapshot:
    """The snapshot, made to fit an engine; works while tracing.

    Args:
      snapshot: of one world, or with the world axis. One of the bare scene gets the agents of `start`.
      start: of the engine, one world. num_worlds, scene: of the engine.

    Raises:
      EngineError: it is of another scene, of other agents or of another number of worlds.
    """
    batch = tuple(np.shape(snapshot.time))
    if batch not in ((), (num_worlds,)):
        raise EngineError(f"{batch[0]} snapshots do not fit {num_worlds} worlds (give one for each)")
    bare = not any(getattr(snapshot.agents, name).shape[axis] for name, axis in AXIS.items())
    if bare and not snapshot.agents.touching.shape[-2]:
        agents = jax.tree.map(lambda a: np.broadcast_to(a, (*batch, *a.shape)), start.agents)
        snapshot = dataclasses.replace(snapshot, agents=agents)
    for part, names in _PARTS.items():
        given_part, own_part = getattr(snapshot, part), getattr(start, part)
        for name in names:
            found, requested = getattr(given_part, name).shape[len(batch) :], getattr(own_part, name).shape
            if tuple(found) != tuple(requested):
                fix = (
                    "load it into the scene that it was saved from"
                    if part == "scene"
                    else "load it into the scene with the agents that it was saved with, or take its `without_agents()`"
                )
                raise EngineError(
                    f"the snapshot does not fit scene '{scene}': {name} of its {part} has shape {tuple(found)}, "
                    f"the scene's {tuple(requested)} ({fix})"
                )
    fields = _fitted_fields(snapshot.model_fields, start.model_fields, batch)
    return snapshot if fields is snapshot.model_fields else dataclasses.replace(snapshot, model_fields=fields)


_PARTS = {
    part: tuple(field.name for field in dataclasses.fields(kind))
    for part, kind in (("scene", ScenePart), ("agents", AgentsPart))
}


def _fitted_fields(fields: ModelFields, start: ModelFields, batch: tuple[int, ...]) -> ModelFields:
    found, requested = given(fields), given(start)
    for name, array in found.items():
        if name not in requested:
            raise EngineError(
                f"the snapshot has a {name} of its own (make the engine with model_fields=(..., '{name}'))"
            )
        if tuple(array.shape) != (*batch, *requested[name].shape):
            raise EngineError(f"the snapshot does not fit: its {name} has shape {tuple(array.shape)}")
    missing = {n: np.broadcast_to(a, (*batch, *a.shape)) for n, a in requested.items() if n not in found}
    return dataclasses.replace(fields, **missing) if missing else fields


def _split(array: Any, axis: int, count: int) -> tuple[Any, Any]:
    after = (slice(None),) * (-axis - 1)
    return array[(..., slice(None, count), *after)], array[(..., slice(count, None), *after)]
