"""How many worlds fit into a device's memory, for the message when they do not."""

from __future__ import annotations

import math
from typing import Any

import jax

from ig2mj.learn.iteration import Algorithm

OUT_OF_MEMORY = ("RESOURCE_EXHAUSTED", "Out of memory", "Failed to allocate")
"""What XLA's and Warp's errors say, which have no type of their own."""

OBJECT_BYTES, PICTURE_BYTES = 1.85e6 / 64, 0.353e6
"""Largest memory of a world on the device, for each object of the scene and with 128x128 colours and depth: measured in
CookingMeat (64 objects, humanoid, 4,096 worlds on an H200; benchmarks/results/environments)."""

USED = 0.9
"""Share of the memory that is counted on; what a program needs while it runs takes the rest."""

STEP = 64
"""Numbers of worlds are suggested in multiples of this."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether a device had too little memory."""
    return any(sign in str(error) for sign in OUT_OF_MEMORY)


def world_bytes(env: Any) -> float:
    """Of one world on the device, about."""
    objects = getattr(getattr(env, "scene", None), "tables", None)
    count = len(objects.object_names) if objects is not None else 64
    return OBJECT_BYTES * count + PICTURE_BYTES * ("rgb" in env.observation_spaces)


def memory_bytes(algorithm: Algorithm, worlds: int) -> int:
    """Of a replay buffer, or whatever else an algorithm keeps of so many worlds. Nothing is allocated."""
    leaves = jax.eval_shape(lambda: jax.tree.leaves(algorithm.memory(worlds)))
    return sum(math.prod(a.shape) * a.dtype.itemsize for a in leaves)


def worlds_that_fit(env: Any, algorithm: Algorithm, worlds: int, devices: int, limit: int) -> int:
    """The largest number of worlds, fewer than `worlds`, that `limit` bytes on each device hold; 0: none."""
    each = world_bytes(env)
    for count in range(worlds - worlds % (STEP * devices), 0, -STEP * devices):
        if count < worlds and (each * count + memory_bytes(algorithm, count)) / devices <= USED * limit:
            return count
    return 0


def too_large(env: Any, algorithm: Algorithm, worlds: int, devices: int = 1) -> str:
    """One line: what did not fit, and what would."""
    limit = (jax.local_devices()[0].memory_stats() or {}).get("bytes_limit")
    kept = memory_bytes(algorithm, worlds) / devices
    if not limit:
        return (
            f"{worlds} worlds and what is learned from do not fit into the device's memory: try "
            f"--worlds {worlds // 2}, or for sac and dagger a smaller --set capacity=... ({kept / 1e9:.1f} GB now)"
        )
    fit = worlds_that_fit(env, algorithm, worlds, devices, limit)
    what = f"{worlds} worlds do not fit into {limit / 1e9:.1f} GB of device memory"
    each = f"a world takes about {world_bytes(env) / 1e6:.1f} MB, what is learned from {kept / 1e9:.1f} GB"
    if fit:
        return f"{what}: about {fit} would (--worlds {fit}); {each} (--set capacity=... for sac and dagger)"
    return f"{what}: {each}; take a smaller --set capacity=... (sac and dagger) or fewer pictures"
