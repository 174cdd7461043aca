"""Runs: what survives a kill, what is refused, and what is said when numbers are lost."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import PointMass

from ig2mj.errors import ClusterError, Ig2mjError, InputError, UnknownNameError
from ig2mj.learn.bc import BCConfig
from ig2mj.learn.best import BEST, COUNTED, LAST, SUCCESS, Best
from ig2mj.learn.checkpoints import Checkpoints, only_run
from ig2mj.learn.dagger import DaggerConfig
from ig2mj.learn.iteration import OneDevice
from ig2mj.learn.networks import ConvEncoder
from ig2mj.learn.occlusion import OcclusionConfig
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import Policy, depends_on
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.replay import Replay
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.settings import configure_all, configured, written
from ig2mj.learn.train import Run, train
from ig2mj.process.compilation import XLA_EVENT
from ig2mj.process.gc_pause import Compiled, PendingCall

CONFIG = PPOConfig(rollout_length=4, minibatches=1, epochs=1, actor_layers=(16,), critic_layers=(16,))

KILLED = """
import sys
sys.path.insert(0, {folder!r})
from small_envs import PointMass
from ig2mj.learn.perception import Perception
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.train import Run, train
env = PointMass(8)
config = PPOConfig(rollout_length=4, minibatches=1, epochs=1, actor_layers=(16,), critic_layers=(16,))
train(env, PPO(Perception(env.observation_spaces), 2, config), Run(5.0, out={out!r}, checkpoint_every=0.2, quiet=True))
"""


def algorithm(env, **changes):
    return PPO(Perception(env.observation_spaces), 2, dataclasses.replace(CONFIG, **changes))


def same(a, b):
    return all(np.array_equal(x, y) for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True))


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A run of twelve iterations."""
    out, env = tmp_path_factory.mktemp("run"), PointMass(8)
    result = train(env, algorithm(env), Run(iterations=12, out=out, quiet=True))
    return env, out, result


