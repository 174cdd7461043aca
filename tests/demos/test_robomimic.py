"""Recordings as robomimic's HDF5: one group a run, with observations of before and after every step."""

from __future__ import annotations

import json
from typing import Any

import h5py
import numpy as np
import pytest

import ig2mj
from ig2mj.demos import Recording, Replayer, record
from ig2mj.demos.robomimic import export_robomimic
from ig2mj.envs.experts import expert_of

HORIZON = 5


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("robomimic")
    env = ig2mj.make("CookingMeat", worlds=2, engine="native", pool_size=4).with_horizon(HORIZON)
    expert, seen = expert_of(env), []
    with record(env, folder / "runs.h5") as played:
        state = played.reset(1)
        for _ in range(HORIZON):
            seen.append((np.asarray(state.obs["privileged_state"]), np.asarray(expert(state))))
            state = played.step(state, seen[-1][1])
        played.reset(state)
    with Recording(folder / "runs.h5") as recording:
        done = export_robomimic(Replayer(recording, env=env), folder / "robomimic.h5")
    assert done.differences == []
    return folder / "robomimic.h5", seen


def test_every_run_of_more_than_one_frame_is_a_demonstration(exported):
    file, seen = exported
    with h5py.File(file) as opened:
        data: Any = opened["data"]
        assert sorted(data) == ["demo_0", "demo_1"]
        assert data.attrs["total"] == 2 * HORIZON
        about = json.loads(data.attrs["env_args"])
        assert about["env_name"] == "ig2mj/CookingMeat-v0" and about["type"] == 2
        for world in range(2):
            demo = data[f"demo_{world}"]
            assert demo.attrs["num_samples"] == HORIZON
            assert {len(demo[name]) for name in ("actions", "rewards", "dones", "states")} == {HORIZON}
            assert np.array_equal(demo["actions"], np.stack([action[world] for _, action in seen]))
            assert np.array_equal(demo["obs/privileged_state"], np.stack([obs[world] for obs, _ in seen]))
            assert list(demo["dones"]) == [0] * (HORIZON - 1) + [1]
            for name in demo["obs"]:
                assert np.array_equal(demo["obs"][name][1:], demo["next_obs"][name][:-1])
