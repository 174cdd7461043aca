"""Faces for NumPy, PyTorch and Brax: autoreset, refused steps, and sums of an episode."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from learn.small_envs import PointMass, State

import ig2mj
from ig2mj.envs.arrays import NumpyEnv, TorchEnv
from ig2mj.envs.brax import BraxEnv
from ig2mj.errors import ActionError, EngineError

ROWS = 4
NOTHING = np.zeros((2, 6), np.float32)


@pytest.fixture(scope="module")
def short():
    """Two worlds of episodes of three steps."""
    return ig2mj.make("GraspingBook", worlds=2, pool_size=ROWS).with_horizon(3)


@pytest.mark.slow
def test_numpy_gets_fresh_arrays_and_the_last_observation_of_what_is_over(short):
    env = NumpyEnv(short)
    first, _ = env.reset(seed=0)
    kept = first["privileged_state"].copy()
    for _ in range(3):
        obs, reward, terminated, truncated, info = env.step(NOTHING)
    assert all(isinstance(a, np.ndarray) for a in (reward, terminated, truncated, *obs.values()))
    assert (terminated | truncated).all()
    assert info["final_obs"]["privileged_state"][:, -1] == pytest.approx(0.0, abs=1e-6)
    assert obs["privileged_state"][:, -1] == pytest.approx(1.0)
    assert np.array_equal(first["privileged_state"], kept)


@pytest.mark.slow
def test_without_autoreset_a_world_that_is_done_is_not_stepped(short):
    env = NumpyEnv(short, autoreset=False)
    with pytest.raises(EngineError, match="reset the environment"):
        env.step(NOTHING)
    env.reset(seed=0)
    for _ in range(3):
        env.step(NOTHING)
    with pytest.raises(EngineError, match="world 0 is done"):
        env.step(NOTHING)
    with pytest.raises(ActionError, match="mask"):
        env.reset(mask=np.ones(3, bool))
    obs, _ = env.reset(mask=np.ones(2, bool))
    assert obs["privileged_state"][:, -1] == pytest.approx(1.0)
    env.step(NOTHING)


def test_torch_gets_tensors_that_the_next_step_leaves_alone(short):
    torch = pytest.importorskip("torch")
    env = TorchEnv(short)
    obs, _ = env.reset(seed=0)
    kept = obs["privileged_state"].clone()
    _, reward, terminated, _, info = env.step(torch.zeros(2, 6))
    assert reward.dtype == torch.float32 and terminated.dtype == torch.bool
    assert torch.equal(obs["privileged_state"], kept)
    assert info["steps"].tolist() == [1, 1]


class Counted(PointMass):
    """A pure environment that says how far its episodes are."""

    period = 0.1

    def _start_fn(self, key):
        return self._told(super()._start_fn(key), jnp.zeros(self.num_worlds, jnp.int32))

    def _step_fn(self, state: State, action):
        return self._told(super()._step_fn(state, action), state.steps + 1)

    def _told(self, state, steps):
        return state.replace(info={**state.info, "steps": steps})


@pytest.fixture
def brax():
    State.done = property(lambda self: self.terminated | self.truncated)  # as `EnvState` has it
    yield BraxEnv(Counted(3, horizon=4))
    del State.done


def test_brax_s_trainers_find_what_they_look_at(brax):
    assert brax.observation_size == {"state": (2,), "privileged_state": (2,)}
    assert (brax.action_size, brax.num_envs, brax.dt) == (2, 3, 0.1)
    state = brax.reset(jax.random.split(jax.random.PRNGKey(0), 3))  # one key for each world, as its wrappers give
    assert state.obs["state"].shape == (3, 2) and state.done.dtype == jnp.float32


def test_brax_s_episodes_end_with_their_sums_and_the_next_ones_begin_elsewhere(brax):
    state = brax.reset(jax.random.PRNGKey(1))
    starts, step = [np.asarray(state.obs["state"])], jax.jit(brax.step)
    for episode in range(3):
        rewards = []
        for k in range(4):
            state = step(state, jnp.zeros((3, 2)))
            rewards.append(np.asarray(state.reward))
            assert (np.asarray(state.done) == (k == 3)).all()
        assert (np.asarray(state.info["truncation"]) == 1).all()
        assert np.asarray(state.info["episode_metrics"]["length"]).tolist() == [4, 4, 4], episode
        assert np.asarray(state.info["episode_metrics"]["sum_reward"]) == pytest.approx(np.sum(rewards, 0))
        starts.append(np.asarray(state.obs["state"]))
    assert len({s.tobytes() for s in starts}) == 4  # Brax's own wrapper would go back to the first


def test_brax_is_refused_where_nothing_can_be_compiled(short):
    with pytest.raises(EngineError, match="engine='warp'"):
        BraxEnv(short)


@pytest.mark.gpu
def test_brax_s_face_of_an_activity_compiles():
    env = BraxEnv(ig2mj.make("CookingMeat", worlds=16, engine="warp", pool_size=8))
    state = jax.jit(env.reset)(jax.random.PRNGKey(0))
    state = jax.jit(env.step)(state, jnp.zeros((16, env.action_size)))
    assert state.obs["privileged_state"].shape == (16, *env.observation_size["privileged_state"])
