"""What is learnt before the first step, and beside the pictures (`ig2mj.learn.looking`, `DaggerConfig.told`)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from small_envs import SeenPointMass

from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.iteration import OneDevice
from ig2mj.learn.labels import Imitation, Labels
from ig2mj.learn.looking import look, start_pictures
from ig2mj.learn.moments import Moments
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.projection import Lens

NAMES = [*(f"goal_pos_{c}" for c in "xyz"), *(f"goal_quat_{c}" for c in "wxyz")]


def expert(state):
    return jnp.clip(10 * (state.goal - state.pos), -1, 1)


def dagger(env: Any, **settings) -> Any:
    config = DaggerConfig(batch=32, actor=(8,), shift=0, updates=1, **settings)
    perception = Perception(env.observation_spaces, "rgbd")
    starts = start_pictures(env, perception, config.starts) if config.starts else None
    return Dagger(perception, 2, expert, config, starts=starts)


@pytest.mark.slow
def test_who_looks_at_start_states_knows_where_things_are_before_the_first_step():
    env: Any = SeenPointMass(16, pure=False)
    algorithm = dagger(env, starts=200, look=100)
    starts = algorithm.starts
    assert starts is not None and len(np.unique(starts.vector, axis=0)) == 200
    learner = look(algorithm, 0, lambda *_: None)
    assert int(learner.updates) == 0, "the first labels are the expert's"
    np.testing.assert_allclose(learner.moments.mean, np.asarray(starts.vector).mean(0), atol=1e-5)
    unseen = algorithm.perception(env.reset(5).obs)

    @jax.jit
    def off(actor):
        own = learner.moments.normal(unseen.vector)
        guess = algorithm.actor.apply({"params": actor}, own[:, :2], unseen.picture)[2]
        return jnp.abs(guess - own[:, 2:]).mean()

    assert off(learner.actor) < 0.6 * off(algorithm.init(jax.random.PRNGKey(0)).actor)
    step = OneDevice(env, algorithm)
    learner, memory = step.place(learner, step.memory())
    assert memory.starts.vector.shape == (200, 4)
    *_, losses, _ = step(learner, memory, step.begin(0), jax.random.PRNGKey(0), 0.0, True)
    assert losses["updates"] == 4 and losses["guess_loss"] > 0


def test_pictures_of_an_opening_are_of_an_experts_first_steps():
    env: Any = SeenPointMass(16, pure=False)
    perception = Perception(env.observation_spaces, "rgbd")
    found = start_pictures(env, perception, 90, expert, opening=20)
    starts = start_pictures(env, perception, 32)
    assert found.vector.shape == (90, 4) and found.picture.shape[0] == 90
    rounds = [found.vector[k : k + 16] for k in range(0, 90, 16)]
    np.testing.assert_array_equal(np.concatenate([rounds[0], rounds[3]]), starts.vector)
    apart = [np.abs(r[:, :2] - r[:, 2:]).mean() for r in rounds[:3]]
    assert apart[1] < 0.7 * apart[0], "the expert goes to the goal"
    with pytest.raises(AssertionError, match="expert"):
        start_pictures(env, perception, 32, opening=7)


def test_openings_without_start_states_and_start_states_on_several_devices_are_refused():
    env: Any = SeenPointMass(4, pure=False)
    perception = Perception(env.observation_spaces, "rgbd")
    with pytest.raises(Ig2mjError, match="opening=30"):
        Dagger(perception, 2, expert, DaggerConfig(opening=30))
    starts = start_pictures(env, perception, 4)
    with pytest.raises(Ig2mjError, match="for one device"):
        Dagger(perception, 2, expert, DaggerConfig(starts=4), "devices", starts)


@pytest.mark.slow
def test_an_actor_that_is_told_what_is_hidden_learns_labels_without_pictures():
    spaces = {**SeenPointMass.observation_spaces, "privileged_state": Space((7,), np.float32, -np.inf, np.inf)}
    ahead = Lens((0.0, 0.0, 0.0), ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (1.0, 1.0), 16, (0, 16))
    perception = Perception(spaces, "rgbd", 16, None, NAMES, ahead)
    imitation = Imitation(perception, 2, DaggerConfig(actor=(32,), net="glimpses", shift=0, choices=0))
    params, _ = jax.jit(imitation.init)(jax.random.PRNGKey(0))
    moments, rng = Moments.initial(9), np.random.default_rng(0)
    vector = jnp.asarray(rng.uniform(-1, 1, (64, 9)), jnp.float32)
    label = 0.8 * vector[:, 2:4]
    hidden, actor = perception.hidden, imitation.actor
    assert hidden is not None
    guess = hidden(vector, moments.normal(vector), actor.guess + 2 * actor.objects)
    guess += jnp.asarray(rng.normal(0.0, 0.3, guess.shape), jnp.float32)
    seen, none = Seen(vector[:4], jnp.zeros((4, 16 * 16 * 4), jnp.uint8)), label[:4]

    def loss(params, key, told):
        return imitation.loss(params, moments, seen, none, key, told)

    found = jax.eval_shape(lambda k: loss(params, k, None)[1], jax.random.PRNGKey(0))
    assert "told_loss" not in found
    both, told = jax.jit(jax.value_and_grad(lambda *a: loss(*a)[1]["told_loss"])), []
    for k in range(60):
        value, slope = both(params, jax.random.PRNGKey(k), (vector, label, jnp.zeros((64, 0)), guess))
        told.append(float(value))
        params = jax.tree.map(lambda a, s: a - 0.2 * s, params, slope)
    assert all((np.asarray(a) == 0).all() for a in jax.tree.leaves(slope["encoder"])), "pictures have no part in it"
    assert np.mean(told[-5:]) < 0.6 * told[0], "though what it is told is not right"


def test_what_an_actor_is_told_it_guessed_in_that_very_step():
    perception = Perception(SeenPointMass.observation_spaces, "rgbd")
    labels = Labels.empty(4, 3, perception, 2, guess=5)
    vector = jnp.arange(2 * 3 * perception.vector_size, dtype=jnp.float32).reshape(2, 3, -1)
    seen = Seen(vector, jnp.zeros((2, 3, labels.picture.shape[-1]), jnp.uint8))
    labels = labels.insert(seen, vector[..., :2], guess=vector[..., :1] + jnp.arange(5.0))
    found, label, recalled, guess = labels.told(jax.random.PRNGKey(0), 64)
    assert len(np.unique(found[:, 0])) == 6 and recalled.shape == (64, 0)
    np.testing.assert_array_equal(label, found[:, :2])
    np.testing.assert_array_equal(guess, found[:, :1] + np.arange(5.0))


def test_what_cannot_be_looked_at_or_told_is_refused():
    env = SeenPointMass(2)
    with pytest.raises(Ig2mjError, match="no start states"):
        dagger(env, look=5)
    with pytest.raises(Ig2mjError, match="glimpses"):
        dagger(env, told=64)
