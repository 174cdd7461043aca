"""Demonstrations: read from recordings as networks see them, cloned; broken files are refused."""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import PointMass, SeenPointMass
from small_recordings import write_recording

from ig2mj.demos import Recording
from ig2mj.errors import InputError
from ig2mj.learn.bc import BC, BCConfig, begin_as_clone, clone
from ig2mj.learn.demos import about, horizon_of_demos, load_demos
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import Policy, depends_of, horizon_on_card, world_of
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.train import Run, train


def expert(state):
    return np.clip(10 * (np.asarray(state.goal) - np.asarray(state.pos)), -1, 1)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    env, file = PointMass(8, pure=False), tmp_path_factory.mktemp("demos") / "runs.h5"
    write_recording(env, expert, file, episodes=30)
    return env, file


def test_complete_runs_are_read_one_after_the_other(recorded):
    env, file = recorded
    demos = load_demos(file, Perception(env.observation_spaces), world_of(env))
    with Recording(file) as recording:
        complete = sum(run.complete for run in recording.runs)
    assert complete < len(recording.runs), "runs that were cut off are left out"
    assert int((demos.terminated | demos.truncated).sum()) == complete >= 30
    inside = ~np.asarray(demos.terminated | demos.truncated)[:-1]
    before, after = np.asarray(demos.seen.vector)[1:], np.asarray(demos.after.vector)[:-1]
    assert np.array_equal(before[inside], after[inside])
    assert not np.array_equal(before[~inside], after[~inside])  # a new episode begins
    vector = np.asarray(demos.seen.vector)
    assert np.asarray(demos.label) == pytest.approx(np.clip(10 * (vector[:, 2:] - vector[:, :2]), -1, 1), abs=1e-5)
    assert not np.allclose(demos.label, demos.action)


def test_a_card_says_how_long_the_episodes_of_demonstrations_were(recorded):
    assert horizon_of_demos(recorded[1]) is None, "this file does not say so"
    assert horizon_of_demos("SlicingFruit") == 200
    assert horizon_on_card({"horizon": 600}) == {"horizon": 600} and horizon_on_card({"task": "mine"}) == {}


@pytest.mark.slow
def test_a_clone_does_what_the_expert_does(recorded):
    env, file = recorded
    world, spaces = about(file)
    perception = Perception(spaces)
    algorithm = BC(perception, 2, BCConfig(num_updates=400, batch_size=64, lr=3e-3, actor_layers=(32, 32)))
    learner, row = clone(algorithm, load_demos(file, perception), Run(quiet=True))
    assert row["held_out_loss"] < 0.1
    policy = Policy.of(algorithm, learner, depends_of(world, perception), {})
    policy.check(env, perception)
    act, state, success = policy.actor(perception), env.reset(9), 0
    episodes = 0
    for _ in range(60):
        state = env.step_autoreset(state, np.asarray(act(state.obs)))
        episodes += int(np.asarray(state.terminated | state.truncated).sum())
        success += int(np.asarray(state.terminated).sum())
    assert success > 0.9 * episodes > 10


def test_images_are_read_as_they_were_recorded(tmp_path):
    env = SeenPointMass(2, pure=False)
    write_recording(env, expert, tmp_path / "seen.h5", episodes=2)
    perception = Perception(about(tmp_path / "seen.h5")[1], "rgbd")
    demos = load_demos(tmp_path / "seen.h5", perception)
    goal = np.asarray(demos.seen.vector)[:, 2:]
    red = np.asarray(demos.seen.image).reshape(-1, 32, 32, 4)[..., 0]
    row, column = np.unravel_index(red.reshape(len(red), -1).argmax(1), (32, 32))
    inside = np.abs(goal).max(1) < 0.9
    assert np.stack([column, row], 1)[inside] / 15.5 - 1 == pytest.approx(goal[inside], abs=0.06)


def test_the_actions_are_the_labels_of_a_recording_without_labels(recorded, tmp_path):
    env, file = recorded
    copy = tmp_path / "unlabelled.h5"
    copy.write_bytes(file.read_bytes())
    with h5py.File(copy, "a") as opened:
        columns = json.loads(opened.attrs["columns"])
        opened.attrs["columns"] = json.dumps([c.replace("steps/label", "steps/other") for c in columns])
        opened.move("steps/label", "steps/other")
    demos = load_demos(copy, Perception(env.observation_spaces))
    assert np.array_equal(demos.label, demos.action)


def test_broken_and_foreign_files_are_refused_with_run_and_field(recorded, tmp_path):
    env, file = recorded
    perception = Perception(env.observation_spaces)
    with pytest.raises(InputError, match='was made for robot = ""; you asked for fetch'):
        load_demos(file, perception, {**world_of(env), "robot": "fetch"})
    (tmp_path / "no.h5").write_bytes(b"nothing")
    with pytest.raises(InputError, match="is not an HDF5 file"):
        load_demos(tmp_path / "no.h5", perception)
    copy = tmp_path / "cut.h5"
    copy.write_bytes(file.read_bytes())
    with h5py.File(copy, "a") as opened:
        del opened["steps/reward/total"]
        opened["steps/reward/total"] = np.zeros((3, 2), np.float32)
    with pytest.raises(InputError, match=r"run_000000/steps/reward/total: is float32\[2\], must be float32\[\]"):
        load_demos(copy, perception)
    with h5py.File(copy, "a") as opened:
        del opened["steps/reward/total"]
        opened.create_dataset("steps/reward/total", (10**9,), np.float32)  # claimed, and not there
    with pytest.raises(InputError, match="claims 1000000000 rows that are not there"):
        load_demos(copy, perception)


@pytest.mark.slow
def test_sac_that_begins_as_a_clone_is_better_at_once(recorded):
    env, file = recorded
    perception = Perception(env.observation_spaces)
    demos = load_demos(file, perception)
    config = SACConfig(
        utd_ratio=8,
        batch_size=128,
        buffer_size=8000,
        actor_layers=(32, 32),
        critic_layers=(64, 64),
        num_atoms=51,
        critic_head_start=300,
    )
    config = dataclasses.replace(config, tau=0.02, lr=1e-3, final_lr=3e-4)
    algorithm = SAC(perception, 2, config, demos=demos)
    learner = begin_as_clone(algorithm, demos, 0, updates=400)
    result = train(PointMass(32), algorithm, Run(iterations=60, quiet=True), learner=learner)
    assert result.row["success"] > 0.85  # without demonstrations: a third
    assert int(result.learner.updates) > 600  # the actor learned, too
