"""`Core`: episodes, resets from a pool, random streams, guards."""

from __future__ import annotations

import dataclasses
import re

import engine_bench
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.engine.base import Write
from ig2mj.engine.health import Overflow
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.sleep import FULLY_AWAKE
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.profile import EngineProfile
from ig2mj.errors import EngineError
from ig2mj.predicates.compile import compile_expression
from ig2mj.simulation import Simulation
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.viewer.replay import Replay
from ig2mj.worlds import guards
from ig2mj.worlds.core import Core
from ig2mj.worlds.debug import DebugWorlds
from ig2mj.worlds.guards import Flag
from ig2mj.worlds.random_streams import episode_keys, pick_rows, step_keys
from ig2mj.worlds.rules import Rules


@pytest.fixture(scope="module")
def scene(bench_folder):
    return engine_bench.bench_home(bench_folder, True)


@pytest.fixture(scope="module")
def model(scene) -> StateModel:
    return StateModel.of_manifest(scene.tables, scene.manifest)


def native(scene, model, count: int, pool=None, goal=None, initial=None) -> Core:
    return Core(NativeEngine(scene, count, threads=1), Rules(model, goal, initial), pool)


def box_x(batch, scene) -> np.ndarray:
    return np.asarray(batch.world.view.object_pos)[:, scene.object_index("box"), 0]


def teleport(worlds: Core, batch, name: str, pos, world: int):
    """Puts an object somewhere in one world."""
    engine = worlds.engine
    tables = engine.tables
    mask = np.zeros((engine.num_worlds, tables.num_objects), bool)
    at, turn = np.zeros((*mask.shape, 3), np.float32), np.zeros((*mask.shape, 4), np.float32)
    index = tables.object_names.index(name)
    mask[world, index], at[world, index], turn[..., 0] = True, pos, 1
    write = jax.jit(engine.write) if engine.pure else engine.write
    physics = write(batch.world.physics, Write(object_mask=mask, object_pos=at, object_quat=turn))
    return dataclasses.replace(batch, world=dataclasses.replace(batch.world, physics=physics))


# Random streams.


def test_streams_belong_to_seed_world_and_episode():
    world = jnp.arange(5)
    few = np.asarray(episode_keys(3, world[:2], jnp.zeros(2, jnp.int32)))
    many = np.asarray(episode_keys(3, world, jnp.zeros(5, jnp.int32)))
    np.testing.assert_array_equal(few, many[:2])
    assert len(np.unique(many, axis=0)) == 5
    assert (many != np.asarray(episode_keys(3, world, jnp.ones(5, jnp.int32)))).any(1).all()
    assert (many != np.asarray(episode_keys(4, world, jnp.zeros(5, jnp.int32)))).any(1).all()
    steps = np.asarray(step_keys(jnp.asarray(many), jnp.arange(5)))
    assert len(np.unique(np.concatenate([steps, many]), axis=0)) == 10


def test_rows_are_picked_evenly():
    key = episode_keys(0, jnp.arange(3000), jnp.zeros(3000, jnp.int32))
    counts = np.bincount(np.asarray(pick_rows(key, 3)), minlength=3)
    assert len(counts) == 3 and (np.abs(counts - 1000) < 100).all()


# Episodes, natively.


def test_an_episode_begins_with_a_row_of_the_pool(scene, model, bench_pool):
    batch = native(scene, model, 8, bench_pool).start(seed=1)
    row = np.round(10 * box_x(batch, scene)).astype(int)
    assert 10 * box_x(batch, scene) == pytest.approx(row, abs=0.05)
    assert set(row.tolist()) <= {-1, 0, 1} and len(set(row.tolist())) > 1
    assert not np.asarray(batch.world.view.awake).any(), "settled states are asleep"
    assert np.asarray(batch.world.step).tolist() == [0] * 8 and np.asarray(batch.episode).tolist() == [0] * 8


