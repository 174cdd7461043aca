"""LeRobot's evaluation plays episodes of `hub/env.py`."""

from __future__ import annotations

import importlib.util
import pathlib

import numpy as np
import torch
from lerobot.envs.utils import add_envs_task, check_env_attributes_and_types, preprocess_observation
from lerobot.scripts.lerobot_eval import rollout

HUB = pathlib.Path(__file__).parents[3] / "hub" / "env.py"


class Resting(torch.nn.Module):
    """A policy of LeRobot's that does nothing."""

    config = type("Config", (), {"device": "cpu"})()

    def __init__(self, size: int):
        super().__init__()
        self._size, self.tasks = size, []

    def reset(self):
        pass

    def select_action(self, batch):
        self.tasks.append(batch["task"])
        return torch.zeros(len(batch["task"]), self._size)


def test_a_rollout_of_lerobots_reads_success_and_tasks(monkeypatch):
    monkeypatch.setenv("IG2MJ_TASK", "GraspingBook")
    spec = importlib.util.spec_from_file_location("hub_env", HUB)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    env = module.make_env(n_envs=2, use_async_envs=False)
    env.env = env.env.with_horizon(12)
    check_env_attributes_and_types(env)
    obs, _ = env.reset(seed=[1, 2])
    seen = add_envs_task(env, preprocess_observation(obs))
    assert seen["observation.images.rgb"].shape[:2] == (2, 3) and len(seen["task"]) == 2
    policy = Resting(env.single_action_space.shape[0])

    def same(value):
        return value

    found = rollout(env, policy, same, same, same, same, seeds=[1, 2])
    assert found["success"].shape[0] == 2 and not bool(found["success"].any())
    assert policy.tasks[0][0] == "Take the notebook from the coffee table."
    assert np.isfinite(found["reward"].numpy()).all()
