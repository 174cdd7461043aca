"""Noise of observations whose strength differs between episodes (`ig2mj.Randomize(sensor_noise=...)`).

Numbers for images come from one long list of normal numbers, of which every image takes a part that begins where its
key says: to draw 49,152 of them for each image would take longer than to make it.

Axes: W worlds.
"""

from __future__ import annotations

import functools
import zlib
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, UInt32

from ig2mj.engine.view import Array
from ig2mj.sensors.base import Space
from ig2mj.worlds.randomize import SensorNoise

LENGTH = 1 << 20
"""Normal numbers in the list."""

UNIT = 32.0
"""What one deviation is in it, whose numbers are bytes."""

SEED = 20_000_004
"""Of the list: the same one in every process."""


def noisy(
    readings: Mapping[str, Array],
    spaces: Mapping[str, Space],
    noise: SensorNoise,
    strength: Float[Array, "W"],
    keys: UInt32[Array, "W 2"],
) -> dict[str, Array]:
    """Readings with noise: colour images (bytes), what is named depth, and proprioception; others as they are. Pure.

    Args:
      strength: 0..1, of each world's episode. keys: of each world and step.
    """
    found = dict(readings)
    for name, array in readings.items():
        space = spaces[name]
        if array.dtype == jnp.uint8 and len(space.shape) == 3:
            scale = jnp.asarray(255.0 * noise.rgb / UNIT * strength, jnp.float32)
            shifted = jnp.asarray(array, jnp.float32) + _spread(scale, 3) * _normal(keys, name, space.shape)
            found[name] = jnp.clip(jnp.round(shifted), 0, 255).astype(jnp.uint8)
        elif "depth" in name:
            scale = jnp.asarray(noise.depth / UNIT * strength, jnp.float32)
            factor = 1.0 + _spread(scale, len(space.shape)) * _normal(keys, name, space.shape)
            found[name] = jnp.clip(array * factor, space.low, space.high).astype(array.dtype)
        elif name == "proprioception":
            scale = jnp.asarray(noise.proprioception / UNIT * strength, jnp.float32)
            found[name] = array + _spread(scale, 1) * _normal(keys, name, space.shape)
    return found


@functools.cache
def _numbers() -> np.ndarray:
    numbers = np.random.default_rng(SEED).standard_normal(LENGTH) * UNIT
    return np.clip(np.round(numbers), -127, 127).astype(np.int8)


def _normal(keys: UInt32[Array, "W 2"], name: str, shape: tuple[int, ...]) -> Float[Array, "W ..."]:
    """[W, *shape] normal numbers whose deviation is `UNIT`."""
    count, stream = int(np.prod(shape)), zlib.crc32(name.encode()) >> 1
    numbers = jnp.asarray(_numbers())

    def one(key: Array) -> Array:
        start = jax.random.randint(jax.random.fold_in(key, stream), (), 0, LENGTH - count)
        return jax.lax.dynamic_slice(numbers, (start,), (count,))

    return jax.vmap(one)(jnp.asarray(keys)).reshape(-1, *shape).astype(jnp.float32)


def _spread(scale: Float[Array, "W"], axes: int) -> Array:
    return scale.reshape(-1, *(1,) * axes)
