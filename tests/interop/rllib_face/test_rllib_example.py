"""The example with RLlib trains in native worlds, as users run it, only shorter."""

from __future__ import annotations

import pathlib
import sys

import numpy as np
import pytest
import ray

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "examples"))

import rllib_ppo

TASK, WORLDS = "PointNavigation", 4
SETTINGS = {"task": TASK, "engine": "native", "pool_size": 8}


@pytest.fixture(scope="module", autouse=True)
def cluster():
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False)
    yield
    ray.shutdown()


def test_worlds_are_one_batch_with_flat_observations():
    env = rllib_ppo.make({**SETTINGS, "num_envs": WORLDS})
    first, _ = env.reset(seed=3)
    again, _ = env.reset(seed=3)
    assert first.shape == env.observation_space.shape and first.dtype == np.float32
    assert np.array_equal(first, again) and len(np.unique(first, axis=0)) > 1  # two may start at the same row


def test_rllib_trains_and_says_how_far_it_is(capsys):
    options = {name: value for name, value in SETTINGS.items() if name != "task"}
    algorithm = rllib_ppo.trained(TASK, WORLDS, 2, seed=1, length=16, **options)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("iteration")]
    assert [line.split(":")[0] for line in lines] == ["iteration 1 of 2", "iteration 2 of 2"]
    weights = algorithm.get_weights()["default_policy"]
    assert all(np.isfinite(np.asarray(array)).all() for array in weights.values())
    assert f"{2 * WORLDS * 16} steps" in lines[-1]
    algorithm.stop()
