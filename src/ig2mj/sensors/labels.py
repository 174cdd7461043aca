"""Numbers of classes and instances in segmentations.

| class | what |
|--:|---|
| 0 | nothing |
| 1 | robots |
| 3 | what has no known category |
| 4 and on | the taxonomy's categories in alphabetical order: the same in every home |
| 507 to 511 | dust, stains, water drops, other substances, fire |

| instance | what |
|--:|---|
| 0 | nothing, water drops, streams, the world's own geoms |
| 1 and on | objects in the scene's order, with what covers them, what they contain, and flames; then agents |
"""

from __future__ import annotations

import functools

import jax.numpy as jnp
import numpy as np
from jaxtyping import Int

from ig2mj.engine.view import Array
from ig2mj.knowledge.taxonomy import categories
from ig2mj.looks import visual_of
from ig2mj.scene.scene import PLAIN, Scene
from ig2mj.sensors.slots import Slots

NUM_CLASSES, NUM_INSTANCES = 512, 1024
BACKGROUND, ROBOT, OTHER, FIRST_CATEGORY = 0, 1, 3, 4
SLOTS = (507, 508, 509, 510, 511)
"""Of dust, stains, water, substances and fire, in the order of kinds in `ig2mj.sensors.slots`."""


@functools.cache
def class_of_category() -> dict[str, int]:
    """Class of every category of the taxonomy."""
    return {name: FIRST_CATEGORY + k for k, name in enumerate(sorted(categories()))}


def class_names() -> dict[int, str]:
    """What every class is called."""
    named = {number: name for name, number in class_of_category().items()}
    return {BACKGROUND: "nothing", ROBOT: "robot", OTHER: "other", **named} | dict(
        zip(SLOTS, ("dust", "stain", "water", "substance", "fire"), strict=True)
    )


def classes_of_geoms(scene: Scene, looks: str = PLAIN) -> Int[np.ndarray, "G"]:
    """Class of every geom of the scene, and of those that its looks add."""
    tables = scene.tables
    known = class_of_category()
    of_objects = np.array([known.get(c, OTHER) for c in tables.object_categories], np.int32)
    return _of_geoms(scene, looks, of_objects, lambda agent: ROBOT, OTHER)


def instances_of_geoms(scene: Scene, looks: str = PLAIN) -> Int[np.ndarray, "G"]:
    """Instance of every geom of the scene, and of those that its looks add."""
    count = scene.tables.num_objects
    return _of_geoms(scene, looks, np.arange(1, count + 1, dtype=np.int32), lambda agent: count + 1 + agent, BACKGROUND)


def _of_geoms(scene: Scene, looks: str, of_objects: np.ndarray, of_agent, other: int) -> Int[np.ndarray, "G"]:
    owner, agent = visual_of(scene, looks).owner, scene.tables.body_agent[scene.model.geom_bodyid]
    agent = np.pad(agent, (0, len(owner) - len(agent)), constant_values=-1)
    found = np.full(len(owner), other, np.int32)
    found[owner >= 0] = of_objects[owner[owner >= 0]]
    found[agent >= 0] = [of_agent(int(a)) for a in agent[agent >= 0]]
    return found


def looked_up(
    geom: Int[Array, "W Y X"],
    of_geoms: Int[np.ndarray, "G"],
    of_slots: Int[Array, "W S"],
    nothing: int,
) -> Int[Array, "W Y X"]:
    """Values of the geoms that are seen: of the scene's own, of slots behind them, and where nothing is seen."""
    geom, count = jnp.asarray(geom), len(of_geoms)
    value = jnp.asarray(of_geoms, jnp.int32)[jnp.clip(geom, 0, count - 1)]
    if of_slots.shape[1]:
        slot = jnp.clip(geom - count, 0, of_slots.shape[1] - 1).reshape(len(geom), -1)
        of_particles = jnp.take_along_axis(jnp.asarray(of_slots), slot, axis=1).reshape(geom.shape)
        value = jnp.where(geom >= count, of_particles, value)
    return jnp.where(geom >= 0, value, nothing)


def classes_of_slots(slots: Slots) -> Int[Array, "W S"]:
    """Class of everything that is drawn in slots."""
    return jnp.asarray(SLOTS, jnp.int32)[jnp.clip(jnp.asarray(slots.kind), 0)]


def instances_of_slots(slots: Slots) -> Int[Array, "W S"]:
    """Instance of what everything in slots belongs to."""
    return jnp.asarray(slots.owner) + 1
