"""`LeRobotVectorEnv`: what `lerobot-eval` asks of a vector environment."""

from __future__ import annotations

import importlib.util

import gymnasium
import numpy as np
import pytest

from ig2mj.envs.lerobot import LeRobotVectorEnv, camera_key
from ig2mj.errors import EngineError


@pytest.mark.slow
def test_an_episode_has_what_lerobots_evaluation_reads(repository):
    spec = importlib.util.spec_from_file_location("hub_env", repository / "hub" / "env.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert callable(module.make_env)
    options = {"engine": "native", "pool_size": 2, "horizon": 3, "image_size": 32}
    env = LeRobotVectorEnv("GraspingBook", 2, ("head", "right_wrist"), **options)
    assert isinstance(env, gymnasium.vector.VectorEnv) and env.call("_max_episode_steps") == (3, 3)
    assert env.call("task_description") == env.call("task") == ("Take the notebook from the coffee table.",) * 2
    assert [one.task_description for one in env.envs] == list(env.call("task_description"))
    obs, info = env.reset(seed=[1, 2])
    assert {k: a.shape for k, a in obs["pixels"].items()} == {"rgb": (2, 32, 32, 3), "right_wrist": (2, 32, 32, 3)}
    assert env.observation_space.contains(obs) and info["is_success"].tolist() == [False, False]
    for _ in range(3):
        obs, _, terminated, truncated, info = env.step(np.zeros((2, *env.single_action_space.shape)))
    assert (terminated | truncated).all() and info["final_info"]["is_success"].dtype == bool
    assert env.observation_space.contains(info["final_obs"])
    env.close()


def test_cameras_have_lerobots_names_and_observations_follow_from_them():
    assert camera_key("head") == "rgb" and camera_key("humanoid/eye") == "humanoid_eye"
    with pytest.raises(EngineError, match="takes n_envs, and cameras"):
        LeRobotVectorEnv("GraspingBook", observations=("rgb",))
