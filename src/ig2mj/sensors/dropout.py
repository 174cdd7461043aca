"""Dropout noise: readings that are missing, at random (the only sensor noise of iGibson)."""

from __future__ import annotations

import zlib

import jax
import jax.numpy as jnp
from jaxtyping import Float, UInt32

from ig2mj.engine.view import Array


def dropout(
    keys: UInt32[Array, "W 2"] | None, sensor: str, readings: Float[Array, "W ..."], rate: float, value: float
) -> Float[Array, "W ..."]:
    """Readings, each replaced by `value` with probability `rate`, independently of all others.

    Args:
      keys: of each world and step. sensor: its name; each sensor has a stream of its own.
    """
    if rate <= 0.0:
        return readings
    assert keys is not None, "noise needs keys"
    stream = zlib.crc32(sensor.encode()) & 0x7FFFFFFF

    def lost(key: Array) -> Array:
        return jax.random.bernoulli(jax.random.fold_in(key, stream), rate, readings.shape[1:])

    return jnp.where(jax.vmap(lost)(jnp.asarray(keys)), jnp.asarray(value, readings.dtype), readings)
