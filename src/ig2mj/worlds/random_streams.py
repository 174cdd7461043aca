"""Random keys of worlds. A stream belongs to (seed, world, episode), so world 0 is the same in a batch of any size."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int, UInt

from ig2mj.engine.view import Array

Seed = int | np.integer | Array
"""A whole number, or a key of JAX."""


def as_seed(seed: Seed) -> int | Int[Array, ""]:
    """A seed of 31 bits from a number or a key of JAX."""
    if isinstance(seed, jax.Array) and (jnp.issubdtype(seed.dtype, jax.dtypes.prng_key) or seed.ndim == 1):
        return (jax.random.bits(seed, (), jnp.uint32) >> 1).astype(jnp.int32)
    return int(seed) % 2**31 if isinstance(seed, int | np.integer) else jnp.asarray(seed, jnp.int32)


def episode_keys(seed: Int[Array, ""] | int, world: Int[Array, "W"], episode: Int[Array, "W"]) -> UInt[Array, "W 2"]:
    """The key of each world's episode, as raw key data."""
    root = jax.random.PRNGKey(seed)
    return jax.vmap(lambda w, e: jax.random.fold_in(jax.random.fold_in(root, w), e))(world, episode)


def step_keys(key: UInt[Array, "W 2"], step: Int[Array, "W"]) -> UInt[Array, "W 2"]:
    """The key of one control step of each world's episode."""
    return jax.vmap(jax.random.fold_in)(key, step)


def pick_rows(key: UInt[Array, "W 2"], count: int) -> Int[Array, "W"]:
    """A row below `count` for each world's episode, all equally likely."""
    return jax.vmap(lambda k: jax.random.randint(jax.random.fold_in(k, 0x706F6F6C), (), 0, count))(key).astype(
        jnp.int32
    )
