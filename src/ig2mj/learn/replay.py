"""`Replay`: the last steps of all worlds, on the device, and samples of it over n steps.

A ring of T steps of W worlds. The observation after a step is kept next to the one before it: where an episode was
cut off, the two neighbours in the ring are of different episodes, and the value of the last state is still needed.

Axes: T steps, W worlds, B samples, n numbers of an action, v of a vector, q bytes of an image.
"""

from __future__ import annotations

import dataclasses
import functools

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float, Int, UInt8

from ig2mj.engine.view import Array
from ig2mj.learn.collect import Transition
from ig2mj.learn.demos import Demos
from ig2mj.learn.perception import Perception, Seen


def write_ring(ring: Array, new: Array, *, head: Int[Array, ""]) -> Array:
    """A ring buffer [T, ...] with new rows [t, ...] from row `head` on, which must not pass its end."""
    return jax.lax.dynamic_update_slice_in_dim(ring, new.astype(ring.dtype), head, 0)


@struct.dataclass
class Sample:
    """Steps to learn from.

    Attributes:
      reward: of up to n steps, discounted. discount: of the value of `after`: 0 where nothing comes after it.
      label: what an expert would have done; without columns where there was none.
    """

    seen: Seen
    action: Float[Array, "*b n"]
    reward: Float[Array, "*b"]
    discount: Float[Array, "*b"]
    after: Seen
    label: Float[Array, "*b l"]


@struct.dataclass
class Replay:
    """See the module's text. `label`: what an expert would have done; without columns where there is none. `head`: row
    that is written next. `size`: rows that are full."""

    vector: Float[Array, "T W v"]
    image: UInt8[Array, "T W q"]
    action: Float[Array, "T W n"]
    reward: Float[Array, "T W"]
    terminated: Bool[Array, "T W"]
    truncated: Bool[Array, "T W"]
    after_vector: Float[Array, "T W v"]
    after_image: UInt8[Array, "T W q"]
    label: Float[Array, "T W l"]
    head: Int[Array, ""]
    size: Int[Array, ""]

    @classmethod
    def empty(cls, steps: int, worlds: int, perception: Perception, action_size: int, label_size: int = 0) -> Replay:
        """Room for so many steps of so many worlds. `label_size`: numbers of an expert's action, 0 without one."""
        bytes_ = perception.image_bytes

        def zeros(*tail: int, dtype: type = jnp.float32) -> Array:
            return jnp.zeros((steps, worlds, *tail), dtype)

        return cls(
            vector=zeros(perception.vector_size),
            image=zeros(bytes_, dtype=jnp.uint8),
            action=zeros(action_size),
            reward=zeros(),
            terminated=zeros(dtype=jnp.bool_),
            truncated=zeros(dtype=jnp.bool_),
            after_vector=zeros(perception.vector_size),
            after_image=zeros(bytes_, dtype=jnp.uint8),
            label=zeros(label_size),
            head=jnp.int32(0),
            size=jnp.int32(0),
        )

    @classmethod
    def of_demos(cls, demos: Demos, labelled: bool = False) -> Replay:
        """A full ring of demonstrations, as if one world had made them one after the other. `labelled`: with labels."""
        count = demos.reward.shape[0]
        columns = {
            "vector": demos.seen.vector,
            "image": demos.seen.image,
            "action": demos.action,
            "reward": demos.reward,
            "terminated": demos.terminated,
            "truncated": demos.truncated,
            "after_vector": demos.after.vector,
            "after_image": demos.after.image,
            "label": demos.label if labelled else demos.label[:, :0],
        }
        one = {name: a.reshape(count, 1, *a.shape[1:]) for name, a in columns.items()}
        return cls(**one, head=jnp.int32(0), size=jnp.int32(count))

    @property
    def capacity(self) -> int:
        """T."""
        return self.reward.shape[0]

    def insert(self, rollout: Transition) -> Replay:
        """With the steps of a rollout in place of the oldest. Its length must divide the capacity."""
        length = rollout.reward.shape[0]
        assert self.capacity % length == 0, "a rollout is written without a seam"

        put = functools.partial(write_ring, head=self.head)
        return dataclasses.replace(
            self,
            vector=put(self.vector, rollout.seen.vector),
            image=put(self.image, rollout.seen.image),
            action=put(self.action, rollout.action),
            reward=put(self.reward, rollout.reward),
            terminated=put(self.terminated, rollout.terminated),
            truncated=put(self.truncated, rollout.truncated),
            after_vector=put(self.after_vector, rollout.after.vector),
            after_image=put(self.after_image, rollout.after.image),
            label=put(self.label, rollout.extra["label"]) if self.label.shape[-1] else self.label,
            head=(self.head + length) % self.capacity,
            size=jnp.minimum(self.size + length, self.capacity),
        )

    def sample(self, key: Array, count: int, horizon: int, gamma: float) -> Sample:
        """So many steps, all equally likely, each with the rewards of up to `horizon` steps from it on.

        The rewards stop where the episode does. Where it was cut off, the value of what was seen last still counts.
        The newest `horizon - 1` rows are only ends.
        """
        age_key, world_key = jax.random.split(key)
        starts = jnp.maximum(self.size - horizon + 1, 1)
        first = (self.head - self.size) % self.capacity
        age = jax.random.randint(age_key, (count,), 0, starts)
        world = jax.random.randint(world_key, (count,), 0, self.reward.shape[1])
        row = (first + age) % self.capacity
        rows = (row[:, None] + jnp.arange(horizon)) % self.capacity
        rewards, terminated = self.reward[rows, world[:, None]], self.terminated[rows, world[:, None]]
        done = terminated | self.truncated[rows, world[:, None]]
        running = jnp.cumprod(jnp.concatenate([jnp.ones((count, 1)), 1.0 - done[:, :-1]], axis=1), axis=1)
        discounts = gamma ** jnp.arange(horizon, dtype=jnp.float32)
        taken = running.sum(1).astype(jnp.int32)  # steps up to the end of the episode
        last = rows[jnp.arange(count), taken - 1]
        ends = self.terminated[last, world]
        return Sample(
            seen=Seen(self.vector[row, world], self.image[row, world]),
            action=self.action[row, world],
            reward=(running * rewards * discounts).sum(1),
            discount=jnp.where(ends, 0.0, gamma ** taken.astype(jnp.float32)),
            after=Seen(self.after_vector[last, world], self.after_image[last, world]),
            label=self.label[row, world],
        )
