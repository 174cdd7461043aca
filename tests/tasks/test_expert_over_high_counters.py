"""Fetch's expert of CookingMeat where counters are 1.05 m high."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.envs.experts import expert_of


@pytest.mark.slow
def test_fetch_takes_steaks_on_the_side_of_its_arm_without_sweeping_them():
    settings = {"observations": "proprioception", "split": "held_out", "pool_size": 4}
    env = ig2mj.make("CookingMeat", "fetch", 4, "native", home="juniper", **settings)
    expert, state = expert_of(env), env.start_from(np.arange(4))
    success, over = np.zeros(4, bool), np.zeros(4, bool)
    for _ in range(env.task.horizon):
        state = env.step(state, np.asarray(expert(state)))
        success |= np.asarray(state.info["success"]) & ~over
        over |= np.asarray(state.done)
        if over.all():
            break
    assert success[2], "the arm swept this one off the counter with a gripper that kept its orientation"
    assert success.sum() >= 3
