"""Gymnasium's face: names, its own checker, images, seeds, and the three autoreset modes of vector environments."""

from __future__ import annotations

import subprocess
import sys
import types

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import ig2mj.envs.gymnasium
from ig2mj.envs.registry import find_task
from ig2mj.errors import EngineError, UnknownNameError

ID = "ig2mj/CookingMeat-v0"  # its programs are those of other files' environments, and compiled already
ROWS = 4
NOTHING = np.zeros((2, 6), np.float32)


@pytest.fixture(scope="module")
def made():
    env = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="vector_entry_point", pool_size=ROWS)
    env.env = env.env.with_horizon(3)
    return env


@pytest.fixture
def short(made):
    """Two worlds of episodes of three steps, in an autoreset mode; compiled once for all of them."""

    def of(mode: AutoresetMode) -> gymnasium.vector.VectorEnv:
        made.autoreset_mode = mode
        return made

    return of


def time_left(obs):
    return pytest.approx(obs["privileged_state"][:, -1], abs=1e-6)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*Box observation space:UserWarning")  # vectors have no bounds
def test_gymnasium_s_checker_is_content():
    env = gymnasium.make(ID, pool_size=ROWS, render_mode="rgb_array")
    check_env(env.unwrapped)
    env.close()
    env.close()


@pytest.mark.slow
def test_same_step_gives_the_last_observation_beside_the_new_one(short):
    env = short(AutoresetMode.SAME_STEP)
    env.reset(seed=0)
    for _ in range(3):
        obs, _, terminated, truncated, info = env.step(NOTHING)
    assert (terminated | truncated).all()
    assert info["_final_obs"].all()
    assert time_left(info["final_obs"]) == [0.0, 0.0]
    assert time_left(obs) == [1.0, 1.0]


def test_next_step_resets_in_the_step_after(short):
    env = short(AutoresetMode.NEXT_STEP)
    env.reset(seed=0)
    for _ in range(3):
        obs, _, _, truncated, _ = env.step(NOTHING)
    assert truncated.all() and time_left(obs) == [0.0, 0.0]
    obs, reward, terminated, truncated, _ = env.step(NOTHING)
    assert not (terminated | truncated).any() and not reward.any()
    assert time_left(obs) == [1.0, 1.0]


def test_disabled_leaves_resets_to_a_mask(short):
    env = short(AutoresetMode.DISABLED)
    env.reset(seed=0)
    for _ in range(3):
        env.step(NOTHING)
    obs, _ = env.reset(options={"reset_mask": np.array([True, False])})
    assert time_left(obs) == [1.0, 0.0]


def test_a_version_that_does_not_exist_is_unknown():
    with pytest.raises(UnknownNameError):
        find_task("ig2mj/GraspingBook-v7")


@pytest.mark.parametrize("modules", ["gymnasium, ig2mj", "ig2mj, gymnasium"])
def test_names_are_known_in_whichever_order_both_are_imported(modules):
    code = f"import {modules}, sys; sys.exit('{ID}' not in gymnasium.registry or 'jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_gymnasium_imports_ig2mj_for_a_name_with_a_module():
    code = f"import gymnasium; gymnasium.make('ig2mj:{ID}', robt='fetch')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "is named 'robt'; near matches: robot, " in done.stderr.splitlines()[-1], done.stderr


@pytest.mark.slow
def test_each_world_starts_as_an_environment_of_one_world_with_its_seed(made):
    one = gymnasium.make(ID, pool_size=ROWS)
    seeds = [7, 11]
    obs, _ = made.reset(seed=seeds)
    for world, seed in enumerate(seeds):
        alone, _ = one.reset(seed=seed)
        for name, array in alone.items():
            assert array == pytest.approx(obs[name][world], abs=1e-5), (name, seed)
    again, _ = made.reset(seed=[11, 7])
    assert np.array_equal(again["privileged_state"], obs["privileged_state"][::-1])


def test_seeds_of_masked_worlds_leave_the_others_alone(made):
    before, _ = made.reset(seed=[7, 11])
    after, _ = made.reset(seed=[3, 7], options={"reset_mask": np.array([False, True])})
    assert np.array_equal(after["privileged_state"], before["privileged_state"][[0, 0]])


def test_seeds_may_be_left_to_chance_and_must_be_one_for_each_world(made):
    made.reset(seed=[None, 4])
    with pytest.raises(EngineError, match="2 whole numbers, one for each world"):
        made.reset(seed=[1, 2, 3])


def test_frames_per_second_horizon_and_speed_follow_the_period():
    env = gymnasium.make(ID, pool_size=ROWS, period=1 / 30)
    usual = find_task("CookingMeat").horizon
    assert env.unwrapped.env.task.horizon == 3 * usual
    assert env.metadata["render_fps"] == pytest.approx(30)
    assert env.unwrapped.env.action_map.scale[0] == pytest.approx(0.5 / 30)  # m in an action, at 0.5 m/s


def test_another_render_mode_is_refused():
    with pytest.raises(UnknownNameError, match="near matches: rgb_array"):
        ig2mj.envs.gymnasium.GymEnv("CookingMeat", render_mode="rgb_aray", pool_size=ROWS)


class Clip:
    """In place of MoviePy's: keeps what it is given."""

    written: list[tuple[int, float]] = []  # noqa: RUF012

    def __init__(self, frames, fps):
        assert all(frame.shape == (480, 640, 3) and frame.dtype == np.uint8 for frame in frames)
        assert any((frame != frames[0]).any() for frame in frames), "nothing moves in the video"
        self.written.append((len(frames), fps))

    def write_videofile(self, path, logger=None):
        """Nothing is written."""


@pytest.mark.slow
def test_gymnasium_records_videos(monkeypatch, tmp_path):
    """`RecordVideo` with a stand-in for MoviePy; with MoviePy itself: tests/interop/gymnasium_video."""
    for name in ("moviepy", "moviepy.video", "moviepy.video.io", "moviepy.video.io.ImageSequenceClip"):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    monkeypatch.setattr(sys.modules["moviepy.video.io.ImageSequenceClip"], "ImageSequenceClip", Clip, raising=False)
    env = gymnasium.make(ID, pool_size=ROWS, render_mode="rgb_array")
    video = gymnasium.wrappers.RecordVideo(env, str(tmp_path / "videos"), video_length=2, disable_logger=True)
    video.reset(seed=0)
    for _ in range(2):
        video.step(np.ones(6, np.float32))
    video.close()
    assert Clip.written == [(3, 10.0)]


def test_without_a_render_mode_there_is_no_image(made):
    made.reset(seed=0)
    assert made.render() is None


ASYNC = f"""
import sys, warnings, gymnasium, ig2mj
if __name__ == "__main__":
    warnings.simplefilter("ignore")
    how = dict(vector_kwargs={{"context": sys.argv[1]}}, pool_size={ROWS})
    env = gymnasium.make_vec("ig2mj/PointNavigation-v0", num_envs=2, vectorization_mode="async", **how)
    obs, _ = env.reset(seed=3)
    print(obs["proprioception"].shape[0])
    env.close()
"""


@pytest.mark.slow
@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_asynchronous_environments_are_spawned_or_refused(context, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(ASYNC)
    done = subprocess.run([sys.executable, program, context], capture_output=True, text=True, timeout=200)
    if context == "spawn":
        assert done.stdout.split() == ["2"], done.stderr[-2000:]
    else:
        assert "EngineError: this process was forked" in done.stderr.splitlines()[-1]
