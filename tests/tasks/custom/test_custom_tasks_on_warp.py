"""Functions of a user's task are part of compiled programs on Warp."""

from __future__ import annotations

import pytest
from own_tasks import write_task

import ig2mj
from ig2mj.testing import api_test


@pytest.mark.gpu
def test_it_keeps_every_promise_on_warp(gpu, tmp_path, tiny_home_folder, monkeypatch):
    monkeypatch.setattr("ig2mj.tasks.pool_files.cache_folder", lambda: tmp_path)
    env = ig2mj.make(f"{write_task(tmp_path, tiny_home_folder)}:AppleToFloor", worlds=4, engine="warp", pool_size=1)
    assert env.pure
    api_test(env, steps=3, within=1e-3, astray=0.5)
