"""The soak benchmark sees what goes wrong, names it, and keeps worlds that run again natively."""

from __future__ import annotations

import dataclasses
import functools
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from benchmarks.harness.homes import shipped_homes
from benchmarks.soak import energy as soak_energy
from benchmarks.soak import replay as soak_replay
from benchmarks.soak import soak
from benchmarks.soak import watch as soak_watch
from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.sleep import FULLY_AWAKE
from ig2mj.worlds.random_streams import episode_keys

START = (0.1, 0.25, 0.9)


@pytest.mark.slow
def test_homes_that_ship_are_soaked_without_the_converter():
    """A GPU host has neither it nor what it reads files with."""
    said = "import sys, benchmarks.soak.homes; print([m for m in sys.modules if m.startswith('ig2mj_converters')])"
    done = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_home_has_the_same_robots_and_grasps_whatever_homes_are_run():
    from benchmarks.soak.homes import cells

    names = [home.name for home in shipped_homes()]
    assert cells(names[-1:]) == [cell for cell in cells(names) if cell.home == names[-1]]


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
    [
        ("too_fast", (0, 0, 1.5), (0, 0, 25.0)),
        ("outside", (30, 0, 1.0), (0, 0, 0)),
        ("outside", (2.6, 0, 4.0), (0, 0, 0)),
        ("fell", (0, 0, -9), (0, 0, 0)),
    ],
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


def test_what_is_above_the_floors_is_not_lost_and_what_comes_down_beside_them_is(watch):
    physics, _ = thrown(watch, 1, (0.0, 0.0, 2.0), (1.5, 0, 4.0))
    seen, lost_at = watch.start(physics), {}
    for world, sideways in ((0, 0.0), (1, 6.0)):
        physics, _ = thrown(watch, world, (sideways, 0.0, 2.0), (1.5, 0, 4.0))
        for _ in range(60):
            physics, view = watch.engine.step(physics)
            seen = watch.look(seen, physics, view)
            if int(seen.flags[world]):
                lost_at.setdefault(world, np.asarray(view.object_com)[world, watch.engine.scene.object_index("box")])
    assert list(lost_at) == [1] and watch.report(seen, 1)["kind"] == "outside"
    assert lost_at[1][0] > 2.0 + soak_watch.BEYOND and lost_at[1][2] > 0


def test_lost_is_beside_every_floor_or_below_the_lowest():
    rooms = [[[0, 0, -1.0], [4, 2, 0.0]], [[0, 2, -1.0], [2, 4, 0.0]], [[0, 0, 2.8], [2, 2, 3.0]]]  # an L, and upstairs
    house = soak_watch.House(np.zeros(3), np.array([4, 4, 6.0]), np.zeros(3), np.array(rooms, float))
    inside = [(1, 1, 9.0), (3.9, 1, 3.2), (1, 3.9, 1.0), (4.4, 1, 1.0), (2.4, 3.9, 1.0), (1, 1, -0.4)]
    outside = [(3.9, 3.9, 1.0), (3.9, 3.9, 9.0), (4.6, 1, 9.0), (1, -0.6, 0.1), (1, 1, -0.6)]
    assert (np.asarray(house.lost(np.array(inside))) < 0).all()
    assert (np.asarray(house.lost(np.array(outside))) > 0).all()


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
    _, rows = thrown(watch, 2, (0, 0, 5.0), (0.0, 0.0, 0.5))  # up to 1.2 m, below the ceiling
    row = jax.tree.map(lambda a: np.array(a[2]), rows)
    report = {"kind": "too_fast", "object": "box", "world": 2, "place": [0, 0, 0.5], "speed": 5.0, "touched": []}
    file = tmp_path / "world.npz"
    folder = str(watch.engine.scene.folder)
    soak_replay.Dump(folder, START, report, row, np.zeros((5, 16))).save(file)
    steps = soak_replay.replay(file)
    assert [s["speed"] for s in steps] == pytest.approx([5 - 9.8 * k / 30 for k in range(1, 6)], abs=0.05)
    assert steps[-1]["place"][2] == pytest.approx(0.5 + 5 * 5 / 30 - 0.5 * 9.8 * (5 / 30) ** 2, abs=0.03)


@pytest.mark.slow
def test_energy_of_a_thrown_box_is_seen_and_what_no_servo_can_have_given_is_counted(watch):
    energy = soak_energy.EnergyWatch(watch.engine, watch.loose, episode=40)
    number, worlds = watch.engine.scene.object_index("box"), watch.engine.num_worlds
    mass = float(watch.tables.object_mass[number])
    never = np.full((worlds, watch.tables.num_objects), soak_watch.NEVER)
    used = np.broadcast_to(watch.loose, never.shape)
    sound, uncut = np.ones(worlds, bool), np.zeros(worlds, bool)

    def look(seen, velocity, since, step):
        physics, _ = thrown(watch, 1, velocity, (0, 0, 1.5))
        view = watch.engine.view(physics)
        return energy.look(seen, physics, view, never, since, sound, used, uncut, np.full(worlds, step))

    seen = look(energy.start(), (0, 0, 0), never, 1)
    assert int(seen.steps) == 0, "there is nothing to compare the first step with"
    held = never.copy()
    held[1, number] = 0
    seen = look(seen, (0, 0, 3.0), held, 39)
    report = energy.report(seen)
    taken = report["largest_kinetic_energy_J"]["taken in this step"]
    assert taken["most_of"] == "box" and taken["most"] == pytest.approx(0.5 * mass * 9, rel=1e-3)
    assert [q is None for q in taken["p99_by_quarter"]] == [True, True, True, False]
    assert report["largest_rise_of"] == "box" and report["rose_beyond_servos_work"]["0 J"] == 1
    assert report["control_steps_compared"] == worlds


def test_who_held_what_went_wrong_is_named(watch):
    physics, _ = thrown(watch, 1)
    number = watch.engine.scene.object_index("box")
    view = watch.engine.view(physics)
    held = np.array(view.held)
    assert held.shape[1] == 1
    held[1, 0, number] = True
    seen = watch.look(watch.start(physics), physics, dataclasses.replace(view, held=held))
    physics, _ = thrown(watch, 1, (0, 0, 25.0), (0, 0, 1.5))
    physics, view = watch.engine.step(physics)
    seen = watch.look(seen, physics, view)
    report = watch.report(seen, 1)
    assert report["held_by"] == watch.model.body(int(watch.tables.hand_body[0])).name
    assert report["free_for"] == 1 and report["kind"] == "too_fast"
