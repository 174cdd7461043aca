"""What was seen and what should be done there: the data of imitation, and its loss.

Axes: T steps, W worlds, B samples, L of them with labels, n numbers of an action, v of a vector, q bytes of a picture.
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
    """The last T steps of W worlds. `head`: row that is written next. `size`: rows that are full. `starts`: start
    states, which have no labels."""

    vector: Float[Array, "T W v"]
    picture: UInt8[Array, "T W q"]
    label: Float[Array, "T W n"]
    head: Int[Array, ""]
    size: Int[Array, ""]
    starts: Seen | None = None

    @classmethod
    def empty(
        cls, steps: int, worlds: int, perception: Perception, action_size: int, starts: Seen | None = None
    ) -> Labels:
        """Room for so many steps of so many worlds."""
        shape = perception.picture_shape
        pixels = 0 if shape is None else shape[0] * shape[1] * shape[2]
        return cls(
            vector=jnp.zeros((steps, worlds, perception.vector_size)),
            picture=jnp.zeros((steps, worlds, pixels), jnp.uint8),
            label=jnp.zeros((steps, worlds, action_size)),
            head=jnp.int32(0),
            size=jnp.int32(0),
            starts=starts,
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

    def told(self, key: Array, count: int) -> tuple[Float[Array, "B v"], Float[Array, "B n"]]:
        """So many steps without their pictures."""
        row_key, world_key = jax.random.split(key)
        row = jax.random.randint(row_key, (count,), 0, jnp.maximum(self.size, 1))
        world = jax.random.randint(world_key, (count,), 0, self.label.shape[1])
        return self.vector[row, world], self.label[row, world]


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
        self,
        params: Any,
        moments: Moments,
        seen: Seen,
        label: Float[Array, "L n"],
        key: Array,
        told: tuple[Float[Array, "B v"], Float[Array, "B n"]] | None = None,
    ) -> tuple[Array, dict[str, Array]]:
        """How far the actor is from the label ("actor_loss", see `heads.label_loss`; "label_error", the mean absolute
        difference of its action); with pictures, also its guess from the truth of what it cannot see.

        Args:
          seen: L samples that have labels, and any number that do not, of which only the guess is learnt.
          told: more samples without their pictures, and their labels. The actor is told the truth there, with the
            errors that its guesses have of some of `seen`.
        """
        count, normal, found = label.shape[0], moments.normal(seen.vector), dict[str, Array]()
        picture, size = seen.picture, self._perception.actor_size
        if self._perception.picture_shape is not None:
            picture = shifted(picture, self._perception.picture_shape, key, self._shift)
        shake = {SHAKEN: jax.random.fold_in(key, 1)}
        looked: Any = self.actor.apply({"params": params}, normal[:, :size], picture, rngs=shake)
        head, _, guess = looked
        loss = jnp.float32(0)
        if count:
            loss = found["actor_loss"] = label_loss(head[:count], label)
            found["label_error"] = jnp.abs(likeliest(head[:count]) - label).mean()
        hidden = self._perception.hidden
        if hidden is not None and guess.shape[-1]:
            found["guess_loss"] = hidden.loss(guess, seen.vector, normal)
            loss += self._weight * found["guess_loss"]
            if told is not None:
                vector, wanted = told
                wrong = jax.lax.stop_gradient(guess - hidden(seen.vector, normal, guess.shape[-1]))[:count]
                which = jax.random.randint(jax.random.fold_in(key, 2), wanted.shape[:1], 0, count)
                own = moments.normal(vector)
                belief = hidden(vector, own, guess.shape[-1]) + wrong[which]
                none = jnp.zeros((len(wanted), 0), jnp.uint8)
                looked = self.actor.apply({"params": params}, own[:, :size], none, belief)
                found["told_loss"] = label_loss(looked[0], wanted)
                loss += found["told_loss"]
        return loss, found

    def update(
        self, learner: Any, seen: Seen, label: Float[Array, "L n"], key: Array, rate: Array, told: Any = None
    ) -> tuple[Any, dict[str, Array]]:
        """One update of a learner that has `actor`, `opt`, `moments` and `updates`; the rest as for `loss`."""
        slope, found = jax.grad(self.loss, has_aux=True)(learner.actor, learner.moments, seen, label, key, told)
        step, opt = self._adam.update(slope, learner.opt)
        actor = jax.tree.map(lambda a, s: a - rate * s, learner.actor, step)
        return dataclasses.replace(learner, actor=actor, opt=opt, updates=learner.updates + 1), found
