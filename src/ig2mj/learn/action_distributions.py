"""Actions from an actor's output: the tanh of a Gaussian, or a categorical distribution over bins for each number.

Where an expert presses down here and rises there, a policy that cannot tell the two apart sees labels of -1 and 1 for
the same observation, and their mean is to hover. A categorical distribution keeps both modes.

Axes: B samples, n numbers of an action, K bins.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from jaxtyping import Float

from ig2mj.engine.view import Array


def bin_values(count: int) -> Float[Array, "K"]:
    """The values that stand for so many bins: evenly from -1 to 1."""
    return jnp.linspace(-1.0, 1.0, count)


def mode(head: Float[Array, "B n *K"]) -> Float[Array, "B n"]:
    """The deterministic action: tanh of a Gaussian's mean; of bins the mean of the three neighbours that are most
    likely together, which can lie between two of them."""
    if head.ndim == 2:
        return jnp.tanh(head)
    chance = jax.nn.softmax(head)

    def of_three(a: Float[Array, "B n K"]) -> Float[Array, "B n K"]:
        around = jnp.pad(a, ((0, 0), (0, 0), (1, 1)))
        return around[..., :-2] + a + around[..., 2:]

    share, total = of_three(chance), of_three(chance * bin_values(head.shape[-1]))
    best = jnp.argmax(share, axis=-1, keepdims=True)
    return jnp.take_along_axis(total / share, best, axis=-1)[..., 0]


def sample(head: Float[Array, "B n *K"], log_std: Float[Array, "B n"], key: Array) -> Float[Array, "B n"]:
    """A sampled action. `log_std`: of a Gaussian."""
    if head.ndim == 2:
        return jnp.tanh(head + jnp.exp(log_std) * jax.random.normal(key, head.shape))
    return bin_values(head.shape[-1])[jax.random.categorical(key, head)]


def sample_with_log_prob(
    mean: Float[Array, "B n"], log_std: Float[Array, "B n"], key: Array
) -> tuple[Float[Array, "B n"], Float[Array, "B"]]:
    """A sample of the tanh of a Gaussian, and the logarithm of its density."""
    eps = jax.random.normal(key, mean.shape)
    raw = mean + jnp.exp(log_std) * eps
    density = -0.5 * jnp.square(eps) - log_std - 0.5 * math.log(2 * math.pi)
    stretch = 2 * (math.log(2.0) - raw - jax.nn.softplus(-2 * raw))  # log of tanh's slope
    return jnp.tanh(raw), (density - stretch).sum(-1)


def label_loss(head: Float[Array, "B n *K"], label: Float[Array, "B n"]) -> Float[Array, ""]:
    """Mean squared difference of a Gaussian's mean from the label; of bins the cross entropy from the two bins that
    the label lies between."""
    if head.ndim == 2:
        return jnp.square(jnp.tanh(head) - label).mean()
    count = head.shape[-1]
    apart = jnp.abs(jnp.clip(label, -1.0, 1.0)[..., None] - bin_values(count)) * (0.5 * (count - 1))
    return -(jnp.maximum(1.0 - apart, 0.0) * jax.nn.log_softmax(head)).sum(-1).mean()
