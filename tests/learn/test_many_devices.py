"""Several devices share the worlds and the learning. Runs in a process that has two CPU devices."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import PointMass

from ig2mj.errors import EngineError
from ig2mj.learn.perception import Perception
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.several_devices import AXIS, ManyDevices

SCRIPT = """
import dataclasses, json, sys
sys.path.insert(0, {folder!r})
import jax, numpy as np
from small_envs import PointMass
from ig2mj.learn.several_devices import AXIS
from ig2mj.learn.perception import Perception
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.train import Run, train

env, out = PointMass(32), {{}}
perception = Perception(env.observation_spaces)
layers = {{"actor_layers": (32, 32), "critic_layers": (32, 32)}}
ppo = PPO(perception, 2, PPOConfig(rollout_length=16, minibatches=4, lr=1e-3, **layers), AXIS)
layers = {{"actor_layers": (32,), "critic_layers": (32,)}}
sac = SAC(perception, 2, SACConfig(utd_ratio=4, batch_size=64, buffer_size=4000, num_atoms=21, **layers), AXIS)
for name, algorithm, iterations in (("ppo", ppo, 100), ("sac", sac, 12)):
    run = Run(3.0, iterations=iterations, stop_at_success=0.9, quiet=True, out={out!r} + name)
    result = train(env, algorithm, run, devices=jax.devices())
    weights = [
        [np.asarray(s.data) for s in leaf.addressable_shards] for leaf in jax.tree.leaves(result.learner.actor)
    ]
    out[name] = {{
        "same": all(len(w) == 2 and np.array_equal(*w) for w in weights),
        "env_steps": result.row["env_steps"],
        "iterations": result.iteration,
        "success": result.row["success"],
        "shares": result.row["simulator_share"],
    }}
    if name == "sac":
        run = dataclasses.replace(run, iterations=16, resume=True)
        out["resumed"] = train(env, algorithm, run, devices=jax.devices()).iteration
print("RESULT" + json.dumps(out))
"""


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_two_devices_learn_together(tmp_path):
    code = SCRIPT.format(folder=str(Path(__file__).parent), out=str(tmp_path) + "/")
    flags = "--xla_force_host_platform_device_count=2 --xla_cpu_multi_thread_eigen=false"
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout.split("RESULT")[1])
    for name, length in (("ppo", 16), ("sac", 2)):
        assert found[name]["same"], f"{name}: the two devices' weights differ"
        assert found[name]["env_steps"] == 64 * length * found[name]["iterations"]
        assert 0 < found[name]["shares"] < 1
    assert found["ppo"]["success"] > 0.85
    assert found["resumed"] == 16


def test_a_batch_that_the_devices_cannot_share_evenly_is_refused():
    env = PointMass(4)
    sac = SAC(Perception(env.observation_spaces), 2, SACConfig(batch_size=63), AXIS)
    with pytest.raises(EngineError, match="a batch of 63 samples cannot be shared by 2 devices: --set batch_size="):
        ManyDevices(env, sac, jax.devices() * 2)
