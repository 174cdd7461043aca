"""What is learned before the first step, and without images (`imageless_batch`)."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from small_envs import SeenPointMass

from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError
from ig2mj.learn.algorithms import check_settings
from ig2mj.learn.dagger import Dagger, DaggerConfig
from ig2mj.learn.imitation import Imitation
from ig2mj.learn.imitation_buffer import ImitationBuffer
from ig2mj.learn.iteration import OneDevice
from ig2mj.learn.occlusion import OcclusionConfig, glimpses
from ig2mj.learn.occlusion.encoder_pretraining import pretrain, start_images
from ig2mj.learn.occlusion.projection import CameraProjection, with_object_targets
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.running_stats import RunningStats
from ig2mj.learn.sac import SACConfig

NAMES = [*(f"goal_pos_{c}" for c in "xyz"), *(f"goal_quat_{c}" for c in "wxyz")]


def expert(state):
    return jnp.clip(10 * (state.goal - state.pos), -1, 1)


def dagger(env: Any, images: int = 0, **settings) -> Any:
    config = DaggerConfig(batch_size=32, actor_layers=(8,), image_shift=0, utd_ratio=1, **settings)
    perception = Perception(env.observation_spaces, "rgbd")
    return Dagger(perception, 2, expert, config, unlabelled=start_images(env, perception, images) if images else None)


@pytest.mark.slow
def test_who_looks_at_start_states_knows_where_things_are_before_the_first_step():
    env: Any = SeenPointMass(16, pure=False)
    algorithm = dagger(env, 200)
    starts = algorithm.unlabelled
    assert starts is not None and len(np.unique(starts.vector, axis=0)) == 200
    learner = pretrain(algorithm, 100, 0, lambda *_: None)
    assert int(learner.updates) == 0, "the first labels are the expert's"
    np.testing.assert_allclose(learner.moments.mean, np.asarray(starts.vector).mean(0), atol=1e-5)
    unseen = algorithm.perception(env.reset(5).obs)

    @jax.jit
    def off(actor):
        own = learner.moments.normal(unseen.vector)
        guess = algorithm.actor.apply({"params": actor}, own[:, :2], unseen.image)[2]
        return jnp.abs(guess - own[:, 2:]).mean()

    assert off(learner.actor) < 0.6 * off(jax.jit(algorithm.init)(jax.random.PRNGKey(0)).actor)
    step = OneDevice(env, algorithm)
    learner, memory = step.place(learner, step.buffer())
    assert memory.unlabelled.vector.shape == (200, 4)
    *_, losses, _ = step(learner, memory, step.begin(0), jax.random.PRNGKey(0), 0.0, True)
    assert losses["updates"] == 4 and losses["prediction_loss"] > 0


def test_pictures_of_an_opening_are_of_an_experts_first_steps():
    env: Any = SeenPointMass(16, pure=False)
    perception = Perception(env.observation_spaces, "rgbd")
    found = start_images(env, perception, 90, expert, expert_steps=20)
    starts = start_images(env, perception, 32)
    assert found.vector.shape == (90, 4) and found.image.shape[0] == 90
    rounds = [found.vector[k : k + 16] for k in range(0, 90, 16)]
    np.testing.assert_array_equal(np.concatenate([rounds[0], rounds[3]]), starts.vector)
    apart = [np.abs(r[:, :2] - r[:, 2:]).mean() for r in rounds[:3]]
    assert apart[1] < 0.7 * apart[0], "the expert goes to the goal"
    with pytest.raises(AssertionError, match="expert"):
        start_images(env, perception, 32, expert_steps=7)


def test_images_without_labels_on_several_devices_are_refused():
    env: Any = SeenPointMass(4, pure=False)
    perception = Perception(env.observation_spaces, "rgbd")
    with pytest.raises(Ig2mjError, match="for one device"):
        Dagger(perception, 2, expert, DaggerConfig(), "devices", start_images(env, perception, 4))


@pytest.mark.slow
def test_an_actor_that_is_told_what_is_hidden_learns_labels_without_pictures():
    spaces = {**SeenPointMass.observation_spaces, "privileged_state": Space((7,), np.float32, -np.inf, np.inf)}
    axes = ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    ahead = CameraProjection((0.0, 0.0, 0.0), axes, (1.0, 1.0), 16, (0, 16))
    perception = with_object_targets(Perception(spaces, "rgbd", 16, None, NAMES), NAMES, ahead)
    config = DaggerConfig(actor_layers=(32,), encoder="glimpses", image_shift=0, action_bins=0)
    imitation = Imitation(perception, 2, config, encoder=glimpses.encoder_of(perception))
    params, _ = jax.jit(imitation.init)(jax.random.PRNGKey(0))
    moments, rng = RunningStats.initial(9), np.random.default_rng(0)
    vector = jnp.asarray(rng.uniform(-1, 1, (64, 9)), jnp.float32)
    label = 0.8 * vector[:, 2:4]
    targets = perception.targets
    assert targets is not None
    guess = targets(vector, moments.normal(vector))
    guess += jnp.asarray(rng.normal(0.0, 0.3, guess.shape), jnp.float32)
    seen, none = Seen(vector[:4], jnp.zeros((4, 16 * 16 * 4), jnp.uint8)), label[:4]

    def loss(params, key, told):
        return imitation.loss(params, moments, seen, none, key, told)

    found = jax.eval_shape(lambda k: loss(params, k, None)[1], jax.random.PRNGKey(0))
    assert "imageless_loss" not in found
    both, told = jax.jit(jax.value_and_grad(lambda *a: loss(*a)[1]["imageless_loss"])), []
    for k in range(60):
        value, slope = both(params, jax.random.PRNGKey(k), (vector, label, jnp.zeros((64, 0)), guess))
        told.append(float(value))
        params = jax.tree.map(lambda a, s: a - 0.2 * s, params, slope)
    assert all((np.asarray(a) == 0).all() for a in jax.tree.leaves(slope["encoder"])), "pictures have no part in it"
    assert np.mean(told[-5:]) < 0.6 * told[0], "though what it is told is not right"


def test_what_an_actor_is_told_it_guessed_in_that_very_step():
    perception = Perception(SeenPointMass.observation_spaces, "rgbd")
    labels = ImitationBuffer.empty(4, 3, perception, 2, predictions=5)
    vector = jnp.arange(2 * 3 * perception.vector_size, dtype=jnp.float32).reshape(2, 3, -1)
    seen = Seen(vector, jnp.zeros((2, 3, labels.image.shape[-1]), jnp.uint8))
    labels = labels.insert(seen, vector[..., :2], prediction=vector[..., :1] + jnp.arange(5.0))
    found, label, recalled, guess = labels.sample_imageless(jax.random.PRNGKey(0), 64)
    assert len(np.unique(found[:, 0])) == 6 and recalled.shape == (64, 0)
    np.testing.assert_array_equal(label, found[:, :2])
    np.testing.assert_array_equal(guess, found[:, :1] + np.arange(5.0))


def test_samples_without_images_need_a_prediction_that_the_actor_acts_on():
    with pytest.raises(Ig2mjError, match="glimpses"):
        dagger(SeenPointMass(2), imageless_batch=64)


@pytest.mark.parametrize(
    ("config", "occlusion", "said"),
    [
        (DaggerConfig(), {"pretrain_updates": 5}, "pretrain_images=4096"),
        (DaggerConfig(), {"pretrain_expert_steps": 30}, "pretrain_expert_steps=30"),
        (DaggerConfig(), {"object_memory": "poses"}, "encoder=glimpses"),
        (DaggerConfig(encoder="glimpses"), {"belief_labels": True}, "object_memory=poses"),
        (DaggerConfig(encoder="glimpses", aux_coef=0.0), {}, "aux_coef"),
        (DaggerConfig(encoder="glimpses"), {"object_memory": "pose"}, "near matches: poses"),
        (DaggerConfig(encoder="places"), {}, "glimpses"),
        (SACConfig(), {"object_memory": "poses"}, "--algo dagger"),
    ],
)
def test_settings_that_do_not_go_together_are_refused(config, occlusion, said):
    with pytest.raises(Ig2mjError, match=said):
        check_settings(config, OcclusionConfig(**occlusion))
