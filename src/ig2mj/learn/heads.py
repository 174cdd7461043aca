"""What an actor's last layer says, as actions: the tanh of a Gaussian, or for each number a choice among even values.

An expert presses down here and rises there; who cannot tell the two places apart sees labels of -1 and 1 for what looks
the same, and the mean of those is to hover. A choice learns how likely each is, and does one of them.

Axes: B samples, n numbers of an action, K values.
"""

from __future__ import annotations

import math

import jax
import jax.numpy as jnp
from jaxtyping import Float

from ig2mj.engine.view import Array


def values(count: int) -> Float[Array, "K"]:
    """What is chosen from: from -1 to 1."""
    return jnp.linspace(-1.0, 1.0, count)


def likeliest(head: Float[Array, "B n *K"]) -> Float[Array, "B n"]:
    """The middle of a Gaussian; of a choice the mean of the three neighbouring values that are likeliest together,
    which can lie between two of them."""
    if head.ndim == 2:
        return jnp.tanh(head)
    chance = jax.nn.softmax(head)

    def of_three(a: Float[Array, "B n K"]) -> Float[Array, "B n K"]:
        around = jnp.pad(a, ((0, 0), (0, 0), (1, 1)))
        return around[..., :-2] + a + around[..., 2:]

    share, total = of_three(chance), of_three(chance * values(head.shape[-1]))
    best = jnp.argmax(share, axis=-1, keepdims=True)
    return jnp.take_along_axis(total / share, best, axis=-1)[..., 0]


def drawn(head: Float[Array, "B n *K"], log_std: Float[Array, "B n"], key: Array) -> Float[Array, "B n"]:
    """An action from the distribution. `log_std`: of a Gaussian."""
    if head.ndim == 2:
        return jnp.tanh(head + jnp.exp(log_std) * jax.random.normal(key, head.shape))
    return values(head.shape[-1])[jax.random.categorical(key, head)]


def drawn_with_density(
    mean: Float[Array, "B n"], log_std: Float[Array, "B n"], key: Array
) -> tuple[Float[Array, "B n"], Float[Array, "B"]]:
    """An action from the tanh of a Gaussian, and the logarithm of its density there."""
    eps = jax.random.normal(key, mean.shape)
    raw = mean + jnp.exp(log_std) * eps
    density = -0.5 * jnp.square(eps) - log_std - 0.5 * math.log(2 * math.pi)
    stretch = 2 * (math.log(2.0) - raw - jax.nn.softplus(-2 * raw))  # log of tanh's slope
    return jnp.tanh(raw), (density - stretch).sum(-1)


def label_loss(head: Float[Array, "B n *K"], label: Float[Array, "B n"]) -> Float[Array, ""]:
    """Mean squared difference of a Gaussian's middle from the label; of a choice the cross entropy from the two values
    that the label lies between."""
    if head.ndim == 2:
        return jnp.square(jnp.tanh(head) - label).mean()
    count = head.shape[-1]
    apart = jnp.abs(jnp.clip(label, -1.0, 1.0)[..., None] - values(count)) * (0.5 * (count - 1))
    return -(jnp.maximum(1.0 - apart, 0.0) * jax.nn.log_softmax(head)).sum(-1).mean()