def rows(out):
    with (out / "progress.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_a_resumed_run_goes_on_with_what_was_learned(done, tmp_path):
    env, out, result = done
    like = {"learner": jax.jit(algorithm(env).init)(jax.random.PRNGKey(7)), "key": jax.random.PRNGKey(0)}
    checkpoints = Checkpoints(out)
    tree, meta = checkpoints.newest(like, checkpoints.meta(12)["depends"])
    assert same(tree["learner"], result.learner)
    assert meta["env_steps"] == 12 * 4 * 8
    more = train(env, algorithm(env), Run(iterations=20, out=out, resume=True, quiet=True))
    assert more.iteration == 20
    assert more.row["env_steps"] == 20 * 4 * 8
    assert int(more.learner.updates) > int(result.learner.updates)
    assert [int(r["iteration"]) for r in rows(out)] == sorted({int(r["iteration"]) for r in rows(out)})
    assert list(out.glob("events.out.tfevents.*"))


def test_a_broken_checkpoint_is_passed_over(tmp_path, capsys):
    env, like = PointMass(8), {"a": np.arange(4.0), "b": np.zeros(2)}
    checkpoints = Checkpoints(tmp_path)
    for k in (1, 2, 3, 4, 5):
        checkpoints.save(k, {"a": like["a"] * k, "b": like["b"]}, {"depends": {"env": type(env).__name__}})
    assert checkpoints.numbers() == [3, 4, 5]
    (tmp_path / "checkpoints" / "5" / "meta.json").write_text("{")
    for file in (tmp_path / "checkpoints" / "4" / "arrays").rglob("*"):
        if file.is_file():
            file.write_bytes(b"")
    tree, _ = checkpoints.newest(like, {"env": "PointMass"})
    assert np.array_equal(tree["a"], like["a"] * 3)
    assert capsys.readouterr().err.count("the checkpoint before it is taken") == 2


def test_another_runs_checkpoint_is_refused_with_what_differs(done):
    env, out, _ = done
    with pytest.raises(InputError, match="settings"):
        train(env, algorithm(env, gamma=0.5), Run(iterations=30, out=out, resume=True, quiet=True))
    with pytest.raises(Ig2mjError, match="holds a run already"):
        train(env, algorithm(env), Run(iterations=30, out=out, quiet=True))


def test_a_second_run_with_one_folder_refuses(tmp_path):
    env = PointMass(8)
    with (
        only_run(tmp_path),
        pytest.raises(ClusterError, match=rf"{tmp_path.name}: process {os.getpid()} on .* is writing there"),
    ):
        train(env, algorithm(env), Run(iterations=1, out=tmp_path, quiet=True))
    assert train(env, algorithm(env), Run(iterations=1, out=tmp_path, quiet=True)).iteration == 1


def test_numbers_that_are_lost_stop_the_run_with_the_last_good_checkpoint(tmp_path):
    class Lost(PointMass):
        def judge(self, state, pos):
            reward, success = super().judge(state, pos)
            return reward + jax.numpy.where(state.key[0] % 64 == 0, np.nan, 0.0), success

    env = Lost(8)
    with pytest.raises(Ig2mjError, match="the reward's term 'way' is nan, and must be finite"):
        train(env, algorithm(env), Run(iterations=400, out=tmp_path, checkpoint_every=0.0, quiet=True))
    newest = Checkpoints(tmp_path).numbers()[-1]
    like = {"learner": jax.jit(algorithm(env).init)(jax.random.PRNGKey(7)), "key": jax.random.PRNGKey(0)}
    tree, _ = Checkpoints(tmp_path).newest(like, Checkpoints(tmp_path).meta(newest)["depends"])
    floats = [a for a in jax.tree.leaves(tree) if a.dtype == np.float32]
    assert all(np.isfinite(a).all() for a in floats)


@pytest.mark.slow
def test_a_killed_run_goes_on(tmp_path):
    """SIGKILL at any moment costs what came after the last checkpoint."""
    code = KILLED.format(folder=str(Path(__file__).parent), out=str(tmp_path))
    process = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "JAX_PLATFORMS": "cpu"})
    try:
        deadline = time.monotonic() + 200
        while len(Checkpoints(tmp_path).numbers()) < 3 and time.monotonic() < deadline:
            assert process.poll() is None
            time.sleep(0.05)  # until there is something to kill
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    newest = Checkpoints(tmp_path).numbers()[-1]
    assert newest > 0
    env = PointMass(8)
    result = train(env, algorithm(env), Run(5.0, iterations=newest + 5, out=tmp_path, resume=True, quiet=True))
    assert result.iteration == newest + 5
    assert result.row["env_steps"] == (newest + 5) * 4 * 8
    seconds = [float(r["seconds"]) for r in rows(tmp_path)]
    assert seconds == sorted(seconds)


@pytest.mark.slow
def test_a_buffer_that_was_kept_needs_no_filling(tmp_path):
    """With it updates go on at once; without it the policy plays 100 steps of every world before."""
    env = PointMass(8)
    config = SACConfig(
        utd_ratio=2, batch_size=32, buffer_size=2000, actor_layers=(16,), critic_layers=(16,), num_atoms=11
    )
    sac = SAC(Perception(env.observation_spaces), 2, config)

    def updates(kept: bool, iterations: int, resume: bool) -> int:
        out = tmp_path / str(kept)
        run = Run(5.0, iterations=iterations, out=out, save_buffer=kept, resume=resume, quiet=True)
        return int(train(env, sac, run).learner.updates)

    before = updates(True, 20, False)
    assert updates(False, 20, False) == before > 0
    each = before // (20 - sac.warm_up(False))
    assert updates(True, 32, True) - before == each * (12 - 2)
    assert updates(False, 32, True) == before, "it still fills"
    assert updates(False, 32 + sac.warm_up(True) + 3, True) - before == each * 3, "each start fills anew"


