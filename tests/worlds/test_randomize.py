"""Physics that differs between episodes: drawn from the episode's key, kept by snapshots, the same on all engines."""

from __future__ import annotations

import dataclasses

import engine_bench
import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.model_fields import given
from ig2mj.engine.registry import make_engine
from ig2mj.envs.config import EnvConfig
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.states.model import StateModel
from ig2mj.worlds.core import Core
from ig2mj.worlds.random_streams import episode_keys
from ig2mj.worlds.randomization import VARIANTS, Randomization
from ig2mj.worlds.randomize import Physics, Randomize
from ig2mj.worlds.rules import Rules

WORLDS = 3
PHYSICS = Randomize(physics=Physics(mass=(0.5, 2.0), friction=(0.5, 1.5), damping=(0.5, 2.0)))


@pytest.fixture(scope="module")
def scene(bench_folder):
    return engine_bench.bench_home(bench_folder, False)


def made(scene, name: str = "native", randomize: Randomize | None = PHYSICS, worlds: int = WORLDS) -> Core:
    fields = () if randomize is None else randomize.model_fields
    rules = Rules(StateModel.of_manifest(scene.tables, scene.manifest))
    return Core(make_engine(name, scene, worlds, model_fields=fields), rules, randomize=randomize)


@pytest.fixture(scope="module")
def core(scene) -> Core:
    return made(scene)


def fields_of(core: Core, batch) -> dict[str, np.ndarray]:
    snapshot = core.engine.snapshot(batch.world.physics)
    return {name: np.asarray(array) for name, array in given(snapshot.model_fields).items()}


def test_every_world_and_episode_has_physics_of_its_own_that_follows_from_seed_and_number(core, scene):
    first = fields_of(core, core.start(5))
    assert first["body_mass"].shape == (WORLDS, scene.model.nbody)
    for name in ("body_mass", "geom_friction"):
        assert not np.allclose(first[name][0], first[name][1]), name
    again, other = fields_of(core, core.start(5)), fields_of(core, core.start(6))
    for name, array in first.items():
        np.testing.assert_array_equal(array, again[name])
    assert not np.allclose(first["body_mass"], other["body_mass"])
    batch = core.reset(core.start(5), np.array([False, True, False]))
    later = fields_of(core, batch)
    np.testing.assert_array_equal(later["geom_friction"][[0, 2]], first["geom_friction"][[0, 2]])
    assert not np.allclose(later["geom_friction"][1], first["geom_friction"][1])


def test_a_world_is_the_same_in_a_batch_of_any_size(core, scene):
    alone = fields_of(core, core.start(5))["geom_friction"][0]
    single = made(scene, worlds=1)
    np.testing.assert_array_equal(fields_of(single, single.start(5))["geom_friction"][0], alone)


def test_factors_are_within_their_ranges_and_fixed_things_keep_their_masses(scene):
    drawn = Randomization(PHYSICS, scene.model, scene.tables).fields(
        episode_keys(0, np.arange(200), np.zeros(200, int))
    )
    box = scene.model.body("box").id
    ratio = np.asarray(drawn.body_mass)[:, box] / scene.model.body_mass[box]
    assert ratio.min() >= 0.5 - 1e-5 and ratio.max() <= 2.0 + 1e-5
    assert len(np.unique(ratio)) > VARIANTS // 3
    friction = np.asarray(drawn.geom_friction)[..., 0] / scene.model.geom_friction[:, 0]
    assert friction.min() >= 0.5 - 1e-5 and friction.max() <= 1.5 + 1e-5 and np.ptp(friction) > 0.8
    fixed = np.append(scene.tables.object_fixed, True)[scene.tables.body_object]
    np.testing.assert_allclose(np.asarray(drawn.body_mass)[:, fixed], np.tile(scene.model.body_mass[fixed], (200, 1)))


def test_what_is_drawn_moves_the_world(core, scene):
    """A world steps as MuJoCo steps a model with its masses and its friction."""
    batch = core.start(5)
    world = batch.world.physics.worlds[1]
    drawn = fields_of(core, core.fork(batch))
    np.testing.assert_allclose(world.model.body_mass, drawn["body_mass"][1], rtol=1e-6)
    np.testing.assert_allclose(world.model.dof_damping, drawn["dof_damping"][1], rtol=1e-6)
    box = scene.model.body("box").id
    assert world.model.body_mass[box] != pytest.approx(scene.model.body_mass[box], rel=1e-3)


def test_snapshots_keep_it_and_the_next_episode_draws_again(core):
    batch = core.start(5)
    kept = core.engine.snapshot(batch.world.physics)
    drawn = fields_of(core, batch)
    elsewhere = core.load(core.start(9), kept)
    loaded = fields_of(core, elsewhere)
    for name, array in drawn.items():
        np.testing.assert_array_equal(loaded[name], array)
    after = fields_of(core, core.reset(elsewhere, np.ones(WORLDS, bool)))
    assert not np.allclose(after["body_mass"], drawn["body_mass"])


def test_without_it_worlds_have_no_fields_of_their_own(scene):
    core = made(scene, randomize=None)
    assert fields_of(core, core.start(5)) == {}
    assert Randomize.of(None) is None and Randomize.of({"physics": False}) is None
    assert Randomize.of(Randomize(physics=False)) is None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["warp", "jax"])
def test_batched_engines_draw_and_move_the_same(core, scene, name):
    """Fields are equal to the last bit of single precision; what falls comes to rest at the same height."""
    other = made(scene, name)
    batches = [core.start(5), other.start(5)]
    fields = [fields_of(one, batch) for one, batch in zip((core, other), batches, strict=True)]
    for field, array in fields[0].items():
        np.testing.assert_allclose(fields[1][field], array, rtol=1e-6)
    heights = []
    for one, batch in zip((core, other), batches, strict=True):
        for _ in range(10):
            batch, _ = one.step(batch)
        heights.append(np.asarray(batch.world.view.object_pos)[:, :, 2])
    np.testing.assert_allclose(heights[0], heights[1], atol=2e-3)
    batch = other.reset(batch, np.array([False, True, False]))
    later = fields_of(other, batch)
    np.testing.assert_array_equal(later["body_mass"][0], fields[1]["body_mass"][0])
    assert not np.allclose(later["geom_friction"][1], fields[1]["geom_friction"][1])


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        ({"phisics": True}, UnknownNameError, "near matches: physics"),
        ({"physics": {"mas": (1, 2)}}, UnknownNameError, "near matches: mass"),
        ({"physics": {"mass": (2, 1)}}, EngineError, "the least and the largest factor"),
        ({"physics": {"mass": 2}}, EngineError, "the least and the largest factor"),
        ({"physics": 3}, EngineError, "physics = 3: True, or Physics"),
        ("all", EngineError, "ig2mj.Randomize"),
    ],
)
def test_bad_settings_say_what_is_taken(given, error, said):
    with pytest.raises(error, match=said):
        EnvConfig().override(randomize=given)


def test_settings_come_back_from_files():
    config = EnvConfig(randomize=PHYSICS)
    kept = config.kept_in_files()["randomize"]
    assert kept == {"physics": {"mass": [0.5, 2.0], "friction": [0.5, 1.5], "damping": [0.5, 2.0]}}
    assert EnvConfig().override(randomize=kept).randomize == PHYSICS
    assert "randomize" not in EnvConfig().kept_in_files()
    assert Randomize.of(ig2mj.Randomize(physics=True)) == Randomize(physics=Physics())
    assert dataclasses.replace(config, randomize=None) == EnvConfig()
    assert jax.tree.leaves(kept)
