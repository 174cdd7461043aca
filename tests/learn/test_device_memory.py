"""Out of device memory: one line with the number of worlds that would fit."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import jax
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import PointMass

from ig2mj.learn import device_memory
from ig2mj.learn.perception import Perception
from ig2mj.learn.sac import SAC, SACConfig


class Device:
    def memory_stats(self):
        return {"bytes_limit": 2_000_000_000}


@pytest.fixture
def sac():
    env = PointMass(4)
    return env, SAC(Perception(env.observation_spaces), 2, SACConfig(buffer_size=1_000_000))


def test_the_number_of_worlds_that_fit_counts_worlds_and_replay_buffer(sac, monkeypatch):
    env, algorithm = sac
    monkeypatch.setattr(jax, "local_devices", lambda: [Device()])
    monkeypatch.setattr(device_memory, "world_bytes", lambda env: 0.5e6)
    line = device_memory.too_large(env, algorithm, 4096)
    fit = int(re.search(r"--worlds (\d+)", line)[1])
    assert "\n" not in line and "4096 worlds do not fit into 2.0 GB" in line
    used = device_memory.world_bytes(env) * fit + device_memory.buffer_bytes(algorithm, fit)
    assert 0.8 * 2e9 < used <= device_memory.USED * 2e9 and fit % device_memory.STEP == 0
    large = SAC(algorithm.perception, 2, SACConfig(buffer_size=100_000_000))
    assert "take a smaller --set buffer_size" in device_memory.too_large(env, large, 4096)


def test_the_bytes_of_a_world_are_those_of_the_environments_state(sac):
    env, _ = sac
    state = sum(a.nbytes for a in jax.tree.leaves(env.reset(0)))
    assert device_memory.world_bytes(env) == pytest.approx(device_memory.COPIES * state / env.num_worlds)
    assert device_memory.world_bytes(PointMass(4, pure=False)) == 0, "its worlds are not on the device"


def test_the_bytes_of_a_replay_buffer_are_those_that_it_takes(sac):
    _, algorithm = sac
    small = SAC(algorithm.perception, 2, SACConfig(buffer_size=1000))
    assert device_memory.buffer_bytes(small, 10) == sum(a.nbytes for a in jax.tree.leaves(small.buffer(10)))
