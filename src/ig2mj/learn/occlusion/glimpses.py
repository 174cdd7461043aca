"""An encoder that finds each object in the image and looks at the pixels around it at full resolution.

How a thin object lies shows in a few pixels, wherever they are. The encoder predicts the row and column of each object
(`projection.ObjectTargets`), cuts a window around that point, and predicts the object's rotation from the window alone.

Axes: B samples, q bytes of an image, r, s rows and columns, c channels, f features, g numbers of a prediction.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import flax.linen as nn
import jax
import jax.numpy as jnp
from jaxtyping import Float, UInt8

from ig2mj.engine.view import Array
from ig2mj.learn.networks import AUGMENTATION, SHARP, brightest, centred, conv3, halvings_of
from ig2mj.learn.occlusion.projection import FRAME, ObjectTargets
from ig2mj.learn.perception import Perception

NAME = "glimpses"
"""Of the encoder in settings and cards."""

WINDOW = 32
"""Pixels, height and width, of what a glimpse sees around an object."""

GLIMPSE = 64
"""Numbers that say what a glimpse sees."""

JITTER = 1.0
"""Pixels, deviation of how far from its point a glimpse looks while it learns. Exactly at the point, which lies between
pixels, the encoder overfits to how the pixels lie."""


@dataclasses.dataclass(frozen=True)
class GlimpseEncoder:
    """A `protocols.Encoder`.

    Attributes:
      shape: of the image. poses: numbers of the prediction but rows and columns, the objects' rotations last, six each.
      objects: how many there are, at least one.
    """

    shape: tuple[int, int, int]
    poses: int
    objects: int
    acts_on_prediction = True

    @property
    def predictions(self) -> int:
        """g: rows and columns come last."""
        return self.poses + 2 * self.objects

    def features(self, image: UInt8[Array, "B q"]) -> Float[Array, "B f"]:
        return GlimpseFeatures(self.shape, self.objects, name="encoder")(image)

    def predict(
        self, features: Float[Array, "B f"], vector: Float[Array, "B x"]
    ) -> tuple[Float[Array, "B g"], Float[Array, "B h"]]:
        """The actor's layers see no features besides, so that a prediction can take the place of an image.

        A rotation's error alone trains the glimpse that it is predicted from: with the errors of all other numbers in
        its gradients the encoder does not learn on which side of a blade the edge is.
        """
        points, around, others = jnp.split(features, [2 * self.objects, (2 + GLIMPSE) * self.objects], axis=-1)
        known = jnp.concatenate([points, others, vector], axis=-1)
        known = jnp.concatenate([known, nn.relu(nn.Dense(128, name="combined")(known))], axis=-1)
        predicted = [nn.Dense(self.poses - 6 * self.objects, name="guess")(known)]
        place = jnp.concatenate([jax.lax.stop_gradient(points), vector], axis=-1)
        for k in range(self.objects):
            own = jnp.concatenate([around[:, k * GLIMPSE : (k + 1) * GLIMPSE], place], axis=-1)
            own = jnp.concatenate([own, nn.relu(nn.Dense(128, name=f"turning_{k}")(own))], axis=-1)
            predicted.append(nn.Dense(6, name=f"turn_{k}")(own))
        return jnp.concatenate([*predicted, points], axis=-1), features[:, :0]

    def card(self) -> dict[str, Any]:
        return {"net": NAME, "guess": self.poses, "objects": self.objects}


class GlimpseFeatures(nn.Module):
    """Row and column of each object, to be learned as `projection.FRAME` has them; `GLIMPSE` numbers of the window
    around each; where in the image each of 16 channels is brightest and how far away it is there; 32 numbers of the
    whole. Depth times row and column is what a position in the camera's frame is linear in."""

    shape: tuple[int, int, int]
    objects: int

    @nn.compact
    def __call__(self, image: UInt8[Array, "B q"]) -> Float[Array, "B f"]:
        seen = x = centred(image, self.shape)
        # processors have no fast way to convolve in half precision
        dtype = jnp.bfloat16 if jax.default_backend() == "gpu" else jnp.float32
        places = jnp.zeros((x.shape[0], 0))
        for k, channels in enumerate((16, 32, *[32] * (halvings_of(self.shape) - 2))):
            x = nn.relu(conv3(channels, 2, dtype)(x))
            if k == 1:
                maps = nn.Dense(16, dtype=dtype, name="points")(nn.LayerNorm(name="points_norm")(x))
                places = brightest(SHARP * maps.astype(jnp.float32), coarse(seen[..., -1], maps.shape[1:3]))
        x = x.reshape(x.shape[0], -1).astype(jnp.float32)
        features = [places, jnp.tanh(nn.LayerNorm()(nn.Dense(32)(x)))]
        points = nn.Dense(2 * self.objects, name="spots")(jnp.concatenate(features, axis=-1))
        where = points.reshape(-1, self.objects, 2) / FRAME
        around = [Glimpse(dtype, name=f"glimpse_{k}")(seen, where[:, k]) for k in range(self.objects)]
        return jnp.concatenate([points, *around, *features], axis=-1)


