"""Fetch's expert of CookingMeat where counters are 1.05 m high."""

from __future__ import annotations

import pytest

import ig2mj
from ig2mj.envs.experts import expert_of
from ig2mj.envs.rollout import play


@pytest.mark.slow
def test_fetch_takes_steaks_on_the_side_of_its_arm_without_sweeping_them():
    settings = {"observations": "proprioception", "split": "held_out", "pool_size": 4}
    env = ig2mj.make("CookingMeat", "fetch", 4, "native", home="juniper", **settings)
    success = play(env, expert_of(env), 4, in_order=True).success
    assert success[2], "the arm swept this one off the counter with a gripper that kept its orientation"
    assert sum(success) >= 3