def test_world_0_is_the_same_among_two_and_among_five(scene, model, bench_pool):
    runs = []
    for count in (2, 5):
        worlds = native(scene, model, count, bench_pool)
        batch = teleport(worlds, worlds.start(seed=7), "knife", [0.02, 0, 0.7], 0)
        for _ in range(15):
            batch, _ = worlds.step(batch)
        batch = worlds.reset(batch, jnp.asarray(np.arange(count) == 0))
        runs.append([np.asarray(leaf)[0] for leaf in jax.tree.leaves((batch.world.view, batch.world.states))])
        runs[-1].append(np.asarray(batch.world.key)[0])
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one, other)


def test_reset_touches_the_masked_worlds_only(scene, model, bench_pool):
    worlds = native(scene, model, 3, bench_pool)
    batch = worlds.start(seed=2)
    for world in range(3):
        batch = teleport(worlds, batch, "box", [0.0, 0.2, 0.46], world)
    warm = dataclasses.replace(batch.world.states, temperature=batch.world.states.temperature + 50)
    batch = dataclasses.replace(batch, world=dataclasses.replace(batch.world, states=warm))
    for _ in range(3):
        batch, _ = worlds.step(batch)
    batch = worlds.reset(batch, jnp.array([False, True, False]))
    assert np.asarray(batch.episode).tolist() == [0, 1, 0]
    assert np.asarray(batch.world.step).tolist() == [3, 0, 3]
    assert np.asarray(batch.world.time) == pytest.approx([0.1, 0.0, 0.1])
    y = np.asarray(batch.world.view.object_pos)[:, scene.object_index("box"), 1]
    assert y == pytest.approx([0.2, 0.0, 0.2], abs=1e-3)
    heat = np.asarray(batch.world.states.temperature)[:, scene.object_index("box")]
    assert heat[1] == pytest.approx(23.0) and (heat[[0, 2]] > 60).all()


def test_without_a_pool_episodes_start_where_the_scene_does(scene, model):
    values = initial_states(model, 1)
    values = dataclasses.replace(values, wetness=values.wetness + 7)
    worlds = native(scene, model, 2, initial=values)
    batch = worlds.start()
    assert (np.asarray(batch.world.states.wetness) == 7).all()
    assert box_x(batch, scene) == pytest.approx(0.0)


def test_the_goal_is_evaluated_after_the_step(scene, model, bench_pool):
    goal = compile_expression(model, "(and (on_top box table) (on_top knife box))")
    worlds = native(scene, model, 2, bench_pool, goal=goal)
    batch = worlds.start()
    place = np.asarray(batch.world.view.object_pos)[1, scene.object_index("box")]
    batch = teleport(worlds, batch, "knife", place + np.array([0, 0, 0.0705]), 1)
    for _ in range(20):
        batch, status = worlds.step(batch)
    assert np.asarray(status.holds).tolist() == [False, True]
    assert np.asarray(status.fraction) == pytest.approx([0.5, 1.0])


# Guards.


def test_an_object_below_the_floor_is_flagged_once_and_put_right(scene, model, bench_pool):
    worlds = native(scene, model, 3, bench_pool)
    batch = teleport(worlds, worlds.start(), "box", [0, 0, -2.0], 1)
    for _ in range(2):
        batch, _ = worlds.step(batch)
    assert np.asarray(batch.flags).tolist() == [0, int(Flag.FELL), 0]
    assert worlds.metrics(batch) == {
        "episodes": 3,
        "overflow": 0,
        "not_finite": 0,
        "fell": 1,
        "too_fast": 0,
        "wrong_controls": 0,
    }
    with pytest.raises(EngineError, match=r"^world 1: fell$"):
        worlds.raise_flagged(batch)
    batch = worlds.reset(batch, batch.flags != 0)
    assert not np.asarray(batch.flags).any()
    assert worlds.metrics(batch) == {
        "episodes": 4,
        "overflow": 0,
        "not_finite": 0,
        "fell": 1,
        "too_fast": 0,
        "wrong_controls": 0,
    }
    batch, _ = worlds.step(batch)
    assert not np.asarray(batch.flags).any()