def test_a_policy_file_acts_as_what_was_trained(done, tmp_path):
    env, _, result = done
    trained = algorithm(env)
    depends = depends_on(env, trained.perception)
    policy = Policy.of(trained, result.learner, depends, {"seed": 0})
    policy.save(tmp_path / "policy.npz")
    loaded = Policy.load(tmp_path / "policy.npz")
    assert loaded.card["depends"] == depends
    obs = env.reset(3).obs
    action = np.asarray(loaded.actor(trained.perception)(obs))
    mean, _, _ = trained._look(result.learner.actor, result.learner.moments, trained.perception(obs))
    assert np.abs(action - np.tanh(np.asarray(mean))).max() < 5e-3  # half precision
    loaded.check(env, trained.perception)


def test_the_best_policy_of_a_run_is_kept_beside_the_last_one(tmp_path):
    def policy(success, mark, count=100):
        names = {"task": "", "robot": "", "grasping": "", "actions": ["x"], "mode": "state", "vector": {"a": 1}}
        depends, net = names | {"picture": None, "privileged": []}, {"net": "small", "sizes": [2]}
        card = {"format": 1, "depends": depends, "digest": "", "net": net, SUCCESS: success, COUNTED: count}
        return Policy(card, {"mean/bias": np.full(2, mark, np.float32)}, np.zeros(1), np.ones(1))

    def kept():
        return [float(Policy.load(tmp_path / name).weights["mean/bias"][0]) for name in (BEST, LAST)]

    best = Best(tmp_path, resumed=False)
    assert best.offer(policy(1.0, 8, count=4)) and best.offer(policy(0.74, 9)), "four episodes say little"
    best = Best(tmp_path, resumed=False)
    assert best.offer(policy(None, 0)) and best.offer(policy(0.5, 1)) and best.offer(policy(0.9, 2))
    assert not best.offer(policy(0.8, 3)) and kept() == [2, 3]
    assert best.offer(policy(0.9, 4)) and kept() == [4, 4]  # as good and later
    again = Best(tmp_path, resumed=True)
    assert not again.offer(policy(0.89, 5)) and kept() == [4, 5]
    assert Best(tmp_path, resumed=False).offer(policy(0.1, 6)) and kept() == [6, 6]  # another run's is of no account
    (tmp_path / BEST).write_bytes(b"half a fi")
    assert Best(tmp_path, resumed=True).offer(policy(None, 7)) and kept() == [7, 7]


def test_a_policy_for_something_else_is_refused_with_the_pair_that_differs(done, tmp_path):
    env, _, result = done
    trained = algorithm(env)
    depends = {**depends_on(env, trained.perception), "grasping": "sticky"}
    policy = Policy.of(trained, result.learner, depends, {})
    with pytest.raises(InputError, match='grasping = sticky; you asked for ""'):
        policy.check(env, trained.perception)
    (tmp_path / "broken.npz").write_bytes(b"PK\x03\x04nothing")
    with pytest.raises(InputError, match="is not an npz archive"):
        Policy.load(tmp_path / "broken.npz")


def test_an_unknown_encoder_is_not_taken_for_the_small_one():
    with pytest.raises(UnknownNameError, match="points"):
        ConvEncoder((32, 32, 4), "point")


def test_settings_are_known_by_name_and_type():
    assert configured(SACConfig(), ["utd_ratio=4", "actor_layers=64,32", "lr=0.1"]).actor_layers == (64, 32)
    with pytest.raises(UnknownNameError, match="gamma"):
        configured(SACConfig(), ["gama=0.9"])
    with pytest.raises(Ig2mjError, match="utd_ratio=32"):
        configured(SACConfig(), ["utd_ratio=many"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ("utd_ratio=0", "at least 1"),
        ("init_alpha=-1", "at least 0"),
        ("gamma=1.5", "from 0 to 1"),
        ("lr=inf", "finite"),
        ("actor_layers=64,0", "at least 1"),
    ],
)
def test_settings_that_cannot_be_are_refused(change, told):
    with pytest.raises(Ig2mjError, match=told):
        configured(SACConfig(), [change])


