"""Learning on small environments, where what is right is known."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import FarReward, FarRewardThatEnds, PointMass

from ig2mj.envs.observations import Space
from ig2mj.learn.collect import GUIDED, Advice, Transition
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.guidance import guided, remaining, uncounted
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.policies import Policy, depends_on
from ig2mj.learn.ppo import PPO, PPOConfig
from ig2mj.learn.sac import SAC, SACConfig
from ig2mj.learn.train import Run, train

SMALL_SAC = SACConfig(
    utd_ratio=8,
    batch_size=128,
    buffer_size=20_000,
    actor_layers=(64, 64),
    critic_layers=(64, 64),
    num_atoms=51,
    tau=0.02,
    lr=1e-3,
)
SMALL_PPO = PPOConfig(rollout_length=16, minibatches=4, actor_layers=(64, 64), critic_layers=(64, 64), lr=1e-3)


def made(env, kind, mode="state", **changes):
    config = dataclasses.replace(SMALL_SAC if kind is SAC else SMALL_PPO, **changes)
    return kind(Perception(env.observation_spaces, mode), env.action_space.shape[0], config)


def quiet(**settings):
    return Run(**{"minutes": 3.0, "quiet": True, "stop_at_success": 0.95, **settings})


@pytest.mark.parametrize(("kind", "iterations"), [pytest.param(SAC, 150, marks=pytest.mark.slow), (PPO, 150)])
def test_a_point_learns_to_reach_its_goal(kind, iterations):
    """Sixteen thousand steps are enough for SAC, about nine thousand were seen; PPO takes ten times as many."""
    env = PointMass(64)
    result = train(env, made(env, kind), quiet(iterations=iterations))
    assert result.stopped == "solved"
    assert result.row["success"] >= 0.95


@pytest.mark.slow
def test_an_environment_that_cannot_be_compiled_is_learned_by_the_same_loop():
    env = PointMass(64, pure=False)
    result = train(env, made(env, PPO), quiet(iterations=150))
    assert result.stopped == "solved"
    assert 0 < result.row["simulator_share"] < 1


@pytest.mark.slow
@pytest.mark.parametrize("kind", [SAC, PPO])
@pytest.mark.parametrize("env_kind", [FarReward, FarRewardThatEnds])
def test_a_time_limit_is_no_end(kind, env_kind):
    """What lies beyond the limit counts: the point goes right. Where the limit is called an end, it goes left."""
    env = env_kind(64)
    algorithm = made(env, kind, gamma=0.9)
    result = train(env, algorithm, quiet(iterations=120 if kind is SAC else 150, stop_at_success=None))
    policy = Policy.of(algorithm, result.learner, depends_on(env, algorithm.perception), {})
    places = np.linspace(0.05, 0.25, 5, dtype=np.float32)[:, None]
    action = np.asarray(policy.actor(algorithm.perception)({"proprioception": places}))
    if env_kind is FarReward:
        assert (action > 0.2).all()
    else:
        assert (action < -0.2).all()


@pytest.mark.slow
@pytest.mark.parametrize(("pure", "choices"), [(True, 21), (True, 0), (False, 21)])
def test_an_expert_that_answers_in_any_state_is_imitated(pure, choices, tmp_path):
    """Also by a loop in which the expert is asked outside of compiled programs; and by the policy's file."""
    env = PointMass(32, pure=pure)
    config = DaggerConfig(
        utd_ratio=4, batch_size=64, buffer_size=4000, actor_layers=(64, 64), beta_decay=0.5, action_bins=choices
    )

    def expert(state):
        return jnp.clip(10 * (state.goal - state.pos), -1, 1)

    algorithm = Dagger(Perception(env.observation_spaces), 2, expert, config, horizon=env.horizon)
    result = train(
        env, algorithm, quiet(iterations=80, stop_at_success=None)
    )  # success counts once a horizon has passed unaided
    assert result.row["label_error"] < 0.1
    assert result.row["success"] > 0.9  # the expert itself acts no more since half of the run
    Policy.of(algorithm, result.learner, depends_on(env, algorithm.perception), {}).save(tmp_path / "policy.npz")
    choose = Policy.load(tmp_path / "policy.npz").actor(algorithm.perception)
    state = env.reset(1)
    assert np.abs(np.asarray(choose(state.obs)) - np.asarray(expert(state))).mean() < 0.15