def test_an_object_shot_away_is_too_fast(scene, model):
    worlds = native(scene, model, 2)
    batch = worlds.start()
    rows = worlds.engine.snapshot(batch.world.physics)
    qvel = np.array(rows.qvel)
    qvel[0, 2] = 25.0
    physics = worlds.engine.load(batch.world.physics, rows.with_whole(qvel=qvel))
    batch = dataclasses.replace(batch, world=dataclasses.replace(batch.world, physics=physics))
    batch, _ = worlds.step(batch)
    assert np.asarray(batch.flags).tolist() == [int(Flag.TOO_FAST), 0]


def test_fixed_furniture_and_parked_halves_are_where_they_belong(tiny_home, home_model):
    worlds = native(tiny_home, home_model, 1)
    batch = worlds.start()
    batch, _ = worlds.step(batch)
    assert not np.asarray(batch.flags).any()


def test_what_is_lost_names_the_setting_to_raise():
    overflow = int(Overflow.NVMAX | Overflow.CCD | Overflow.ITERATIONS)
    text = guards.explain(12, int(Flag.OVERFLOW), overflow)
    assert text.startswith("world 12: overflow (CCD, NVMAX; raise awake_dofs, convex_contacts in engine_profile.json")
    assert "ig2mj calibrate" in text and "ITERATIONS" not in text


# Warp.


@pytest.fixture(scope="module")
def warp_worlds(scene, model, bench_pool) -> Core:
    goal = compile_expression(model, "(on_top box table)")
    return Core(WarpEngine(scene, 2), Rules(model, goal), bench_pool)


@pytest.mark.slow
def test_reset_inside_scan_with_autoreset(warp_worlds, scene):
    """A step and its resets are pure functions that `lax.scan` runs; world 1 falls again and again."""

    def body(batch, _):
        batch, status = warp_worlds.step_fn(batch)
        flagged = batch.flags != 0
        batch = warp_worlds.reset_fn(batch, flagged | (batch.world.step >= 5))
        return batch, (flagged, batch.world.step, status.holds)

    batch = teleport(warp_worlds, warp_worlds.start(seed=3), "box", [0, 0, -2.0], 1)
    batch, (flagged, steps, holds) = jax.jit(lambda b: jax.lax.scan(body, b, length=12))(batch)
    assert np.asarray(flagged).T.tolist() == [[False] * 12, [True] + [False] * 11]
    assert np.asarray(steps)[:, 0].tolist() == [1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2]
    assert np.asarray(steps)[:, 1].tolist() == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1]
    assert np.asarray(holds)[:, 0].all() and np.asarray(holds)[1:, 1].all() and not holds[0, 1]
    assert np.asarray(batch.episode).tolist() == [2, 3]
    assert warp_worlds.metrics(batch)["fell"] == 1


@pytest.mark.slow
def test_a_state_that_is_not_finite_is_flagged_in_its_world(warp_worlds):
    batch = warp_worlds.start()
    rows = warp_worlds.engine.snapshot(batch.world.physics)
    rows = jax.tree.map(np.array, rows)
    rows.qvel[1, 0], rows.tree_asleep[1] = np.nan, -11
    physics = jax.jit(warp_worlds.engine.load)(batch.world.physics, rows)
    batch = dataclasses.replace(batch, world=dataclasses.replace(batch.world, physics=physics))
    batch, _ = warp_worlds.step(batch)
    assert np.asarray(batch.flags).tolist() == [0, int(Flag.NOT_FINITE)]
    batch = warp_worlds.reset(batch, batch.flags != 0)
    batch, _ = warp_worlds.step(batch)
    assert not np.asarray(batch.flags).any(), "the pool's row replaces all that was not a number"


