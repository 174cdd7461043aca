"""Gymnasium's face: its own checker, and the three autoreset modes of vector environments."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import ig2mj.envs.gymnasium  # noqa: F401  makes the environments known
from ig2mj.envs.registry import find_task
from ig2mj.errors import UnknownNameError

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
    env = gymnasium.make(ID, pool_size=ROWS)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()
    env.close()


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
