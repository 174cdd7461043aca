"""Files of one whole world: physics, states, random key and clock in one `.npz` (arrays only, no pickle)."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from ig2mj.engine.base import Physics
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import PhysicsView
from ig2mj.errors import InputError
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates, WorldState
from ig2mj.worlds.archive import load_exactly, read_header, save_tree
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.core import Core
from ig2mj.worlds.guards import Flag
from ig2mj.worlds.hands import Held
from ig2mj.worlds.plugin_states import plugin_defaults, plugin_header, refuse_foreign
from ig2mj.worlds.pool import check_numbers, check_values
from ig2mj.worlds.rules import Rules

if TYPE_CHECKING:
    from ig2mj.simulation.simulation import Simulation

VERSION = 1
"""Of the files that `save_world` writes."""


@struct.dataclass
class SavedWorld:
    """What goes on changing in a world; every array begins with an axis of length 1, but for `key`.

    Attributes:
      physics, states: of the world. key: raw data of the random key. step: control steps since the reset.
      controllers: what each robot's controller remembers. held: what hands hold, None where by friction alone.
    """

    physics: Snapshot
    states: ExtendedStates
    key: np.ndarray
    step: np.ndarray
    controllers: tuple[Any, ...]
    held: Held


def first_batch(core: Core, physics: Physics, seed: int) -> Batch:
    """One world at the start of an episode with this physics; of physics alone the states stay as they are."""
    nothing = np.zeros(1, np.int32)
    world = WorldState(
        physics=physics,
        view=core.engine.view(physics),
        states=(core.rules or Rules.of_scene(core.engine.scene)).initial,
        key=np.asarray(jax.random.key_data(jax.random.key(seed)))[None],
        step=nothing,
        time=np.zeros(1, np.float32),
    )
    return Batch(
        world=world,
        controllers=core.controls.first(),
        grasps=core.hands.read(physics),
        number=nothing,
        seed=np.asarray(seed, np.int32),
        episode=nothing,
        flags=nothing,
        troubles=np.zeros((1, len(Flag)), np.int32),
    )


def everything(simulation: Simulation) -> SavedWorld:
    """What is to be saved of a simulation."""
    batch, world = simulation._batch, simulation.world
    return SavedWorld(
        physics=jax.tree.map(lambda leaf: np.asarray(leaf)[None], simulation.engine.export(simulation.physics, 0)),
        states=world.states,
        key=np.asarray(world.key)[0],
        step=np.asarray(world.step, int),
        controllers=batch.controllers,
        held=batch.grasps,
    )


def save_world(world: SavedWorld, file: str | os.PathLike, scene: Scene, engine: str) -> None:
    """Writes a world of the scene; `engine`: name of what stepped it, for people. Raises InputError."""
    header: dict[str, Any] = {
        "version": VERSION,
        "scene": scene.name,
        "engine": engine,
        "objects": list(scene.object_names),
        **plugin_header(world.states),
    }
    save_tree(file, jax.tree.map(np.asarray, world), header)


def load_world(file: str | os.PathLike, like: SavedWorld, scene: Scene, initial: ExtendedStates) -> SavedWorld:
    """Reads a world of the scene.

    Args:
      like: any world of it, for the shapes. initial: its first states, for those of plug-ins that the file lacks.

    Raises:
      InputError: the file is missing, broken, of another scene, or of another version; or it holds numbers that no
        world can have, or states of plug-ins that are not there.
    """
    header = read_header(file)
    if header.get("version") != VERSION:
        raise InputError(file, f"has version {header.get('version')}, this ig2mj reads {VERSION}")
    if header.get("objects") != list(scene.object_names):
        raise InputError(file, f"is of scene '{header.get('scene')}'", fix="restore it in that scene")
    refuse_foreign(header, like.states, file)
    found, _ = load_exactly(file, jax.tree.map(np.asarray, like), defaults=plugin_defaults(initial, 1))
    check_values(found.physics, found.states, file)
    trees = {f"physics.{part}.tree_asleep": getattr(found.physics, part).tree_asleep for part in ("scene", "agents")}
    bodies = {f"states.{name}.body": getattr(found.states, name).body for name in ("dust", "stain")}
    counts = {name: int(scene.model.ntree) for name in trees} | {name: int(scene.model.nbody) for name in bodies}
    check_numbers({name: np.asarray(array) for name, array in (trees | bodies).items()}, counts, file)
    if found.step[0] < 0:
        raise InputError(file, f"is {found.step[0]}, and a clock begins at 0", element="step")
    return found


def put_world(simulation: Simulation, found: SavedWorld) -> PhysicsView:
    """The simulation's world becomes another one of its scene; its view."""
    simulation.physics = simulation.engine.load(simulation.physics, found.physics)
    simulation._put(
        states=jax.tree.map(jnp.asarray, found.states),
        key=np.asarray(found.key)[None],
        step=np.asarray(found.step, np.int32),
        controllers=found.controllers,
        grasps=found.held,
    )
    return simulation.view