@pytest.fixture(scope="module")
def overflowing(scene, model, bench_pool, tmp_path_factory) -> DebugWorlds:
    """Two worlds under watch; one contact has no room for its constraint rows where the box has four corners."""
    tiny = EngineProfile(awake_dofs=12, constraints=4, contacts=16, convex_contacts=16)
    row = jax.tree.map(lambda a: np.array(a[1]), bench_pool.physics)
    row.qpos[scene.model.joint("box/free").qposadr[0] + 2] = 0.4495
    row.tree_asleep[:] = FULLY_AWAKE
    engine = WarpEngine(scene, 2, profile=tiny, initial=row)
    return DebugWorlds(Core(engine, Rules(model)), scene, tmp_path_factory.mktemp("dumps"))


@pytest.mark.slow
def test_buffers_that_are_too_small_are_an_error_with_a_dump(overflowing, scene):
    """World, flag, value, the setting to raise, and the last 50 steps to look at."""
    with pytest.raises(EngineError) as caught:
        overflowing.step(overflowing.start())
    said = re.fullmatch(
        r"world 0: overflow \(NEFC; raise constraints in engine_profile.json, or run `ig2mj calibrate`\): "
        r"last physics step: 12 of 12 awake_dofs, (\d+) of 4 constraints, \d+ of 32 contacts of all worlds, "
        r"\d+ of 32 convex_contacts of all worlds; step 1; the last 50 steps: ig2mj view (\S+) --dump (\S+)",
        str(caught.value),
    )
    assert said, str(caught.value)
    assert int(said[1]) > 4 and said[2] == str(scene.folder)
    replay = Replay(scene, said[3])
    assert len(replay) == 2 and replay.data.body("box").xpos[2] == pytest.approx(0.4495, abs=1e-5)


@pytest.mark.slow
def test_a_world_that_overflowed_is_put_right_by_a_reset(overflowing):
    with pytest.raises(EngineError):
        overflowing.step(overflowing.start())
    batch = overflowing.batch
    assert np.asarray(batch.flags).tolist() == [int(Flag.OVERFLOW)] * 2
    with pytest.raises(EngineError, match=r"world 0: overflow \(NEFC; raise constraints in engine_profile.json"):
        overflowing.core.raise_flagged(batch)
    batch = overflowing.reset(batch, np.array([True, False]))
    assert not np.asarray(batch.world.physics.overflow)[0] and np.asarray(batch.flags).tolist() == [0, 1]


@pytest.mark.slow
def test_a_world_of_many_goes_on_in_a_simulation(warp_worlds, scene):
    """`engine.export(world)` continued natively, states and all."""
    batch = warp_worlds.start(seed=5)
    rows = jax.tree.map(np.array, warp_worlds.engine.snapshot(batch.world.physics))
    address = scene.model.joint("box/free").qposadr[0]
    rows.qpos[1, address + 2], rows.tree_asleep[1] = 0.7, FULLY_AWAKE
    physics = jax.jit(warp_worlds.engine.load)(batch.world.physics, rows)
    hot = batch.world.states.replace(temperature=batch.world.states.temperature + 50)
    batch = dataclasses.replace(batch, world=dataclasses.replace(batch.world, physics=physics, states=hot))
    for _ in range(3):
        batch, _ = warp_worlds.step(batch)
    states = jax.tree.map(lambda a: np.asarray(a)[1:], batch.world.states)
    simulation = Simulation.from_snapshot(scene, warp_worlds.engine.export(batch.world.physics, 1), states)
    there = float(np.asarray(warp_worlds.engine.time(batch.world.physics))[1])
    assert simulation.time == pytest.approx(there, abs=1e-5) and there > 0.09
    assert simulation.state("temperature", "box") == pytest.approx(float(states.temperature[0, 1]), abs=1e-5)
    for _ in range(3):
        batch, _ = warp_worlds.step(batch)
    view = simulation.step(count=3)
    np.testing.assert_allclose(view.object_pos[0], np.asarray(batch.world.view.object_pos)[1], atol=1e-4)
    heat = float(np.asarray(batch.world.states.temperature)[1, 1])
    assert 23 < heat < 73 and simulation.state("temperature", "box") == pytest.approx(heat, abs=1e-3)
    assert simulation.predicate("on_top", "box", "table") is False
    simulation.step(count=30)
    assert simulation.predicate("on_top", "box", "table") is True