class Glimpse(nn.Module):
    """What is around a point of the image at full resolution, as `GLIMPSE` numbers."""

    dtype: Any = jnp.float32

    @nn.compact
    def __call__(self, seen: Float[Array, "B r s c"], point: Float[Array, "B 2"]) -> Float[Array, "B f"]:
        point = jax.lax.stop_gradient(point)
        if self.has_rng(AUGMENTATION):
            pixel = 2.0 / (jnp.asarray(seen.shape[1:3], jnp.float32) - 1.0)
            point += JITTER * pixel * jax.random.normal(self.make_rng(AUGMENTATION), point.shape)
        x = window(seen, point)
        for channels in (32, 48, 48):
            x = nn.relu(conv3(channels, 2, self.dtype)(x))
        return nn.relu(nn.Dense(GLIMPSE)(x.reshape(x.shape[0], -1).astype(jnp.float32)))


def window(seen: Float[Array, "B r s c"], point: Float[Array, "B 2"]) -> Float[Array, "B w w c"]:
    """`WINDOW` rows and columns of each image around a point whose row and column are from -1 to 1, interpolated
    linearly; 0 outside the image."""

    def weights(middle: Float[Array, "B"], size: int) -> Float[Array, "B w n"]:
        places = (middle[:, None] + 1.0) * (0.5 * (size - 1)) + jnp.arange(WINDOW) - 0.5 * (WINDOW - 1)
        return jnp.maximum(1.0 - jnp.abs(places[:, :, None] - jnp.arange(size)), 0.0)

    rows, columns = weights(point[:, 0], seen.shape[1]), weights(point[:, 1], seen.shape[2])
    return jnp.einsum("bir,brsc,bjs->bijc", rows, seen, columns)


def coarse(depth: Float[Array, "B r s"], shape: tuple[int, ...]) -> Float[Array, "B h w"]:
    """An image's depth averaged over the cells of a map, from about -2 to 2."""
    count, rows, columns = depth.shape
    height, width = shape
    low, right = -rows % height, -columns % width  # where convolutions of stride 2 rounded up
    padded = jnp.pad(depth, ((0, 0), (0, low), (0, right)), mode="edge")
    cells = padded.reshape(count, height, -1, width, (columns + right) // width)
    return 4.0 * cells.mean((2, 4))


def encoder_of(perception: Perception) -> GlimpseEncoder:
    """For a perception of `projection.with_object_targets`."""
    targets = perception.targets
    assert isinstance(targets, ObjectTargets) and perception.image_shape is not None
    return GlimpseEncoder(perception.image_shape, targets.pose_size, targets.objects)


def encoder_from_card(net: dict[str, Any], shape: tuple[int, int, int]) -> GlimpseEncoder:
    """The encoder that `GlimpseEncoder.card` describes."""
    return GlimpseEncoder(shape, net.get("guess", 0), net.get("objects", 0))
