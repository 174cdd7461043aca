"""Functions of a user's task are part of compiled programs on MJX: the same rewards as on the native engine."""

from __future__ import annotations

import jax
import numpy as np
import pytest
from own_tasks import write_task

import ig2mj
from ig2mj.testing import api_test


@pytest.mark.slow
def test_rewards_and_observations_on_jax_are_those_of_the_native_engine(tmp_path, tiny_home_folder, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    task, seen = f"{write_task(tmp_path, tiny_home_folder)}:AppleToFloor", {}
    for engine in ("native", "jax"):
        env = ig2mj.make(task, worlds=2, engine=engine, pool_size=1)
        state = env.reset(0)
        measures = {name: np.asarray(array) for name, array in state.measures.own.items()}
        status, world = state.status, state.batch.world
        action = np.full((2, *env.action_space.shape), 0.5, np.float32)
        now = env.objective.measure(world.view, world.states, status, None, state.measures, action)
        first = {"obs": state.obs["privileged_state"], "own": measures, "terms": now.terms, "over": now.over}
        seen[engine] = jax.tree.map(np.asarray, first)
    for one, other in zip(jax.tree.leaves(seen["native"]), jax.tree.leaves(seen["jax"]), strict=True):
        assert one == pytest.approx(other, abs=1e-3)


@pytest.mark.gpu
def test_it_keeps_every_promise_on_warp(gpu, tmp_path, tiny_home_folder, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    env = ig2mj.make(f"{write_task(tmp_path, tiny_home_folder)}:AppleToFloor", worlds=4, engine="warp", pool_size=1)
    stepped = jax.jit(env.step_fn)(env.reset(0), np.zeros((4, *env.action_space.shape), np.float32))
    assert np.isfinite(np.asarray(stepped.reward)).all()
    api_test(env, steps=3, within=1e-3, astray=0.5)
