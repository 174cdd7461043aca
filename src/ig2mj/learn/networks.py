"""Networks: an actor with or without an encoder of images, two distributional critics, and a value.

Axes: B samples, n numbers of an action, K atoms, x numbers an actor sees, q bytes of an image, f features, g numbers
of a prediction, m numbers of a memory as a network sees it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float, UInt8

from ig2mj.engine.view import Array
from ig2mj.errors import UnknownNameError
from ig2mj.learn.convolution import convolve
from ig2mj.learn.protocols import Memory
from ig2mj.learn.running_stats import normal

LOG_STD = (-5.0, 0.0)
"""Limits of the logarithm of an actor's standard deviation, before tanh (FlashSAC's recommendation)."""

FIRST_STD = 0.3
"""Standard deviation of an untrained actor."""

ENCODERS = ("small", "points")
"""Encoders of `ConvEncoder`."""

AUGMENTATION = "glimpse"
"""Name of the random numbers (flax's `rngs`) with which an encoder augments what it sees while it learns."""

SHARP = 3.0
"""Factor of maps before their softmax: without it an untrained softmax is even, and hardly changes."""


def orthogonal(scale: float) -> Callable[..., Array]:
    """Initializer of orthogonal matrices, multiplied by `scale`; flax's, one matrix after another.

    A factorization of several matrices at once, as of two critics, waits for threads of XLA's pool from one of them:
    with two cores jaxlib 0.10.2 waits forever.
    """
    one = nn.initializers.orthogonal(scale)

    def init(key: Array, shape: Sequence[int], dtype: Any = jnp.float32) -> Array:
        return jax.custom_batching.sequential_vmap(lambda key: one(key, shape, dtype))(key)

    return init


class Trunk(nn.Module):
    """Dense layers, each with layer normalization and SiLU."""

    sizes: Sequence[int]

    @nn.compact
    def __call__(self, x: Float[Array, "B x"]) -> Float[Array, "B y"]:
        for size in self.sizes:
            x = nn.silu(nn.LayerNorm()(nn.Dense(size, kernel_init=orthogonal(2**0.5))(x)))
        return x


class Convolutions(nn.Module):
    """Features of images.

    `small`: convolutions of stride 2 until four rows of pixels are left, for 32x32 pixels three (32, 64, 64), and 50
    numbers between -1 and 1, as in Squint. `points`: the same numbers, and where in the image each of 32 channels is
    brightest after two halvings (the spatial softmax of Levine et al. 2016), so that the position of a thin object need
    not be read from four by four coarse cells.
    """

    shape: tuple[int, int, int]
    net: str = "small"

    @nn.compact
    def __call__(self, image: UInt8[Array, "B q"]) -> Float[Array, "B f"]:
        x = centred(image, self.shape)
        halvings = halvings_of(self.shape)
        points = jnp.zeros((x.shape[0], 0))
        for k, channels in enumerate((32, 64, *[64] * (halvings - 2))):
            x = nn.relu(conv3(channels, 2)(x))
            if self.net == "points" and k == 1:
                maps = conv3(32, 1, name="points")(nn.LayerNorm(name="points_norm")(x))
                points = brightest(SHARP * maps)
        x = x.reshape(x.shape[0], -1)
        return jnp.concatenate([points, jnp.tanh(nn.LayerNorm()(nn.Dense(50)(x)))], axis=-1)


@dataclasses.dataclass(frozen=True)
class ConvEncoder:
    """`Convolutions` as a `protocols.Encoder`, whose prediction is linear in the features and the actor's vector.

    Raises:
      UnknownNameError: `net` is none of `ENCODERS`.
    """

    shape: tuple[int, int, int]
    net: str = "small"
    predictions: int = 0
    acts_on_prediction = False

    def __post_init__(self) -> None:
        if self.net not in ENCODERS:
            raise UnknownNameError("encoder", self.net, ENCODERS)

    def features(self, image: UInt8[Array, "B q"]) -> Float[Array, "B f"]:
        return Convolutions(self.shape, self.net, name="encoder")(image)

    def predict(
        self, features: Float[Array, "B f"], vector: Float[Array, "B x"]
    ) -> tuple[Float[Array, "B g"], Float[Array, "B h"]]:
        if not self.predictions:
            return jnp.zeros((vector.shape[0], 0)), features
        known = jnp.concatenate([features, vector], axis=-1)
        return nn.Dense(self.predictions, name="guess")(known), features

    def card(self) -> dict[str, Any]:
        return {"net": self.net}


def conv_encoder(shape: tuple[int, int, int] | None, net: str, predictions: int = 0) -> ConvEncoder | None:
    """The encoder of images of a shape; None without images. Raises UnknownNameError."""
    if shape is None:
        return ConvEncoder((1, 1, 1), net, predictions) and None
    return ConvEncoder(shape, net, predictions)


def centred(image: UInt8[Array, "B q"], shape: tuple[int, int, int]) -> Float[Array, "B r s c"]:
    """Bytes as numbers from -0.5 to 0.5."""
    return image.reshape(-1, *shape).astype(jnp.float32) / 255.0 - 0.5


def halvings_of(shape: tuple[int, int, int]) -> int:
    """Convolutions of stride 2 until four rows are left, three at least."""
    return max(3, math.ceil(math.log2(shape[0] / 4)))


def conv3(channels: int, stride: int, dtype: Any = jnp.float32, name: str | None = None) -> nn.Conv:
    """A convolution of 3x3 pixels."""
    return nn.Conv(channels, (3, 3), stride, dtype=dtype, conv_general_dilated=convolve, name=name)


def brightest(maps: Float[Array, "B h w c"], depth: Float[Array, "B h w"] | None = None) -> Float[Array, "B f"]:
    """Row and column, from -1 to 1, of the middle of each channel's softmax over the image, [B, 2 * c]; with `depth`
    also the depth there, and its products with row and column, [B, 5 * c]."""
    count, height, width, channels = maps.shape
    share = jax.nn.softmax(maps.reshape(count, height * width, channels), axis=1).reshape(maps.shape)
    row = jnp.einsum("bhwc,h->bc", share, jnp.linspace(-1.0, 1.0, height))
    column = jnp.einsum("bhwc,w->bc", share, jnp.linspace(-1.0, 1.0, width))
    if depth is None:
        return jnp.concatenate([row, column], axis=-1)
    there = jnp.einsum("bhwc,bhw->bc", share, depth)
    return jnp.concatenate([row, column, there, there * row, there * column], axis=-1)


class ActorNetwork(nn.Module):
    """Mean and logarithm of the standard deviation of a Gaussian, whose tanh is the action; with `bins` instead the
    logits of so many values for each number of the action (`ig2mj.learn.action_distributions` samples from either).

    An encoder that predicts privileged numbers is trained by an auxiliary loss. Where its `acts_on_prediction` is set,
    the actor's layers see the prediction, and the gradients of actions stop before it: they are larger and noisier, and
    with both the predicted positions are off by centimetres.
    """

    action_size: int
    sizes: Sequence[int] = (256, 256, 256)
    encoder: Any = None
    """A `protocols.Encoder`; None without images."""
    bins: int = 0

    @property
    def predictions(self) -> int:
        """g."""
        return 0 if self.encoder is None else self.encoder.predictions

    @property
    def acts_on_prediction(self) -> bool:
        """Whether its actions depend on the prediction, which then belongs to the policy."""
        return self.predictions > 0 and self.encoder.acts_on_prediction

    @nn.compact
    def __call__(
        self,
        vector: Float[Array, "B x"],
        image: UInt8[Array, "B q"],
        predicted: Float[Array, "B g"] | None = None,
        remembered: Float[Array, "B m"] | None = None,
    ) -> tuple[Float[Array, "B n *K"], Float[Array, "B n"], Float[Array, "B g"]]:
        """Parameters of the distribution, and the prediction.

        Args:
          predicted: takes the place of the prediction; the image is not looked at. remembered: of a `protocols.Memory`.
        """
        prediction = jnp.zeros((vector.shape[0], self.predictions))
        if predicted is not None:
            prediction, vector = predicted, jnp.concatenate([vector, predicted], axis=-1)
        elif self.encoder is not None:
            prediction, features = self.encoder.predict(self.encoder.features(image), vector)
            acts = self.acts_on_prediction
            known = jax.lax.stop_gradient((features, prediction)) if acts else (features,)
            vector = jnp.concatenate([vector, *known], axis=-1)
        if remembered is not None:
            vector = jnp.concatenate([vector, remembered], axis=-1)
        x = Trunk(self.sizes, name="trunk")(vector)
        small = orthogonal(0.01)
        if self.bins:
            logits = nn.Dense(self.action_size * self.bins, kernel_init=small, name="choice")(x)
            shape = (-1, self.action_size, self.bins)
            return logits.reshape(shape), jnp.zeros((x.shape[0], self.action_size)), prediction
        mean = nn.Dense(self.action_size, kernel_init=small, name="mean")(x)
        low, high = LOG_STD
        start = jnp.arctanh(2 * (jnp.log(FIRST_STD) - low) / (high - low) - 1)
        raw = nn.Dense(self.action_size, kernel_init=small, bias_init=nn.initializers.constant(start), name="std")(x)
        return mean, low + (high - low) * (jnp.tanh(raw) + 1) / 2, prediction


def apply_with_memory(
    apply: Callable[..., Any],
    memory: Memory | None,
    scales: tuple[Float[Array, "_"], Float[Array, "_"]],
    vector: Float[Array, "W x"],
    image: UInt8[Array, "W q"],
    kept: Float[Array, "W m"],
    begins: Bool[Array, "W"],
) -> tuple[Any, Float[Array, "W m"]]:
    """What an actor gives that may have a memory, and what it remembers from then on.

    Args:
      apply: an `ActorNetwork` with its weights. vector: as it was observed.
      scales: mean and deviation of the vector, and of the privileged numbers after it where the memory needs those.
      kept, begins: see `Memory.after`; without a memory `kept` is returned as it is.
    """
    size = vector.shape[-1]
    own = normal(vector, scales[0][:size], scales[1][:size])
    if memory is None:
        return apply(own, image), kept
    _, _, prediction = apply(own, image, None, memory.normal(kept, vector, *scales))
    kept = memory.after(kept, begins, vector, prediction)
    # all that the actor knows of the image is the prediction, so the encoder does not run again
    return apply(own, image[:, :0], prediction, memory.normal(kept, vector, *scales)), kept


class Critic(nn.Module):
    """Logits of the distribution of the return over K atoms."""

    atoms: int
    sizes: Sequence[int] = (512, 512, 512)

    @nn.compact
    def __call__(self, vector: Float[Array, "B v"], action: Float[Array, "B n"]) -> Float[Array, "B K"]:
        x = Trunk(self.sizes)(jnp.concatenate([vector, action], axis=-1))
        return nn.Dense(self.atoms, kernel_init=nn.initializers.zeros)(x)


def twins(atoms: int, sizes: Sequence[int]) -> nn.Module:
    """Two critics in one module: logits [2, B, K]."""
    both = {"in_axes": None, "out_axes": 0, "axis_size": 2}
    pair = nn.vmap(Critic, variable_axes={"params": 0}, split_rngs={"params": True}, **both)
    return pair(atoms, tuple(sizes))


class Value(nn.Module):
    """The expected return."""

    sizes: Sequence[int] = (256, 256, 256)

    @nn.compact
    def __call__(self, vector: Float[Array, "B v"]) -> Float[Array, "B"]:
        return nn.Dense(1)(Trunk(self.sizes)(vector))[:, 0]


def shifted(image: UInt8[Array, "B q"], shape: tuple[int, int, int], key: Array, by: int = 2) -> UInt8[Array, "B q"]:
    """Each image moved by at most so many pixels, its border repeated (DrQ's augmentation); by 0, as it is."""
    if not by:
        return image
    count = image.shape[0]
    padded = jnp.pad(image.reshape(count, *shape), ((0, 0), (by, by), (by, by), (0, 0)), mode="edge")
    start = jax.random.randint(key, (count, 2), 0, 2 * by + 1)
    moved = jax.vmap(lambda p, s: jax.lax.dynamic_slice(p, (s[0], s[1], 0), shape))(padded, start)
    return moved.reshape(count, -1)


def projected(
    chance: Float[Array, "B K"], places: Float[Array, "B K"], support: Float[Array, "K"]
) -> Float[Array, "B K"]:
    """A distribution over places, shared out to the nearest atoms of an even support."""
    gap = support[1] - support[0]
    inside = jnp.clip(places, support[0], support[-1])
    share = jnp.clip(1.0 - jnp.abs(inside[:, :, None] - support) / gap, 0.0, 1.0)
    return (chance[:, :, None] * share).sum(1)
