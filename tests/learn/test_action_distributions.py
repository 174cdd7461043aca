"""What an actor's last layer says, as actions."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.learn.action_distributions import label_loss, mode, sample, sample_with_log_prob


def learnt(labels, choices: int):
    """The head of one number that fits labels best."""
    labels = jnp.asarray(labels, jnp.float32)[:, None]

    @jax.jit
    def fit(head):
        def loss(head):
            return label_loss(jnp.broadcast_to(head, (len(labels), *head.shape)), labels)

        return jax.lax.fori_loop(0, 3000, lambda _, h: h - 0.3 * jax.grad(loss)(h), head)

    return fit(jnp.zeros((1, choices) if choices else (1,)))[None]


def test_of_labels_that_switch_a_choice_does_one_and_a_mean_does_nothing():
    labels = [-1.0] * 6 + [1.0] * 4
    assert abs(float(mode(learnt(labels, 0))[0, 0]) + 0.2) < 0.01
    assert float(mode(learnt(labels, 21))[0, 0]) < -0.95


@pytest.mark.parametrize("label", [-1.0, -0.97, -0.333, 0.0, 0.05, 0.4, 1.0])
def test_a_choice_learns_what_lies_between_its_values(label):
    np.testing.assert_allclose(mode(learnt([label], 21)), label, atol=0.02)


def test_a_choice_is_drawn_as_often_as_it_is_likely():
    head = jnp.log(jnp.broadcast_to(jnp.array([0.2, 0.7, 0.1]), (20_000, 2, 3)))
    found = np.asarray(sample(head, jnp.zeros((20_000, 2)), jax.random.PRNGKey(0)))
    shares = [(found == value).mean(0) for value in (-1, 0, 1)]
    np.testing.assert_allclose(shares, [[0.2] * 2, [0.7] * 2, [0.1] * 2], atol=0.015)


def test_a_gaussian_is_drawn_around_its_middle():
    head, log_std = jnp.full((20_000, 1), 0.3), jnp.full((20_000, 1), jnp.log(0.1))
    found = np.arctanh(np.asarray(sample(head, log_std, jax.random.PRNGKey(0)), float))
    assert abs(found.mean() - 0.3) < 0.005 and abs(found.std() - 0.1) < 0.005
    np.testing.assert_allclose(mode(head), np.tanh(0.3), rtol=1e-5)


def test_the_density_of_an_action_is_how_often_actions_near_it_are_drawn():
    count = 200_000
    mean, log_std = jnp.full((count, 1), 0.3), jnp.full((count, 1), -0.5)
    action, density = map(np.asarray, sample_with_log_prob(mean, log_std, jax.random.PRNGKey(0)))
    for middle in (-0.8, 0.0, 0.5, 0.9):
        near = np.abs(action[:, 0] - middle) < 0.02
        np.testing.assert_allclose(near.mean() / 0.04, np.exp(density[near]).mean(), rtol=0.06)