def test_every_setting_of_an_algorithm_may_be_what_it_is():
    for config in (SACConfig(), PPOConfig(), DaggerConfig(), BCConfig(), OcclusionConfig()):
        changes = [f"{name}={written(value)}" for name, value in dataclasses.asdict(config).items()]
        assert configured(config, changes) == config


def test_names_of_version_0_1_work_and_say_what_they_are_called_now(capsys):
    configs = DaggerConfig(), OcclusionConfig()
    changes = ["updates=4", "net=points", "recall=2", "believed=1", "noise=0.2"]
    dagger, occlusion = configure_all(configs, changes)
    assert (dagger.utd_ratio, dagger.encoder, dagger.action_noise) == (4, "points", 0.2)
    assert occlusion == OcclusionConfig(object_memory="full", belief_labels=True)
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 5 and "'updates' is now 'utd_ratio'" in told[0]
    with pytest.warns(FutureWarning, match="SACConfig: 'every' is now 'policy_delay'"):
        assert SACConfig(every=2) == SACConfig(policy_delay=2)


def test_a_checkpoint_of_version_0_1_is_refused_with_the_version_that_reads_it(done, tmp_path):
    env, out, _ = done
    shutil.copytree(out, tmp_path / "old")
    for file in (tmp_path / "old" / "checkpoints").glob("*/meta.json"):
        meta = json.loads(file.read_text())
        del meta["format"]
        file.write_text(json.dumps(meta))
    with pytest.raises(InputError, match=r"ig2mj 0\.1\.0"):
        train(env, algorithm(env), Run(iterations=30, out=tmp_path / "old", resume=True, quiet=True))


@pytest.mark.parametrize("programs", [["jit(whole)"], ["jit(collect)", "jit(learn)"]])
def test_an_iteration_is_compiled_together_with_the_start_where_kernels_are_awaited(programs, monkeypatch):
    class Awaiting(PointMass):
        """Offers its start's program, as an environment does whose engine is loading kernels."""

        def pending_programs(self, seed):
            return [Compiled(self._start_fn).traced(jax.random.PRNGKey(seed))]

    compiled = list[str]()

    def note(event: str, duration_secs: float, **about: str | int) -> None:
        if event == XLA_EVENT:
            compiled.append(str(about.get("fun_name")))

    env, once = Awaiting(8), []
    reset = env.reset
    monkeypatch.setattr(env, "reset", lambda seed: (once.append(list(compiled)), reset(seed))[1])
    jax.monitoring.register_event_duration_secs_listener(note)
    result = train(env, algorithm(env), Run(iterations=2, programs=len(programs), quiet=True))
    for program in programs:
        assert program in once[0] and compiled.count(program) == 1, "the call finds what was compiled"
    assert compiled.count("jit(init)") == 1
    assert result.compile_s > 0


def test_an_iteration_is_traced_while_the_new_learner_is_compiled(monkeypatch):
    done = list[str]()

    class Noting(PendingCall):
        def result(self):
            done.append("learner")
            return super().result()

    monkeypatch.setattr("ig2mj.learn.train.PendingCall", Noting)
    monkeypatch.setattr(OneDevice, "compile_beforehand", lambda self, learner, *_: done.append(type(learner).__name__))
    env, ours = PointMass(8), algorithm(PointMass(8))
    result = train(env, ours, Run(iterations=1, quiet=True))
    assert done == [type(result.learner).__name__, "learner"], "shapes are enough"


def test_a_buffer_is_one_program(monkeypatch):
    compiled = list[str]()

    def note(event: str, duration_secs: float, **about: str | int) -> None:
        if event == XLA_EVENT:
            compiled.append(str(about.get("fun_name")))

    perception = Perception(PointMass(8).observation_spaces)
    jax.monitoring.register_event_duration_secs_listener(note)
    jax.clear_caches()
    replay = Replay.empty(12, 24, perception, 2, 2)
    assert compiled == ["jit(made)"]
    assert replay.vector.shape == (12, 24, perception.vector_size) and not np.asarray(replay.label).any()
