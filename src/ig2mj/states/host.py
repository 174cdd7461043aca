"""One formula for two places: JAX's arrays for batches, NumPy's for one world on the host.

A sampler sets states of one world thousands of times. Outside of a compiled function, JAX's operations are compiled one
by one for every scene, and take a hundred times as long as what they compute; given NumPy arrays, the setters of
`states.definitions` use NumPy alone.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import namespace

Randomness = jax.Array | np.random.Generator
"""A JAX key, or on the host a generator."""


def put(array: Array, index: Any, value: Any) -> Array:
    """A copy of the array with the value at an index."""
    if namespace(array) is not np:
        return jnp.asarray(array).at[index].set(value)
    changed = np.array(array)
    changed[index] = value
    return changed


def uniform(key: Randomness, shape: tuple[int, ...], low: float = 0.0, high: float = 1.0) -> Float[Array, "..."]:
    """Numbers drawn uniformly from [low, high), float32."""
    if isinstance(key, np.random.Generator):
        return key.uniform(low, high, shape).astype(np.float32)
    return jax.random.uniform(key, shape, minval=low, maxval=high)


def split(key: Randomness) -> tuple[Randomness, Randomness]:
    """Two sources of randomness out of one; a generator serves twice."""
    if isinstance(key, np.random.Generator):
        return key, key
    one, other = jax.random.split(key)
    return one, other


__all__ = ["Randomness", "namespace", "put", "split", "uniform"]
