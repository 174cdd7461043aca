"""What was seen and what should be done there: the data of imitation, and its loss.

Axes: T steps, W worlds, B samples, n numbers of an action, v of a vector, q bytes of a picture.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Float, Int, UInt8

from ig2mj.engine.view import Array
from ig2mj.learn.adam import averaged_adam
from ig2mj.learn.heads import label_loss, likeliest
from ig2mj.learn.moments import Moments
from ig2mj.learn.networks import SHAKEN, Actor, shifted
from ig2mj.learn.perception import Perception, Seen, blank


@struct.dataclass
class Labels:
    """The last T steps of W worlds. `head`: row that is written next. `size`: rows that are full."""

    vector: Float[Array, "T W v"]
    picture: UInt8[Array, "T W q"]
    label: Float[Array, "T W n"]
    head: Int[Array, ""]
    size: Int[Array, ""]

    @classmethod
    def empty(cls, steps: int, worlds: int, perception: Perception, action_size: int) -> Labels:
        """Room for so many steps of so many worlds."""
        shape = perception.picture_shape
        pixels = 0 if shape is None else shape[0] * shape[1] * shape[2]
        return cls(
            vector=jnp.zeros((steps, worlds, perception.vector_size)),
            picture=jnp.zeros((steps, worlds, pixels), jnp.uint8),
            label=jnp.zeros((steps, worlds, action_size)),
            head=jnp.int32(0),
            size=jnp.int32(0),
        )

    def insert(self, seen: Seen, label: Float[Array, "t W n"]) -> Labels:
        """With more steps in place of the oldest; their number must divide T."""
        count, capacity = label.shape[0], self.label.shape[0]
        assert capacity % count == 0, "steps are written without a seam"

        def put(ring: Array, new: Array) -> Array:
            return jax.lax.dynamic_update_slice_in_dim(ring, new.astype(ring.dtype), self.head, 0)

        return dataclasses.replace(
            self,
            vector=put(self.vector, seen.vector),
            picture=put(self.picture, seen.picture),
            label=put(self.label, label),
            head=(self.head + count) % capacity,
            size=jnp.minimum(self.size + count, capacity),
        )

    def sample(self, key: Array, count: int) -> tuple[Seen, Float[Array, "B n"]]:
        """So many steps, all equally likely."""
        row_key, world_key = jax.random.split(key)
        row = jax.random.randint(row_key, (count,), 0, jnp.maximum(self.size, 1))
        world = jax.random.randint(world_key, (count,), 0, self.label.shape[1])
        return Seen(self.vector[row, world], self.picture[row, world]), self.label[row, world]


class Imitation:
    """An actor that learns labels. All methods are pure.

    Attributes:
      actor: the network.
    """

    def __init__(self, perception: Perception, action_size: int, config: Any, axis: str | None = None):
        """`config`: of cloning or DAgger. `axis`: the name of an axis of devices over which gradients are averaged."""
        guess = perception.hidden.size if perception.hidden and config.guess else 0
        shape = perception.picture_shape
        self.actor = Actor(action_size, config.actor, shape, config.net, guess, config.choices, perception.objects)
        self._perception, self._weight, self._shift, self._axis = perception, config.guess, config.shift, axis
        self._adam = averaged_adam(10.0, axis)

    def init(self, key: Array) -> tuple[Any, Any]:
        """Parameters and the optimiser's state, untrained."""
        seen, size = blank(self._perception, 1), self._perception.actor_size
        params = self.actor.init(jnp.asarray(key), seen.vector[:, :size], seen.picture)["params"]
        return params, self._adam.init(params)

    def loss(
        self, params: Any, moments: Moments, seen: Seen, label: Float[Array, "B n"], key: Array
    ) -> tuple[Array, dict[str, Array]]:
        """How far the actor is from the label ("actor_loss", see `heads.label_loss`; "label_error", the mean absolute
        difference of its action); with pictures, also its guess from the truth of what it cannot see."""
        normal = moments.normal(seen.vector)
        picture = seen.picture
        if self._perception.picture_shape is not None:
            picture = shifted(picture, self._perception.picture_shape, key, self._shift)
        own, shake = normal[:, : self._perception.actor_size], {SHAKEN: jax.random.fold_in(key, 1)}
        looked: Any = self.actor.apply({"params": params}, own, picture, rngs=shake)
        head, _, guess = looked
        loss = label_loss(head, label)
        found: dict[str, Array] = {"actor_loss": loss, "label_error": jnp.abs(likeliest(head) - label).mean()}
        if self._perception.hidden is not None and guess.shape[-1]:
            found["guess_loss"] = self._perception.hidden.loss(guess, seen.vector, normal)
            loss += self._weight * found["guess_loss"]
        return loss, found

    def update(
        self, learner: Any, seen: Seen, label: Float[Array, "B n"], key: Array, rate: Array
    ) -> tuple[Any, dict[str, Array]]:
        """One update of a learner that has `actor`, `opt`, `moments` and `updates`."""
        slope, found = jax.grad(self.loss, has_aux=True)(learner.actor, learner.moments, seen, label, key)
        step, opt = self._adam.update(slope, learner.opt)
        actor = jax.tree.map(lambda a, s: a - rate * s, learner.actor, step)
        return dataclasses.replace(learner, actor=actor, opt=opt, updates=learner.updates + 1), found
