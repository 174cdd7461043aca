"""Episodes that are played, and what tasks measure of them."""

from __future__ import annotations

import time

import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.envs.experts import expert_of
from ig2mj.envs.rollout import Pace, play, resting


def test_the_first_step_does_not_count_in_the_pace(monkeypatch):
    """It compiles: RoomRearrangement's episode of 500 steps was said to run at 12 a second instead of 250."""
    clock = iter([20.0, 24.0])
    monkeypatch.setattr(time, "monotonic", lambda: next(clock))
    pace = Pace()
    assert pace.steps_per_second() == 0.0
    for _ in range(5):
        pace.stepped(3)
    assert pace.steps_per_second() == 12 / 4


def test_nobody_acts_in_a_world_whose_episode_is_over():
    """Numbers of JAX stay JAX's: those that are not finite are counted there, and refused of NumPy."""
    for xp in (np, jnp):
        action = resting(xp.array([[0.5, np.nan], [0.5, np.nan]], xp.float32), np.array([False, True]))
        assert isinstance(action, np.ndarray) == (xp is np)
        assert np.array_equal(np.asarray(action), [[0, 0], [0.5, np.nan]], equal_nan=True)


@pytest.mark.slow
def test_the_expert_lifts_the_cauldron_with_both_hands():
    env = ig2mj.make("BimanualPickAndPlace", "humanoid", 2, "native", split="held_out", pool_size=2)
    outcome = play(env, expert_of(env), 2, in_order=True)
    assert outcome.outcomes == {"success_in_hand": [True, True], "lifted_by_all": [True, True]}
    assert outcome.success == [True, True]
    rows = np.arange(2)
    start = env.start_from(rows)
    assert not np.asarray(start.info["off_floor"]).any() and not np.asarray(start.info["held_by_all"]).any()
    idle = play(env, lambda state: np.zeros((2, *env.action_space.shape), np.float32), 2, in_order=True)
    assert idle.success == idle.outcomes["lifted_by_all"] == [False, False]


@pytest.mark.slow
def test_a_book_that_was_pushed_off_is_no_success_in_the_hand():
    for grasping, in_hand in (("mitten", True), ("physical", False)):
        env = ig2mj.make("GraspingBook", "fetch", 2, "native", grasping, split="held_out", pool_size=2)
        outcome = play(env, expert_of(env), 2, in_order=True)
        assert outcome.success == [True, True]
        assert outcome.outcomes == {"success_in_hand": [in_hand, in_hand]}


@pytest.mark.slow
def test_an_episode_whose_world_is_lost_counts_as_lost_and_the_others_count_as_ever(cooking_meat):
    """Of eight episodes that ran beside each other none was counted, since the engine's error ended them all."""
    env = cooking_meat.with_horizon(6)
    still = np.zeros((2, *env.action_space.shape), np.float32)

    def played(watch=None):
        return play(env, lambda state: still, 4, in_order=True, watch=watch)

    rounds = []

    def lose_the_second(state):
        """In the first of two rounds."""
        rounds.append(int(np.asarray(state.info["steps"])[0]))
        if rounds == [0, 1, 2]:
            state.batch.world.physics.worlds[1].data.qvel[:] = np.nan

    whole, found = played(), played(lose_the_second)
    assert rounds == [0, 1, 2, 3, 4, 5, 6] * 2
    assert len(found.success) == 4 and not any(found.success)
    assert found.total[0] == whole.total[0] and found.total[2:] == whole.total[2:] and np.isfinite(found.total).all()
    assert found.metrics["not_finite"] == 1 and whole.metrics["not_finite"] == 0
