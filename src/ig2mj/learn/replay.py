"""`Replay`: the last steps of all worlds, on the device, and samples of it over n steps.

A ring of T steps of W worlds. The observation after a step is kept next to the one before it: where an episode was
cut off, the two neighbours in the ring are of different episodes, and the value of the last state is still needed.

Worlds that are stepped in turn, such as those of several homes, are groups of equally many neighbouring columns, each
with a ring of its own.

Axes: T steps, W worlds, G groups, B samples, n numbers of an action, v of a vector, q bytes of an image.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float, Int, Shaped, UInt8

from ig2mj.engine.view import Array
from ig2mj.learn.collect import Transition
from ig2mj.learn.demos import Demos
from ig2mj.learn.perception import Perception, Seen


@struct.dataclass
class RingHeads:
    """Where rings of T rows are written: one for all worlds, or one for each group of worlds.

    Attributes:
      head: row that is written next. size: rows that are full. Both have an axis only where there are several groups.
    """

    head: Int[Array, "*G"]
    size: Int[Array, "*G"]

    @classmethod
    def empty(cls, groups: int = 1) -> RingHeads:
        """Nothing is written yet."""
        shape = () if groups == 1 else (groups,)
        return cls(jnp.zeros(shape, jnp.int32), jnp.zeros(shape, jnp.int32))

    def write(self, ring: Shaped[Array, "T W *x"], new: Shaped[Array, "t w *x"], group: Any) -> Array:
        """A ring with new rows of a group, which must not pass its end. `w`: worlds of a group."""
        row, column = (self.head, 0) if self.head.ndim == 0 else (self.head[group], group * new.shape[1])
        return jax.lax.dynamic_update_slice(ring, new.astype(ring.dtype), (row, column, *[0] * (ring.ndim - 2)))

    def after(self, rows: int, capacity: int, group: Any) -> RingHeads:
        """Once so many rows of a group are written."""
        new = RingHeads((self.head + rows) % capacity, jnp.minimum(self.size + rows, capacity))
        if self.head.ndim == 0:
            return new
        return jax.tree.map(functools.partial(jnp.where, jnp.arange(len(self.head)) == group), new, self)

    def of(self, world: Int[Array, "B"], worlds: int) -> tuple[Int[Array, "*B"], Int[Array, "*B"]]:
        """`head` and `size` for these of all `worlds`."""
        if self.head.ndim == 0:
            return self.head, self.size
        group = world // (worlds // len(self.head))
        return self.head[group], self.size[group]

    @property
    def fields(self) -> dict[str, Array]:
        """By name."""
        return {"head": self.head, "size": self.size}


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
    """See the module's text.

    Attributes:
      label: what an expert would have done; without columns where there is none.
      head, size: `RingHeads`.
    """

    vector: Float[Array, "T W v"]
    image: UInt8[Array, "T W q"]
    action: Float[Array, "T W n"]
    reward: Float[Array, "T W"]
    terminated: Bool[Array, "T W"]
    truncated: Bool[Array, "T W"]
    after_vector: Float[Array, "T W v"]
    after_image: UInt8[Array, "T W q"]
    label: Float[Array, "T W l"]
    head: Int[Array, "*G"]
    size: Int[Array, "*G"]

    @classmethod
    def empty(
        cls, steps: int, worlds: int, perception: Perception, action_size: int, label_size: int = 0, groups: int = 1
    ) -> Replay:
        """Room for so many steps of so many worlds. `label_size`: numbers of an expert's action, 0 without one.
        `groups`: of worlds that are stepped in turn."""
        bytes_ = perception.image_bytes

        def zeros(*tail: int, dtype: type = jnp.float32) -> Array:
            return jnp.zeros((steps, worlds, *tail), dtype)

        @jax.jit  # one program, not one for each array
        def made() -> Replay:
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
                **RingHeads.empty(groups).fields,
            )

        return made()

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

    def insert(self, rollout: Transition, group: Any = 0) -> Replay:
        """With the steps of a rollout in place of the oldest. Its length must divide the capacity. `group`: of which
        worlds."""
        length = rollout.reward.shape[0]
        assert self.capacity % length == 0, "a rollout is written without a seam"

        heads = RingHeads(self.head, self.size)
        put = functools.partial(heads.write, group=group)
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
            **heads.after(length, self.capacity, group).fields,
        )

    def sample(self, key: Array, count: int, horizon: int, gamma: float) -> Sample:
        """So many steps, all equally likely, each with the rewards of up to `horizon` steps from it on.

        The rewards stop where the episode does. Where it was cut off, the value of what was seen last still counts.
        The newest `horizon - 1` rows are only ends.
        """
        age_key, world_key = jax.random.split(key)
        world = jax.random.randint(world_key, (count,), 0, self.reward.shape[1])
        head, size = RingHeads(self.head, self.size).of(world, self.reward.shape[1])
        starts = jnp.maximum(size - horizon + 1, 1)
        first = (head - size) % self.capacity
        age = jax.random.randint(age_key, (count,), 0, starts)
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
