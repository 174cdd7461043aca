"""The planner is an expert like others: its episodes are demonstrations, and others may act in its place."""

import numpy as np
import pytest

import ig2mj
from ig2mj.cli import call
from ig2mj.demos import Recording, replay
from ig2mj.demos.collection import collect
from ig2mj.envs.experts import expert_of
from ig2mj.envs.planned_expert import PlannedExpert
from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.learn.algorithms import config_of, make_algorithm
from ig2mj.learn.perception import Perception

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def env(tiny_home_folder):
    return ig2mj.make(f"goal/{tiny_home_folder} (on_top apple pan)", worlds=2, engine="native", pool_size=1)


@pytest.fixture(scope="module")
def collected(env, tmp_path_factory):
    file = tmp_path_factory.mktemp("planned") / "runs.h5"
    return file, collect(env, expert_of(env), file, 2, noise=0.05)


def test_its_successes_are_demonstrations_that_replay_bit_for_bit(collected):
    file, found = collected
    assert found["kept"] == 2
    with Recording(file) as recording:
        for run in recording.runs:
            assert run.success and run.complete
            action, label = run.all_rows("steps/action"), run.all_rows("steps/label")
            assert 0.0 < np.abs(label - action).mean() < 0.1, "actions have noise, labels have none"
    done = replay(file)
    assert done.runs == 2 and not done.differences


def test_it_goes_on_where_somebody_else_has_acted(tiny_home_folder):
    """Random motion in a quarter of all steps, at up to a tenth of the robot's speeds; hands stay open or shut. Without
    it an episode takes 119 steps, so that each of six worlds has time for two."""
    env = ig2mj.make(f"goal/{tiny_home_folder} (on_top apple pan)", worlds=6, engine="native", pool_size=1)
    expert, rng = expert_of(env), np.random.default_rng(0)
    assert isinstance(expert, PlannedExpert)
    state, won = env.reset(0), 0
    for step in range(300):
        label = expert(state)
        assert label.shape == (6, env.action_space.shape[0]) and np.abs(label).max() <= 1.0
        other = np.where(expert.noisy, rng.uniform(-0.1, 0.1, label.shape), label).astype(np.float32)
        state = env.step_autoreset(state, other if step % 20 < 5 else label)
        won += int(np.asarray(state.info["success"]).sum())
    assert won >= 6 and expert.planned == 2


def test_dagger_and_bc_learn_from_its_demonstrations(env, collected, tmp_path, capsys):
    file, _ = collected
    name, few = env.task.name, ["--set", "batch_size=64", "actor_layers=16"]
    bc = tmp_path / "bc"
    assert call(["train", name, "--algo", "bc", "--demos", str(file), "--out", str(bc), *few, "num_updates=100"]) == 0
    out, run = tmp_path / "dagger", ["--minutes", "0.05", "--worlds", "2", "--demos", str(file)]
    settings = ["engine=native", "buffer_size=400", "warm_up_steps=8", "utd_ratio=1", "pool_size=1"]
    assert call(["train", name, "--algo", "dagger", "--out", str(out), *run, *few, *settings]) == 0
    assert (bc / "policy.npz").exists() and (out / "policy.npz").exists()


def test_it_is_no_part_of_a_compiled_program(env, monkeypatch):
    monkeypatch.setattr(type(env), "pure", True)
    with pytest.raises(Ig2mjError, match="engine=native"):
        make_algorithm(config_of("dagger", small=True), Perception(env.observation_spaces), env)


def test_settings_of_doors_are_open_and_shut():
    with pytest.raises(UnknownNameError, match="open"):
        ig2mj.make("CookingMeat", engine="native", doors="opne")
