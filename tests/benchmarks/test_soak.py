"""The soak benchmark sees what goes wrong, names it, and keeps worlds that run again natively."""

from __future__ import annotations

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import soak
import soak_replay
import soak_watch

import ig2mj
from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.sleep import FULLY_AWAKE
from ig2mj.worlds.random_streams import episode_keys

START = (0.1, 0.25, 0.9)


@pytest.fixture(scope="module")
def watch(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, [functools.partial(add_floating_hand, pos=START)])
    return soak_watch.Watch(NativeEngine(scene, 3), START)


def thrown(watch, world: int, velocity=(0.0, 0.0, 0.0), pos=None):
    """Physics with a box in one world that has this velocity (m/s), and lies somewhere else (m)."""
    engine, scene = watch.engine, watch.engine.scene
    rows = jax.tree.map(np.array, engine.snapshot(engine.reset()))
    number = scene.object_index("box")
    qpos, qvel, asleep = np.array(rows.qpos), np.array(rows.qvel), np.array(rows.tree_asleep)
    qvel[world, engine.layout.object_dofadr[number] :][:3] = velocity
    if pos is not None:
        qpos[world, engine.layout.object_qposadr[number] :][:3] = pos
    rows = rows.with_whole(qpos=qpos, qvel=qvel, tree_asleep=np.full_like(asleep, FULLY_AWAKE))
    return engine.load(engine.reset(), rows), rows


@pytest.mark.parametrize(
    ("kind", "place", "velocity"),
    [("too_fast", (0, 0, 1.5), (0, 0, 25.0)), ("outside", (30, 0, 1.0), (0, 0, 0)), ("fell", (0, 0, -9), (0, 0, 0))],
)
def test_what_goes_wrong_is_named(watch, kind, place, velocity):
    physics, _ = thrown(watch, 1, velocity, place)
    physics, view = watch.engine.step(physics)
    seen = watch.look(watch.start(physics), physics, view)
    assert (np.asarray(seen.flags) != 0).tolist() == [False, True, False]
    report = watch.report(seen, 1)
    assert report["kind"] == kind and report["object"] == "box" and report["world"] == 1
    after = watch.look(seen, physics, watch.engine.view(thrown(watch, 1)[0]))
    assert int(after.flags[1]) == int(seen.flags[1]), "what a world is first flagged for stands"
    assert not np.asarray(watch.fresh(after, physics, np.array([True] * 3)).flags).any()


def test_targets_are_anywhere_in_the_house_and_new_in_one_of_twenty_steps(watch):
    count, house = 4000, watch.house
    key = episode_keys(0, jnp.arange(count), jnp.zeros(count, jnp.int32))
    first = soak.controls(house, key, jnp.zeros(count, jnp.int32), jnp.zeros((count, 16)))
    place = np.asarray(first[:, :3]) + house.start
    assert (place >= house.low - 1e-5).all() and (place <= house.high + 1e-5).all()
    assert np.ptp(place, axis=0) == pytest.approx(house.high - house.low, rel=0.02)
    second = soak.controls(house, key, jnp.ones(count, jnp.int32), first)
    assert np.asarray((second != first).any(1)).mean() == pytest.approx(soak.NEW_TARGET, abs=0.015)


def test_a_dumped_world_runs_again_natively(watch, tmp_path):
    _, rows = thrown(watch, 2, (0, 0, 25.0), (0.0, 0.0, 1.5))
    row = jax.tree.map(lambda a: np.array(a[2]), rows)
    report = {"kind": "too_fast", "object": "box", "world": 2, "place": [0, 0, 1.5], "speed": 25.0, "touched": []}
    file = tmp_path / "world.npz"
    folder = str(watch.engine.scene.folder)
    soak_replay.Dump(folder, START, report, row, np.zeros((5, 16))).save(file)
    steps = soak_replay.replay(file)
    assert [round(s["speed"]) for s in steps] == [25, 24, 24, 24, 23]
    assert steps[-1]["place"][2] == pytest.approx(1.5 + 25 * 5 / 30 - 0.5 * 9.8 * (5 / 30) ** 2, abs=0.1)
