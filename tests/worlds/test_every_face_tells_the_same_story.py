"""One core behind every face and engine: one story, told through each, gives the same states after each step.

A stove and a tap are switched on, an apple is heated, a sponge soaked, the apple cut; then everything is reset, and
the moment before the cut restored.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any, Protocol

import jax
import numpy as np
import pytest
from tiny_home import home_manifest, scene_xml

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.engine.registry import make_engine
from ig2mj.sampling.setters import set_by_name
from ig2mj.scene import manifest as mf
from ig2mj.worlds import Batch, Core, DebugWorlds, Rules, ShardedWorlds, Shards, Worlds

GOAL = "(and (toggled_on stove) (sliced apple))"
BEFORE_THE_CUT = "before the cut"
STORY: list[tuple] = [
    ("step", 2),
    ("set", "toggled_on", "stove", True),
    ("set", "toggled_on", "sink", True),
    ("put", "apple", (0.0, 1.6, 0.861)),
    ("put", "box", (-1.6, 0.0, 0.751)),  # holds the sponge above where the sink takes drops
    ("put", "sponge", (-1.6, 0.0, 0.823)),
    ("step", 28),
    ("save", BEFORE_THE_CUT),
    ("put", "knife", (-0.06, 1.6, 0.904)),
    ("step", 4),
    ("reset",),
    ("step", 2),
    ("restore", BEFORE_THE_CUT),
    ("put", "knife", (-0.06, 1.6, 0.904)),
    ("step", 4),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    """The tiny home, with states to start with, and an apple that any touch of the blade cuts."""
    home = tmp_path_factory.mktemp("story") / "home"
    home.mkdir()
    (home / "scene.xml").write_text(scene_xml())
    manifest = home_manifest()
    objects = {entry.name: entry for entry in manifest.objects}
    objects["apple"].abilities["sliceable"] = {"slice_force": 0.01}
    objects["apple"].state.update(temperature=40.0, max_temperature=60.0)
    objects["sponge"].state.update(wetness=1.0)
    mf.save_manifest(manifest, home / "manifest.json")
    return home


@pytest.fixture(scope="module")
def scene(folder) -> ig2mj.Scene:
    return ig2mj.load_scene(folder)


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
        self.world.restore(self.folder / f"{name}.npz")

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


def tell(face: Face) -> list[dict[str, np.ndarray]]:
    """What is seen at the start, after each step, and after each reset and restoration."""
    seen = [face.seen()]
    for verb, *rest in STORY:
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


@pytest.fixture(scope="module")
def told(scene, tmp_path_factory) -> list[dict[str, np.ndarray]]:
    """By a native batch."""
    face = make_face("worlds", scene, "native", tmp_path_factory.mktemp("worlds"))
    seen = tell(face)
    assert face.status.holds.tolist() == [True, True] and face.status.literals.shape == (2, 2)
    return seen


def test_the_story_is_about_something(told, scene):
    """What each event is meant to do, it does: else the faces would agree on nothing."""
    at = {name: scene.object_index(name) for name in scene.object_names}
    start, cooked, cut, fresh, again = told[0], told[30], told[31], told[35], told[-4]
    assert start["temperature"][at["apple"]] == 40.0 and start["wetness"][at["sponge"]] == 1.0, "from the manifest"
    assert cooked["temperature"][at["apple"]] > 45.0 and cooked["wetness"][at["sponge"]] > 1.0
    assert not cooked["sliced"].any() and cut["sliced"][at["apple"]]
    place = cooked["object_pos"][at["apple"]]
    for half in ("apple_half_0", "apple_half_1"):
        assert np.abs(cut["object_pos"][at[half]] - place).max() < 0.03, "the view shows the halves at once"
        assert cut["temperature"][at[half]] > 45.0
    for name, array in start.items():
        np.testing.assert_array_equal(fresh[name], array, f"{name} after a reset")
    for name, array in cut.items():
        np.testing.assert_array_equal(again[name], array, f"{name} after the cut, told again")


@pytest.mark.parametrize("kind", ["simulation", "debug"])
def test_native_faces_agree_to_the_last_bit(told, scene, tmp_path, kind):
    for moment, (ours, theirs) in enumerate(zip(tell(make_face(kind, scene, "native", tmp_path)), told, strict=True)):
        for name, array in theirs.items():
            np.testing.assert_array_equal(ours[name], array, f"{name} at moment {moment}")


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("kind", ["worlds", "simulation", "debug", "sharded"])
def test_engines_agree(told, scene, tmp_path, kind):
    """Physics differs by rounding; switches, cuts and droplets do not, and temperatures follow.

    Not told by MJX in JAX, whose code above the physics step is the same: it has no contact of a cylinder with a box,
    and without the cylinder its program of this home was not compiled after a quarter of an hour.
    """
    for moment, (ours, theirs) in enumerate(zip(tell(make_face(kind, scene, "warp", tmp_path)), told, strict=True)):
        for name in ("toggled_on", "sliced", "wetness", "press_count"):
            np.testing.assert_array_equal(ours[name], theirs[name], f"{name} at moment {moment}")
        for name in ("temperature", "max_temperature"):
            np.testing.assert_allclose(ours[name], theirs[name], atol=1e-2, err_msg=f"{name} at moment {moment}")
        np.testing.assert_allclose(ours["object_pos"], theirs["object_pos"], atol=2e-2, err_msg=f"moment {moment}")
