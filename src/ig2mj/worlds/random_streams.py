"""Random keys of worlds. A stream belongs to (seed, world, episode), so world 0 is the same in a batch of any size."""

from __future__ import annotations

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int, UInt

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.process import entry_point

Seeds = int | Int[Array, "*seeds"]
"""A seed of all worlds, or [W] of each."""

LARGEST = 2**31
"""Seeds are taken modulo this number."""

Seed = int | np.integer | Array | Sequence[int]
"""A whole number, a key of JAX, or a list (tuple, array of NumPy) of W numbers, one for each world."""


@entry_point
def as_seed(seed: Seed, num_worlds: int | None = None) -> int | Int[Array, ""] | Int[np.ndarray, "W"]:
    """A seed of 31 bits, or one for each world, of which each then starts as world 0 of a batch with its seed does.

    Args:
      num_worlds: W; None: a list is refused.

    Raises:
      EngineError: not a whole number for each world.
    """
    if isinstance(seed, jax.Array) and (jnp.issubdtype(seed.dtype, jax.dtypes.prng_key) or seed.ndim):
        _check_one_key(seed)
        return (jax.random.bits(seed, (), jnp.uint32) >> 1).astype(jnp.int32)
    if isinstance(seed, int | np.integer):
        return int(seed) % LARGEST
    if isinstance(seed, Sequence | np.ndarray) and np.ndim(seed):  # pyright: ignore[reportArgumentType]
        seeds = np.asarray(seed)
        if num_worlds is None or seeds.shape != (num_worlds,) or not np.issubdtype(seeds.dtype, np.integer):
            requested = "one whole number" if num_worlds is None else f"{num_worlds} whole numbers, one for each world"
            raise EngineError(f"seeds have shape {seeds.shape} and are of {seeds.dtype}: {requested} or a single one")
        return np.array([int(s) % LARGEST for s in seeds], np.int32)
    if not isinstance(seed, jax.Array | np.ndarray) or not jnp.issubdtype(seed.dtype, jnp.integer):
        raise EngineError(f"a seed is a whole number or a key of JAX, not {seed!r}")
    return jnp.asarray(seed, jnp.int32)


def _check_one_key(key: jax.Array) -> None:
    """Raises EngineError: not a single key."""
    typed = jnp.issubdtype(key.dtype, jax.dtypes.prng_key)
    if key.ndim if typed else (key.ndim != 1 or key.dtype != jnp.uint32):
        words = "an environment takes one key or seed for all worlds, or a list of whole numbers, one for each"
        raise EngineError(f"an array of JAX as seed has shape {key.shape} and is of {key.dtype}: {words}")


def episode_keys(seed: Seeds, world: Int[Array, "W"], episode: Int[Array, "W"]) -> UInt[Array, "W 2"]:
    """The key of each world's episode, as raw key data."""

    def key(seed: Array | int, world: Array, episode: Array) -> Array:
        return jax.random.fold_in(jax.random.fold_in(jax.random.PRNGKey(seed), world), episode)

    return jax.vmap(key, (0 if np.ndim(seed) else None, 0, 0))(seed, world, episode)


def step_keys(key: UInt[Array, "W 2"], step: Int[Array, "W"]) -> UInt[Array, "W 2"]:
    """The key of one control step of each world's episode."""
    return jax.vmap(jax.random.fold_in)(key, step)


def pick_rows(key: UInt[Array, "W 2"], count: int) -> Int[Array, "W"]:
    """A row below `count` for each world's episode, all equally likely."""
    return jax.vmap(lambda k: jax.random.randint(jax.random.fold_in(k, 0x706F6F6C), (), 0, count))(key).astype(
        jnp.int32
    )
