"""The examples with PyTorch, Stable-Baselines3, skrl and rsl_rl train in native worlds as users run them, shorter."""

from __future__ import annotations

import pathlib
import sys

import numpy as np
import pytest
import torch

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "examples"))

import rsl_rl_ppo
import sb3_ppo
import skrl_ppo
import torch_loop

import ig2mj
from ig2mj.envs.arrays import TorchEnv

TASK, WORLDS = "PointNavigation", 4


@pytest.fixture(scope="module")
def env():
    return ig2mj.make(TASK, worlds=WORLDS, engine="native", pool_size=8)


def test_a_plain_pytorch_loop_trains(env):
    rows = []
    model = torch_loop.train(TorchEnv(env), updates=6, length=8, report=lambda *row: rows.append(row))
    assert len(rows) == 6 and np.isfinite(rows).all()
    assert all(torch.isfinite(p).all() for p in model.parameters())


def test_its_rewards_are_those_of_the_environment(env):
    """The same actions through tensors and directly."""
    torch_env, action = TorchEnv(env), torch.full((WORLDS, 2), 0.5)
    obs, _ = torch_env.reset(seed=3)
    through = [torch_env.step(action)[1].numpy() for _ in range(5)]
    state = env.reset(3)
    assert np.array_equal(obs["task_obs"].numpy(), state.obs["task_obs"]) if "task_obs" in obs else True
    for reward in through:
        state = env.step_autoreset(state, action.numpy())
        assert np.array_equal(reward, np.asarray(state.reward))


def test_stable_baselines3_trains():
    model = sb3_ppo.trained(TASK, WORLDS, 512, engine="native", pool_size=8)
    assert model.num_timesteps == 512
    assert all(torch.isfinite(p).all() for p in model.policy.parameters())


def test_what_was_seen_last_goes_to_stable_baselines3():
    short = ig2mj.make(TASK, worlds=WORLDS, engine="native", pool_size=8).with_horizon(3)
    worlds = sb3_ppo.Worlds(short)
    first = worlds.reset()
    for _ in range(3):
        obs, _, done, infos = worlds.step(np.zeros((WORLDS, 2), np.float32))
    assert done.all() and all(info["TimeLimit.truncated"] for info in infos)
    last = np.stack([info["terminal_observation"] for info in infos])
    assert last.shape == obs.shape == first.shape
    assert np.allclose(last[:, -1], 0.0, atol=0.4) and not np.array_equal(last, obs)


def test_skrl_trains():
    agent = skrl_ppo.trained(TASK, WORLDS, 64, engine="native", pool_size=8)
    before, after = skrl_ppo.Policy, agent.models["policy"]
    assert isinstance(after, before) and all(torch.isfinite(p).all() for p in after.parameters())
    assert (after.log_std != -1.0).any()  # it has learnt


def test_rsl_rl_trains_and_says_how_far_it_is(capsys):
    runner = rsl_rl_ppo.trained(TASK, WORLDS, 2, seed=1, length=16, engine="native", pool_size=8)
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("iteration")]
    assert [line.split(":")[0] for line in lines] == ["iteration 1 of 2", "iteration 2 of 2"]
    assert all(torch.isfinite(p).all() for p in runner.alg.get_policy().parameters())


def test_rsl_rl_is_told_which_episodes_ran_out_of_time():
    short = ig2mj.make(TASK, worlds=WORLDS, engine="native", pool_size=8).with_horizon(3)
    worlds = rsl_rl_ppo.Worlds(TorchEnv(short), seed=3)
    for _ in range(3):
        obs, reward, done, extras = worlds.step(torch.zeros((WORLDS, worlds.num_actions)))
    assert done.all() and extras["time_outs"].all() and worlds.ended == WORLDS
    assert obs["policy"].shape == worlds.get_observations()["policy"].shape and reward.shape == (WORLDS,)
    assert (worlds.episode_length_buf == 0).all()
