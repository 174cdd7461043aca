"""Environments of tasks in a user's file keep every promise; their recordings, policies and pools know their code."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest
from own_tasks import write_task

import ig2mj
from ig2mj.demos import Recording, Replayer
from ig2mj.errors import EngineError, InputError
from ig2mj.learn.checkpoints import refuse_difference
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import depends_on
from ig2mj.tasks.custom.files import VARIABLE
from ig2mj.tasks.registry import REGISTERED
from ig2mj.testing import api_test

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def file(tmp_path_factory, tiny_home_folder) -> pathlib.Path:
    return write_task(tmp_path_factory.mktemp("own"), tiny_home_folder)


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("cache")
        patch.setenv("IG2MJ_CACHE_DIR", str(folder))
        yield folder


@pytest.fixture(scope="module")
def env(file, cache):
    return ig2mj.make(f"{file}:AppleToFloor", worlds=2, engine="native", pool_size=1)


def test_it_keeps_every_promise(env):
    assert env.objective.terms == ("reach", "effort") and env.robot == "humanoid"
    assert env.privileged_names == ("apple_x", "apple_y", "apple_z", "held", "left")
    api_test(env, steps=3)


def test_rewards_are_those_of_the_class(env):
    state = env.reset(0)
    before = np.asarray(state.measures.own["reach"])
    action = np.full((2, *env.action_space.shape), 0.5, np.float32)
    state = env.step(state, action)
    effort = -0.01 * 0.25 * action.shape[1]
    assert np.asarray(state.info["reward/effort"]) == pytest.approx(effort)
    assert np.asarray(state.info["reward/reach"]) == pytest.approx(before - np.asarray(state.measures.own["reach"]))
    assert np.asarray(state.reward) == pytest.approx(np.asarray(state.info["reward/reach"]) + effort)


def test_functions_of_make_take_the_place_of_the_tasks(file, cache):
    def apple(world):
        return world.com("apple")

    env = ig2mj.make(
        f"{file}:AppleToFloor",
        pool_size=1,
        engine="native",
        reward=lambda world: world.com("apple")[:, 2],
        terminated=lambda world: world.com("apple")[:, 2] > 0.1,
        observations=("proprioception", apple),
    )
    state = env.reset(0)
    state = env.step(state, np.zeros((1, *env.action_space.shape), np.float32))
    assert set(state.obs) == {"proprioception", "apple"}
    assert np.asarray(state.reward) == pytest.approx(np.asarray(state.obs["apple"])[:, 2])
    assert np.asarray(state.terminated).all() and not np.asarray(state.info["success"]).any()
    with pytest.raises(EngineError, match="a function with a name"):
        ig2mj.make(f"{file}:AppleToFloor", pool_size=1, observations=[lambda world: world.com("apple")])
    with pytest.raises(EngineError, match="reward = 5: a function"):
        ig2mj.make(f"{file}:AppleToFloor", pool_size=1, reward=5)


def test_a_reward_that_is_not_finite_ends_the_step_with_its_name(file, cache):
    env = ig2mj.make(
        f"{file}:AppleToFloor", pool_size=1, engine="native", reward=lambda world: world.zeros() / world.zeros()
    )
    state = env.reset(0)
    with pytest.raises(InputError, match="is nan in world 0, and must be finite"):
        env.step(state, np.zeros((1, *env.action_space.shape), np.float32))


def test_another_version_of_the_file_is_refused(env, file, tmp_path, tiny_home_folder, cache, monkeypatch):
    runs = tmp_path / "runs.h5"
    recorded = ig2mj.record(env, runs)
    state = recorded.reset(0)
    recorded.step(state, np.zeros((2, *env.action_space.shape), np.float32))
    recorded.close()
    perception = Perception(env.observation_spaces, "state")
    depends = depends_on(env, perception)
    assert depends["task_file"] == "my_tasks.py" and len(depends["task_code"]) == 32

    with Recording(runs) as recording:
        assert Replayer(recording)(check=True).differences == []
        monkeypatch.delitem(REGISTERED, "AppleToFloor")
        monkeypatch.delenv(VARIABLE, raising=False)
        with pytest.raises(InputError, match=r"in my_tasks\.py, which is read only where you name it .*--task PATH"):
            Replayer(recording)
        text = file.read_text().replace("-0.01", "-0.02")
        changed = tmp_path / "my_tasks.py"
        changed.write_text(text)
        other = ig2mj.make(f"{changed}:AppleToFloor", worlds=2, engine="native", pool_size=1)
        with pytest.raises(InputError, match=r"what determines AppleToFloor in my_tasks\.py has changed since"):
            Replayer(recording)
    with pytest.raises(InputError, match=r"what determines AppleToFloor in my_tasks\.py has changed since"):
        refuse_difference("policy.npz", depends, depends_on(other, perception))


START = '''
import ig2mj


class Beside(ig2mj.CustomTask):
    """The apple begins next to the box."""

    home = "{home}"
    goal = "(on_floor apple kitchen_0)"
    robots = {{"humanoid": (0.0, -1.0, 90.0)}}
    LEFT = 0.12

    def start(self, home, rng):
        home.sample("(on_top box table)")
        home.put("apple", home.pos("box") + (rng.uniform(-0.01, 0.01), self.LEFT, 0.06))
        home.settle()
        return home.holds("(on_top apple table)")
'''


def test_a_start_of_the_class_makes_the_start_states(tmp_path, tiny_home_folder, cache):
    from ig2mj.envs.registry import find_task
    from ig2mj.tasks.pools import check_pool, pool_of, start_states
    from ig2mj.worlds.pool import load_pool

    file = write_task(tmp_path, tiny_home_folder, START, "starts.py")
    task = find_task(f"{file}:Beside")
    pool = pool_of(task, count=2)
    scene = start_states(task).scene
    names = [scene.model.joint(f"{name}/free").qposadr[0] for name in ("apple", "box")]
    apple, box = (np.asarray(pool.physics.scene.qpos)[:, at : at + 3] for at in names)
    assert np.abs((apple - box)[:, 1] - 0.12) == pytest.approx(np.zeros(2), abs=0.05)
    assert not np.allclose(apple[0], apple[1])
    kept = start_states(task).cached
    assert load_pool(kept, scene).starts is not None
    check_pool(task, load_pool(kept, scene))

    file.write_text(file.read_text().replace("LEFT = 0.12", "LEFT = -0.12"))
    changed = find_task(f"{file}:Beside")
    assert start_states(changed).cached != kept
    with pytest.raises(InputError, match=r"starts\.py: Beside: what determines the start states has changed"):
        check_pool(changed, load_pool(kept, scene))
