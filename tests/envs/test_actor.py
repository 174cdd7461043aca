"""Who acts by a pure function and remembers (`ig2mj.envs.actor`)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.envs.actor import Actor
from ig2mj.envs.rollout import play


@pytest.mark.slow
def test_what_is_remembered_ends_with_the_episode_also_where_the_next_begins_by_itself():
    """The number that is remembered counts steps; nobody acts, so that an episode lasts for all of its 200 steps."""
    env = ig2mj.make("GraspingBook", worlds=2, engine="native", pool_size=4)
    seen = []

    def choose(obs, kept, begins, key):
        kept = jnp.where(begins[:, None], 0.0, kept + 1.0)
        return jnp.zeros((2, env.action_space.shape[0])), kept

    actor = Actor(env, choose, 1)
    state = env.reset(0)
    for _ in range(env.task.horizon + 3):
        state = env.step_autoreset(state, actor(state))
        seen.append(np.asarray(actor._kept)[:, 0])
    expected = np.arange(env.task.horizon + 3) % env.task.horizon
    np.testing.assert_array_equal(np.stack(seen), np.stack([expected, expected], axis=1))
    played = play(env, actor, 2, in_order=True)
    assert len(played.total) == 2 and (np.asarray(actor._kept) == env.task.horizon - 1).all(), (
        "and with a start from rows"
    )
