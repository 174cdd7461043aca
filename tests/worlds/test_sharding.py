"""Worlds on two devices: the same as on one. Runs in a process that has two CPU devices."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import engine_bench
import pytest

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.errors import EngineError
from ig2mj.worlds import Core, Rules, ShardedWorlds

SCRIPT = """
import json, operator, sys
import jax, numpy as np
import ig2mj
from ig2mj.engine.registry import make_engine
from ig2mj.worlds import Core, Rules, ShardedWorlds

scene = ig2mj.load_scene(sys.argv[1])
rules = Rules.of_scene(scene).with_goal("(on_top box table)")
out = {"devices": len(jax.devices())}
for name, devices in (("one", jax.devices()[:1]), ("two", jax.devices()[:2])):
    worlds = ShardedWorlds(lambda count: Core(make_engine(sys.argv[2], scene, count), rules), 2, devices)
    shards = worlds.start(seed=4)
    for _ in range(2):
        shards, _ = worlds.step(shards)
    shards = worlds.reset(shards, np.array([False, True]))
    shards, status = worlds.step(shards)
    fields = ("world.view.object_pos", "world.key", "number", "episode")
    out[name] = {f: np.asarray(worlds.gather(shards, operator.attrgetter(f))).tolist() for f in fields}
    out[name]["holds"] = np.asarray(status.holds).tolist()
    out[name]["on"] = len(worlds.gather(shards, operator.attrgetter("number")).sharding.device_set)
print("RESULT" + json.dumps(out))
"""


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("engine", ["warp"])
def test_two_devices_give_what_one_gives(bench_folder, engine):
    scene = engine_bench.bench_home(bench_folder, True)
    flags = "--xla_force_host_platform_device_count=2 --xla_cpu_multi_thread_eigen=false"
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags}
    command = [sys.executable, "-c", SCRIPT, str(scene.folder), engine]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=Path.cwd())
    assert done.returncode == 0, done.stderr[-3000:]
    result = json.loads(done.stdout.split("RESULT")[1])
    one, two = result["one"], result["two"]
    assert result["devices"] == 2 and one.pop("on") == 1 and two.pop("on") == 2
    assert two["number"] == [0, 1] and two["episode"] == [0, 1]
    assert one == two, "to the last digit"


def make(scene):
    return lambda count: Core(NativeEngine(scene, count, threads=1), Rules.of_scene(scene))


def test_worlds_must_divide_evenly(bench_folder):
    scene = engine_bench.bench_home(bench_folder, True)
    with pytest.raises(EngineError, match="3 worlds cannot be shared by 2 devices"):
        ShardedWorlds(make(scene), 3, ["a", "b"])


def test_the_native_engine_cannot_be_shared_out(bench_folder):
    scene = engine_bench.bench_home(bench_folder, True)
    with pytest.raises(EngineError, match="the native engine has no devices"):
        ShardedWorlds(make(scene), 2)