@pytest.mark.slow
@pytest.mark.parametrize("pure", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_an_expert_begins_episodes_and_leaves_them_to_the_policy(pure):
    """Without it the same run reaches a third; the success reported is of episodes without the expert."""
    env = PointMass(64, pure=pure)

    def expert(state):
        return jnp.clip(10 * (state.goal - state.pos), -1, 1)

    config = dataclasses.replace(SMALL_SAC, expert_decay=0.6, expert_steps=15, bc_coef=5.0)
    algorithm = SAC(Perception(env.observation_spaces), 2, config, adviser=expert, horizon=env.horizon)
    result = train(env, algorithm, quiet(iterations=60, stop_at_success=None))
    assert result.row["success"] > 0.9
    assert result.row["bc_loss"] < 0.2


def test_the_success_that_is_reported_is_not_too_high_when_the_experts_help_ends():
    """All worlds begin alone at one moment; successes take 5 to 35 steps, failures 200; half of the episodes fail."""
    rng = np.random.default_rng(0)
    worlds, end = 2000, 1000
    left, wins = np.zeros(worlds, int), np.zeros(worlds, bool)
    handover, helpless = jnp.zeros((2, worlds), jnp.int32)
    counted, naive = [], []
    for step in range(end + 100):
        over = left == 0
        limit = jnp.float32(30 if step < end else 0)
        fresh = np.where(rng.random(worlds) < 0.1, -1, 30 if step < end else 0)
        handover = jnp.where(over, fresh, handover)
        wins = np.where(over, (rng.random(worlds) < 0.5) | (np.asarray(handover) > 0), wins)
        left = np.where(over, np.where(wins, rng.integers(5, 36, worlds), 200), left) - 1
        apart, helpless = uncounted(handover >= 0, helpless, jnp.round(limit) > 0, 200)
        done = left == 0
        if step >= end - 200:
            counted.append(wins[done & ~np.asarray(apart)])
            naive.append(wins[done & ~(np.asarray(handover) > 0)])
    assert abs(np.concatenate(counted).mean() - 0.5) < 0.06
    assert np.concatenate(naive).mean() > 0.6
    for _ in range(200):
        apart, helpless = uncounted(handover >= 0, helpless, jnp.bool_(False), 200)
    assert not np.asarray(apart).any()


@pytest.mark.slow
def test_dagger_s_reported_success_is_not_too_high_when_the_expert_leaves():
    """Of episodes without the expert half succeed, after 5 to 35 steps; the others take 200. With it all succeed."""
    rng, worlds, leaves = np.random.default_rng(0), 1000, 600
    perception = Perception({"proprioception": Space((2,), np.float32, -1.0, 1.0)})
    algorithm = Dagger(perception, 1, None, DaggerConfig(actor_layers=(4,), beta_decay=0.6, action_bins=0), horizon=200)
    learner, turns = jax.jit(algorithm.init)(jax.random.PRNGKey(0)), algorithm.acting_state(worlds)
    learner = dataclasses.replace(learner, updates=jnp.int32(10_000))
    act, seen = jax.jit(algorithm.act), Seen(jnp.zeros((worlds, 2)), jnp.zeros((worlds, 0), jnp.uint8))
    steps, wins = np.ones(worlds, int), rng.random(worlds) < 0.1
    left = np.where(wins, 20, rng.integers(1, 201, worlds))  # some ended before, others not
    counted, naive = [], []
    for step in range(leaves + 100):
        learner = dataclasses.replace(learner, progress=jnp.float32(step / 1000))
        advice = Advice(jnp.asarray(steps), jnp.zeros((worlds, 1)))
        if step == 0:  # soon after the first update those that succeed have ended, and no others
            early = dataclasses.replace(learner, updates=jnp.int32(100))
            assert act(early, turns, seen, jax.random.PRNGKey(step), advice)[1][GUIDED].all()
        _, extra, turns = act(learner, turns, seen, jax.random.PRNGKey(step), advice)
        helped = np.asarray(turns.helped)
        left = np.where(helped & ~wins, np.minimum(left, 20), left) - 1
        wins |= helped
        done, steps = left == 0, steps + 1
        if step >= leaves - 200:
            counted.append(wins[done & ~np.asarray(extra[GUIDED])])
            naive.append(wins[done & ~helped])
        steps = np.where(done, 0, steps)
        wins = np.where(done, rng.random(worlds) < 0.5, wins)
        left = np.where(done, np.where(wins, rng.integers(5, 36, worlds), 200), left)
    # A little less than half: fewer and fewer of those that begin are of the tenth that counts, and successes are new.
    assert 0.35 < np.concatenate(counted).mean() < 0.53
    assert np.concatenate(naive).mean() > 0.62


def test_the_expert_acts_up_to_the_handover_and_less_as_the_run_goes_on():
    action, label = jnp.zeros((1000, 2)), jnp.ones((1000, 2))
    first, nothing = jnp.zeros(1000, jnp.int32), jnp.zeros(1000, jnp.int32)
    key = jax.random.PRNGKey(0)
    chosen, found, handover = guided(key, action, Advice(first, label), nothing, jnp.float32(20), 0.0)
    assert np.array_equal(chosen[:, 0] == 1, handover > 0) and np.array_equal(found, label)
    assert 0.05 < (np.asarray(handover) == -1).mean() < 0.15 and int(handover.max()) == 20
    chosen, _, same = guided(key, action, Advice(first + 10, label), handover, jnp.float32(20), 0.0)
    assert np.array_equal(same, handover)  # drawn once in an episode
    assert np.array_equal(chosen[:, 0] == 1, handover > 10)
    _, _, late = guided(key, action, Advice(first, label), nothing, jnp.float32(0), 0.0)
    assert set(np.asarray(late).tolist()) == {-1, 0}  # the same tenth is marked when there is no help any more
    limits = [float(remaining(jnp.float32(p), 0.5)) for p in (0.0, 0.25, 0.5, 1.0)]
    assert limits == [1.0, 0.5, 0.0, 0.0]


def test_dagger_s_actor_is_a_running_mean_of_what_it_learns():
    """Plain at first; later each iteration counts as its updates do among `average`."""
    perception = Perception({"proprioception": Space((2,), np.float32, -1.0, 1.0)})
    config = DaggerConfig(
        actor_layers=(4,),
        action_bins=0,
        average_updates=16,
        rollout_length=2,
        utd_ratio=2,
        batch_size=8,
        buffer_size=16,
    )
    algorithm = Dagger(perception, 1, None, config)
    learner, memory = jax.jit(algorithm.init)(jax.random.PRNGKey(0)), algorithm.buffer(4)
    learn, rng = jax.jit(algorithm.learn), np.random.default_rng(0)
    quick, mean = [], None
    for k in range(12):
        seen = Seen(jnp.asarray(rng.normal(size=(2, 4, 2)), jnp.float32), jnp.zeros((2, 4, 0), jnp.uint8))
        label, no, none = seen.vector[..., :1], jnp.zeros((2, 4), bool), jnp.zeros((2, 4))
        rollout = Transition(seen, label, {"label": label}, none, no, no, seen)
        learner, memory, _ = learn(learner, memory, rollout, jax.random.PRNGKey(k), jnp.float32(0.1), jnp.bool_(k > 0))
        if k == 0:  # labels are gathered
            np.testing.assert_array_equal(*(ravel_pytree(tree)[0] for tree in (learner.actor, learner.last)))
            continue
        quick.append(ravel_pytree(learner.last)[0])
        mean = np.mean(quick, axis=0) if k <= 4 else 0.75 * mean + 0.25 * quick[-1]
        np.testing.assert_allclose(ravel_pytree(learner.actor)[0], mean, atol=1e-6)
    assert np.abs(mean - quick[-1]).max() > 1e-4
