"""One story of a household, told through each face of the core on any engine.

`tell(make_face(...), story)` gives what is seen after each step. A story is a list of calls of `Face`; ("step", n)
takes n steps.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Sequence
from typing import Any, Protocol

import jax
import numpy as np

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.engine.registry import make_engine
from ig2mj.sampling.setters import set_by_name
from ig2mj.worlds import Batch, Core, DebugWorlds, Rules, ShardedWorlds, Shards, Worlds

GOAL = "(and (toggled_on stove) (sliced apple))"


class Face(Protocol):
    """What the story needs of a face. `seen`: view and states of world 0, and the goal's status, now."""

    def set(self, name: str, target: str, value: bool) -> None: ...
    def put(self, name: str, pos: tuple[float, float, float]) -> None: ...
    def step(self) -> None: ...
    def reset(self) -> None: ...
    def save(self, name: str) -> None: ...
    def restore(self, name: str) -> None: ...
    def seen(self) -> dict[str, np.ndarray]: ...


class OfOneWorld:
    """`Simulation`; the goal is asked of it as a core without names would."""

    def __init__(self, scene: ig2mj.Scene, engine: str, folder: pathlib.Path):
        self.world, self.folder = ig2mj.Simulation(scene, engine), folder

    def set(self, name, target, value):
        self.world.set_state(name, target, value)

    def put(self, name, pos):
        self.world.set_object_pose(name, pos)

    def step(self):
        self.world.step()

    def reset(self):
        self.world.reset()

    def save(self, name):
        self.world.save(self.folder / f"{name}.npz")

    def restore(self, name):
        self.world.load(self.folder / f"{name}.npz")

    def seen(self):
        return _seen(self.world.view, self.world.states)


class OfABatch:
    """`Worlds`; the other faces of batches step and reset in their own way. World 1 does what world 0 does."""

    def __init__(self, worlds: Worlds | DebugWorlds):
        self.core, self.face, self.kept = worlds.core, worlds, {}
        self.batch = self.face.start(seed=3)
        self.status: Any = None

    def set(self, name, target, value):
        world, rules = self.batch.world, self.core.rules
        key = jax.random.key(0)
        states = set_by_name(rules.model, world.states, world.view, name, target, value, key).states
        self.batch = dataclasses.replace(self.batch, world=dataclasses.replace(world, states=states))

    def put(self, name, pos):
        view, index = self.batch.world.view, self.core.engine.tables.object_names.index(name)
        at, to = np.array(view.object_pos, np.float64), np.array(view.object_quat, np.float64)
        to /= np.linalg.norm(to, axis=-1, keepdims=True)
        mask = np.zeros(at.shape[:2], bool)
        mask[:, index], at[:, index] = True, pos
        self.batch = self.core.write(self.batch, Write(object_mask=mask, object_pos=at, object_quat=to))

    def step(self):
        self.batch, self.status = self.face.step(self.batch)

    def reset(self):
        self.batch = self.face.reset(self.batch, np.ones(self.core.engine.num_worlds, bool))

    def save(self, name):
        world = self.batch.world
        self.kept[name] = jax.tree.map(np.array, (self.core.engine.snapshot(world.physics), world.states))

    def restore(self, name):
        self.batch = self.core.load(self.batch, *self.kept[name])

    def seen(self):
        world = self.batch.world
        for leaf in jax.tree.leaves((world.states, world.view)):
            np.testing.assert_array_equal(np.asarray(leaf)[0], np.asarray(leaf)[-1], "worlds of a batch")
        return _seen(world.view, world.states)


class OnADevice:
    """`ShardedWorlds` on one device, made to look like `Worlds`."""

    def __init__(self, make):
        self.shards = ShardedWorlds(make, 2, jax.devices()[:1])
        self.core = self.shards.local

    def start(self, seed: int) -> Batch:
        return self.shards.start(seed).parts[0]

    def step(self, batch: Batch):
        shards, status = self.shards.step(Shards((batch,)))
        return shards.parts[0], status

    def reset(self, batch: Batch, mask):
        return self.shards.reset(Shards((batch,)), mask).parts[0]


def _seen(view, states) -> dict[str, np.ndarray]:
    leaves = jax.tree_util.tree_flatten_with_path(states)[0]
    found = {jax.tree_util.keystr(path, simple=True, separator="."): np.asarray(leaf)[0] for path, leaf in leaves}
    return found | {"object_pos": np.asarray(view.object_pos)[0], "touching": np.asarray(view.touching)[0]}


def tell(face: Face, story: Sequence[tuple]) -> list[dict[str, np.ndarray]]:
    """What is seen at the start, after each step, and after each reset and restoration."""
    seen = [face.seen()]
    for verb, *rest in story:
        for _ in range(rest[0] if verb == "step" else 1):
            getattr(face, verb)(*([] if verb == "step" else rest))
            if verb in ("step", "reset", "restore"):
                seen.append(face.seen())
    return seen


def make_face(kind: str, scene: ig2mj.Scene, engine: str, folder: pathlib.Path) -> Face:
    def core(count: int) -> Core:
        return Core(make_engine(engine, scene, count), Rules.of_scene(scene).with_goal(GOAL))

    if kind == "simulation":
        return OfOneWorld(scene, engine, folder)
    if kind == "worlds":
        return OfABatch(Worlds(scene, 2, engine, goal=GOAL))
    return OfABatch(DebugWorlds(core(2), scene, folder) if kind == "debug" else OnADevice(core))
