"""Running means, deviations and scales. With `axis`, over all devices of that axis of a `shard_map`.

Axes: W worlds, T steps, v numbers.
"""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array

LIMIT = 10.0
"""Normalized numbers are clipped to this."""

FLOOR = 1e-4
"""Added to variances, so that the noise of a constant number is not amplified."""


def normal(values: Float[Array, "*b x"], mean: Float[Array, "x"], deviation: Float[Array, "x"]) -> Float[Array, "*b x"]:
    """Numbers with mean 0 and deviation 1, within `LIMIT`."""
    return jnp.clip((values - mean) / deviation, -LIMIT, LIMIT)


@struct.dataclass
class RunningStats:
    """Mean and variance of every number of a vector. `count`: how many samples those of each number are of."""

    mean: Float[Array, "v"]
    var: Float[Array, "v"]
    count: Float[Array, "v"]

    @classmethod
    def initial(cls, size: int) -> RunningStats:
        """Of nothing yet: `normal` changes nothing."""
        return cls(jnp.zeros(size), jnp.ones(size), jnp.zeros(size))

    def update(self, values: Float[Array, "*b v"], axis: str | None = None) -> RunningStats:
        """With more samples."""
        flat = values.reshape(-1, values.shape[-1])
        mean, square, count = flat.mean(0), jnp.square(flat - self.mean).mean(0), jnp.float32(flat.shape[0])
        mean, square = average((mean, square), axis)
        if axis is not None:
            count = jax.lax.psum(count, axis)
        total = self.count + count
        change = mean - self.mean
        new = (self.var * self.count + square * count) / total - jnp.square(change * count / total)
        return RunningStats(self.mean + change * count / total, jnp.maximum(new, 0.0), total)

    def normal(self, values: Float[Array, "*b x"]) -> Float[Array, "*b x"]:
        """The first x numbers of a vector with mean 0 and deviation 1; those that never change are 0."""
        return normal(values, *self.scales(values.shape[-1]))

    def scales(self, size: int) -> tuple[Float[Array, "x"], Float[Array, "x"]]:
        """Mean and deviation of the first x = `size` numbers."""
        return self.mean[:size], jnp.sqrt(self.var[:size] + FLOOR)

    @classmethod
    def of(cls, mean: Float[Array, "v"], deviation: Float[Array, "v"], count: Float[Array, "v"]) -> RunningStats:
        """With these `scales`, as of so many samples; 0: the first samples alone count."""
        var = jnp.maximum(jnp.square(jnp.asarray(deviation, jnp.float32)) - FLOOR, 0.0)
        return cls(jnp.asarray(mean, jnp.float32), var, jnp.asarray(count, jnp.float32))


RARE = 500
"""Of so many worlds one may have an outlier as its return without any effect."""


@struct.dataclass
class RewardScale:
    """How large discounted returns are, for rewards of a common size.

    Attributes:
      running: return of each world so far, discounted forwards. var: of it.
      largest: its largest absolute value, without one world in `RARE`: an object that physics throws across the house
        would otherwise scale all other rewards down for the rest of the run.
    """

    running: Float[Array, "W"]
    var: Float[Array, ""]
    largest: Float[Array, ""]
    count: Float[Array, ""]

    @classmethod
    def initial(cls, num_worlds: int) -> RewardScale:
        """Before the first reward."""
        return cls(jnp.zeros(num_worlds), jnp.float32(0), jnp.float32(0), jnp.float32(0))

    def update(
        self,
        reward: Float[Array, "T w"],
        done: Bool[Array, "T w"],
        gamma: float,
        axis: str | None = None,
        group: Any = 0,
    ) -> RewardScale:
        """After more steps, of all worlds or of that group of equally many neighbours."""

        def step(running: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
            running = running * gamma + now[0]
            return jnp.where(now[1], 0.0, running), running

        count = reward.shape[1]
        before = jax.lax.dynamic_slice_in_dim(self.running, group * count, count)
        after, returns = jax.lax.scan(step, before, (reward, done))
        running = jax.lax.dynamic_update_slice_in_dim(self.running, after, group * count, 0)
        sizes = jnp.sort(jnp.abs(returns).max(0))
        square, largest = average(jnp.square(returns).mean(), axis), sizes[-1 - len(sizes) // RARE]
        if axis is not None:
            largest = jax.lax.pmax(largest, axis)
        share = reward.shape[0] / (self.count + reward.shape[0])
        var = self.var + jnp.maximum(share, 1e-3) * (square - self.var)
        return RewardScale(running, var, jnp.maximum(self.largest, largest), self.count + reward.shape[0])

    def factor(self, largest: float) -> Float[Array, ""]:
        """What rewards are multiplied with: returns then have deviation 1 at most, and at most the size `largest`."""
        return 1.0 / jnp.maximum(jnp.maximum(jnp.sqrt(self.var), self.largest / largest), 1e-3)


def average(tree: Any, axis: str | None) -> Any:
    """Over the devices of an axis; without one, as it is."""
    return tree if axis is None else jax.lax.pmean(tree, axis)


def share_of(batch: int, axis: str | None) -> int:
    """One device's samples of a batch that the devices of an axis share; without one, all of them."""
    return batch if axis is None else max(batch // jax.lax.axis_size(axis), 1)
