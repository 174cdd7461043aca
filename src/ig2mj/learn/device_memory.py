"""How many worlds fit into a device's memory, for the message when they do not."""

from __future__ import annotations

import math
from typing import Any

import jax

from ig2mj.learn.iteration import Algorithm

COPIES = 2.2
"""Memory of a device per byte of an environment's state: the state before and after a step, and what a step needs
besides. Measured with 4,096 worlds of CookingMeat on an H200, state observations and RGB-D: 2.15 and 2.26."""

USED = 0.9
"""Share of the memory that is counted on; what a program needs while it runs takes the rest."""

STEP = 64
"""Numbers of worlds are suggested in multiples of this."""


def world_bytes(env: Any) -> float:
    """Of one world on the device, estimated from the shapes of the environment's state; nothing is computed. 0 where
    worlds are not on a device."""
    if not env.pure:
        return 0.0
    return COPIES * _bytes(jax.eval_shape(lambda: jax.tree.leaves(env.reset(0)))) / env.num_worlds


def buffer_bytes(algorithm: Algorithm, worlds: int) -> int:
    """Of a replay buffer, or whatever else an algorithm keeps of so many worlds. Nothing is allocated."""
    return _bytes(jax.eval_shape(lambda: jax.tree.leaves(algorithm.buffer(worlds))))


def _bytes(leaves: list[Any]) -> int:
    return sum(math.prod(a.shape) * a.dtype.itemsize for a in leaves)


def worlds_that_fit(env: Any, algorithm: Algorithm, worlds: int, devices: int, limit: int) -> int:
    """The largest number of worlds, fewer than `worlds`, that `limit` bytes on each device hold; 0: none."""
    each = world_bytes(env)
    for count in range(worlds - worlds % (STEP * devices), 0, -STEP * devices):
        if count < worlds and (each * count + buffer_bytes(algorithm, count)) / devices <= USED * limit:
            return count
    return 0


def too_large(env: Any, algorithm: Algorithm, worlds: int, devices: int = 1) -> str:
    """One line: what did not fit, and what would."""
    limit = (jax.local_devices()[0].memory_stats() or {}).get("bytes_limit")
    kept = f"the replay buffer takes {buffer_bytes(algorithm, worlds) / devices / 1e9:.1f} GB"
    smaller = "a smaller --set buffer_size=... (sac and dagger)"
    if not limit:
        return (
            f"{worlds} worlds and the replay buffer do not fit into the device's memory: try --worlds {worlds // 2}, "
            f"or {smaller}; {kept}"
        )
    fit = worlds_that_fit(env, algorithm, worlds, devices, limit)
    what = f"{worlds} worlds do not fit into {limit / 1e9:.1f} GB of device memory"
    each = f"a world takes about {world_bytes(env) / 1e6:.1f} MB, {kept}"
    if fit:
        return f"{what}: about {fit} would (--worlds {fit}); {each}; or take {smaller}"
    return f"{what}: {each}; take {smaller} or smaller images"
