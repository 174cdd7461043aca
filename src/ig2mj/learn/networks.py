"""Networks: an actor with or without an encoder of pictures, two distributional critics, and a value.

Axes: B samples, n numbers of an action, K atoms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Float, UInt8

from ig2mj.engine.view import Array
from ig2mj.errors import UnknownNameError
from ig2mj.learn.convolution import convolve
from ig2mj.learn.projection import FRAME

LOG_STD = (-5.0, 0.0)
"""Limits of the logarithm of an actor's standard deviation, before tanh (FlashSAC's recommendation)."""

FIRST_STD = 0.3
"""Standard deviation of an untrained actor."""

NETS = ("small", "paper", "points", "places", "glimpses")
"""Encoders of pictures."""

WINDOW = 32
"""Pixels, height and width, of what a glimpse sees around an object."""

GLIMPSE = 64
"""Numbers that say what a glimpse sees."""

SHAKEN = "glimpse"
"""The name of the random numbers (flax's `rngs`) with which glimpses are shaken; without them they are not."""

SHAKE = 1.0
"""Pixels, deviation of how far beside its point a glimpse looks while it learns. Exactly at the point, which is between
pixels, start states are known by heart from how the pixels lie, and nothing else is learnt from them."""

PRECISE = ("places", "glimpses")
"""Those that the guess of hidden numbers alone trains, and whose guess the actor sees."""

SHARP = 3.0
"""Factor of maps before their softmax: without it an untrained softmax is even, and hardly changes."""


class Trunk(nn.Module):
    """Dense layers, each with layer normalization and SiLU."""

    sizes: Sequence[int]

    @nn.compact
    def __call__(self, x: Float[Array, "B x"]) -> Float[Array, "B y"]:
        for size in self.sizes:
            x = nn.silu(nn.LayerNorm()(nn.Dense(size, kernel_init=nn.initializers.orthogonal(2**0.5))(x)))
        return x


class Encoder(nn.Module):
    """Features of pictures.

    `small`: convolutions of stride 2 until four rows of pixels are left, for 32x32 pixels three (32, 64, 64), and 50
    numbers between -1 and 1, as in Squint. `paper`: three convolutions and 256 numbers (iGibson 2.0, appendix A.3).
    `points`: `small`'s numbers, and where in the picture each of 32 channels is brightest after two halvings (the
    spatial softmax of Levine et al. 2016), so that the place of a thin object need not be read from four by four coarse
    cells. `places`: the same, with how far away it is there, on a GPU in half precision. Depth times row and column is
    what a place in the camera's frame is linear in. `glimpses`: the same, and for each of so many `objects` two
    numbers, which come first and are to be learnt as its row and column (`projection.FRAME`), and what is around that
    point at full resolution: how a thin object lies shows in a few pixels, wherever they are.
    """

    shape: tuple[int, int, int]
    net: str = "small"
    objects: int = 0

    @nn.compact
    def __call__(self, picture: UInt8[Array, "B q"]) -> Float[Array, "B f"]:
        seen = x = picture.reshape(-1, *self.shape).astype(jnp.float32) / 255.0 - 0.5
        halvings = 3 if self.net == "paper" else max(3, math.ceil(math.log2(self.shape[0] / 4)))
        # processors have no fast way to convolve in half precision
        half = self.net in PRECISE and jax.default_backend() == "gpu"
        places, dtype = jnp.zeros((x.shape[0], 0)), jnp.bfloat16 if half else jnp.float32
        first, second, later, few = (16, 32, 32, 32) if self.net == "glimpses" else (32, 64, 64, 50)
        for k, channels in enumerate((first, second, *[later] * (halvings - 2))):
            x = nn.relu(_conv(channels, 2, dtype)(x))
            if self.net in ("points", *PRECISE) and k == 1:
                normal = nn.LayerNorm(name="points_norm")(x)
                light = self.net == "glimpses"  # its maps need not be fine: glimpses are
                maps = (nn.Dense(16, dtype=dtype, name="points") if light else _conv(32, 1, dtype, "points"))(normal)
                depth = coarse(seen[..., -1], maps.shape[1:3]) if self.net in PRECISE else None
                places = brightest(SHARP * maps.astype(jnp.float32), depth)
        x = x.reshape(x.shape[0], -1).astype(jnp.float32)
        if self.net == "paper":
            return nn.relu(nn.Dense(256)(x))
        features = [places, jnp.tanh(nn.LayerNorm()(nn.Dense(few)(x)))]
        if self.net == "glimpses" and self.objects:
            points = nn.Dense(2 * self.objects, name="spots")(jnp.concatenate(features, axis=-1))
            where = points.reshape(-1, self.objects, 2) / FRAME
            around = [Glimpse(dtype, name=f"glimpse_{k}")(seen, where[:, k]) for k in range(self.objects)]
            features = [points, *around, *features]
        return jnp.concatenate(features, axis=-1)


class Glimpse(nn.Module):
    """What is around a point of the picture at full resolution, as `GLIMPSE` numbers."""

    dtype: Any = jnp.float32

    @nn.compact
    def __call__(self, seen: Float[Array, "B r s c"], point: Float[Array, "B 2"]) -> Float[Array, "B f"]:
        point = jax.lax.stop_gradient(point)
        if self.has_rng(SHAKEN):
            pixel = 2.0 / (jnp.asarray(seen.shape[1:3], jnp.float32) - 1.0)
            point += SHAKE * pixel * jax.random.normal(self.make_rng(SHAKEN), point.shape)
        x = window(seen, point)
        for channels in (32, 48, 48):
            x = nn.relu(_conv(channels, 2, self.dtype)(x))
        return nn.relu(nn.Dense(GLIMPSE)(x.reshape(x.shape[0], -1).astype(jnp.float32)))


def _conv(channels: int, stride: int, dtype: Any, name: str | None = None) -> nn.Conv:
    """A convolution of 3x3 pixels."""
    return nn.Conv(channels, (3, 3), stride, dtype=dtype, conv_general_dilated=convolve, name=name)


def window(seen: Float[Array, "B r s c"], point: Float[Array, "B 2"]) -> Float[Array, "B w w c"]:
    """`WINDOW` rows and columns of each picture around a point whose row and column are from -1 to 1, interpolated
    linearly; 0 beside the picture."""

    def weights(middle: Float[Array, "B"], size: int) -> Float[Array, "B w n"]:
        places = (middle[:, None] + 1.0) * (0.5 * (size - 1)) + jnp.arange(WINDOW) - 0.5 * (WINDOW - 1)
        return jnp.maximum(1.0 - jnp.abs(places[:, :, None] - jnp.arange(size)), 0.0)

    rows, columns = weights(point[:, 0], seen.shape[1]), weights(point[:, 1], seen.shape[2])
    return jnp.einsum("bir,brsc,bjs->bijc", rows, seen, columns)


def brightest(maps: Float[Array, "B h w c"], depth: Float[Array, "B h w"] | None = None) -> Float[Array, "B f"]:
    """Row and column, from -1 to 1, of the middle of each channel's softmax over the picture, [B, 2 * c]; with `depth`
    also the depth there, and its products with row and column, [B, 5 * c]."""
    count, height, width, channels = maps.shape
    share = jax.nn.softmax(maps.reshape(count, height * width, channels), axis=1).reshape(maps.shape)
    row = jnp.einsum("bhwc,h->bc", share, jnp.linspace(-1.0, 1.0, height))
    column = jnp.einsum("bhwc,w->bc", share, jnp.linspace(-1.0, 1.0, width))
    if depth is None:
        return jnp.concatenate([row, column], axis=-1)
    there = jnp.einsum("bhwc,bhw->bc", share, depth)
    return jnp.concatenate([row, column, there, there * row, there * column], axis=-1)


def coarse(depth: Float[Array, "B r s"], shape: tuple[int, ...]) -> Float[Array, "B h w"]:
    """A picture's depth averaged over the cells of a map, from about -2 to 2."""
    count, rows, columns = depth.shape
    height, width = shape
    low, right = -rows % height, -columns % width  # where convolutions of stride 2 rounded up
    padded = jnp.pad(depth, ((0, 0), (0, low), (0, right)), mode="edge")
    cells = padded.reshape(count, height, -1, width, (columns + right) // width)
    return 4.0 * cells.mean((2, 4))


class Actor(nn.Module):
    """Mean and logarithm of the standard deviation of a Gaussian, whose tanh is the action; with `choices` instead for
    each number of the action how likely each of so many values is, as logits (`ig2mj.learn.heads` makes actions of it).

    With `guess`, that many hidden numbers are guessed linearly from the features of the picture, for an auxiliary loss.
    With the encoders `places` and `glimpses` the guess is also what the actor's layers see, and the auxiliary loss
    alone trains the encoder: gradients of actions are larger and noisier, and where both did, places were off by
    centimetres. With `glimpses` the guess ends with how the `objects` are turned, and with their rows and columns
    (`Hidden`); the actor's layers see the guess alone, so that it can also be told to them.

    Raises:
      UnknownNameError: `net` is none of `NETS`.
    """

    action_size: int
    sizes: Sequence[int] = (256, 256, 256)
    picture_shape: tuple[int, int, int] | None = None
    net: str = "small"
    guess: int = 0
    choices: int = 0
    objects: int = 0

    def __post_init__(self) -> None:
        if self.net not in NETS:
            raise UnknownNameError("encoder", self.net, NETS)
        super().__post_init__()

    @property
    def uses_guess(self) -> bool:
        """Whether its actions depend on the guess, which then belongs to the policy."""
        return self.net in PRECISE and self.guess > 0

    @nn.compact
    def __call__(
        self,
        vector: Float[Array, "B x"],
        picture: UInt8[Array, "B q"],
        told: Float[Array, "B g"] | None = None,
        recalled: Float[Array, "B m"] | None = None,
    ) -> tuple[Float[Array, "B n *K"], Float[Array, "B n"], Float[Array, "B g"]]:
        """`told`: in place of the guess, with `glimpses`; the picture is not looked at then. `recalled`: what the
        actor's layers know besides (`ig2mj.learn.recall`)."""
        guessed = jnp.zeros((vector.shape[0], self.guess))
        if told is not None:
            guessed, vector = told, jnp.concatenate([vector, told], axis=-1)
        elif self.picture_shape is not None:
            features = Encoder(self.picture_shape, self.net, self.objects, name="encoder")(picture)
            if self.guess:
                guessed, features = self._guess(features, vector)
            known = jax.lax.stop_gradient((features, guessed)) if self.uses_guess else (features,)
            vector = jnp.concatenate([vector, *known], axis=-1)
        if recalled is not None:
            vector = jnp.concatenate([vector, recalled], axis=-1)
        x = Trunk((256,) if self.net == "paper" else self.sizes, name="trunk")(vector)
        small = nn.initializers.orthogonal(0.01)
        if self.choices:
            logits = nn.Dense(self.action_size * self.choices, kernel_init=small, name="choice")(x)
            shape = (-1, self.action_size, self.choices)
            return logits.reshape(shape), jnp.zeros((x.shape[0], self.action_size)), guessed
        mean = nn.Dense(self.action_size, kernel_init=small, name="mean")(x)
        low, high = LOG_STD
        start = jnp.arctanh(2 * (jnp.log(FIRST_STD) - low) / (high - low) - 1)
        raw = nn.Dense(self.action_size, kernel_init=small, bias_init=nn.initializers.constant(start), name="std")(x)
        return mean, low + (high - low) * (jnp.tanh(raw) + 1) / 2, guessed

    def _guess(
        self, features: Float[Array, "B f"], vector: Float[Array, "B x"]
    ) -> tuple[Float[Array, "B g"], Float[Array, "B h"]]:
        """The guess, and which of the features the actor's layers see, too.

        How an object is turned is guessed from its own glimpse, and nothing else trains that: with the errors of all
        other numbers in its gradients it does not find out on which side of a blade the edge is.
        """
        if self.net != "glimpses" or not self.objects:
            return nn.Dense(self.guess, name="guess")(jnp.concatenate([features, vector], axis=-1)), features
        points, around, others = jnp.split(features, [2 * self.objects, (2 + GLIMPSE) * self.objects], axis=-1)
        known = jnp.concatenate([points, others, vector], axis=-1)
        known = jnp.concatenate([known, nn.relu(nn.Dense(128, name="combined")(known))], axis=-1)
        guessed = [nn.Dense(self.guess - 6 * self.objects, name="guess")(known)]
        place = jnp.concatenate([jax.lax.stop_gradient(points), vector], axis=-1)
        for k in range(self.objects):
            own = jnp.concatenate([around[:, k * GLIMPSE : (k + 1) * GLIMPSE], place], axis=-1)
            own = jnp.concatenate([own, nn.relu(nn.Dense(128, name=f"turning_{k}")(own))], axis=-1)
            guessed.append(nn.Dense(6, name=f"turn_{k}")(own))
        return jnp.concatenate([*guessed, points], axis=-1), features[:, :0]


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


def shifted(picture: UInt8[Array, "B q"], shape: tuple[int, int, int], key: Array, by: int = 2) -> UInt8[Array, "B q"]:
    """Each picture moved by at most so many pixels, its border repeated (DrQ's augmentation); by 0, as it is."""
    if not by:
        return picture
    count = picture.shape[0]
    padded = jnp.pad(picture.reshape(count, *shape), ((0, 0), (by, by), (by, by), (0, 0)), mode="edge")
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
