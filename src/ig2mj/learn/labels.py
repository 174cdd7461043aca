"""What was seen and what should be done there: the data of imitation, and its loss.

Axes: T steps, W worlds, B samples, L of them with labels, n numbers of an action, v of a vector, q bytes of a picture.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float, Int, UInt8

from ig2mj.engine.view import Array
from ig2mj.learn.adam import averaged_adam
from ig2mj.learn.heads import label_loss, likeliest
from ig2mj.learn.moments import Moments
from ig2mj.learn.networks import SHAKEN, Actor, shifted
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.recall import Recall, looked

Told = tuple[Float[Array, "B v"], Float[Array, "B n"], Float[Array, "B m"], Float[Array, "B g"]]
"""Steps without their pictures (`Labels.told`)."""


@struct.dataclass
class Labels:
    """The last T steps of W worlds. `head`: row that is written next. `size`: rows that are full. `starts`: start
    states, which have no labels. `recalled`: what was remembered (`ig2mj.learn.recall`). `guess`: what the actor
    guessed as it acted."""

    vector: Float[Array, "T W v"]
    picture: UInt8[Array, "T W q"]
    label: Float[Array, "T W n"]
    head: Int[Array, ""]
    size: Int[Array, ""]
    recalled: Float[Array, "T W m"]
    guess: Float[Array, "T W g"]
    starts: Seen | None = None

    @classmethod
    def empty(
        cls,
        steps: int,
        worlds: int,
        perception: Perception,
        action_size: int,
        starts: Seen | None = None,
        recalled: int = 0,
        guess: int = 0,
    ) -> Labels:
        """Room for so many steps of so many worlds. `recalled`: m. `guess`: g; 0 where guesses are not kept."""
        shape = perception.picture_shape
        pixels = 0 if shape is None else shape[0] * shape[1] * shape[2]
        return cls(
            vector=jnp.zeros((steps, worlds, perception.vector_size)),
            picture=jnp.zeros((steps, worlds, pixels), jnp.uint8),
            label=jnp.zeros((steps, worlds, action_size)),
            head=jnp.int32(0),
            size=jnp.int32(0),
            recalled=jnp.zeros((steps, worlds, recalled)),
            guess=jnp.zeros((steps, worlds, guess)),
            starts=starts,
        )

    def insert(
        self,
        seen: Seen,
        label: Float[Array, "t W n"],
        recalled: Float[Array, "t W m"] | None = None,
        guess: Float[Array, "t W g"] | None = None,
    ) -> Labels:
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
            recalled=self.recalled if recalled is None else put(self.recalled, recalled),
            guess=self.guess if guess is None else put(self.guess, guess),
            head=(self.head + count) % capacity,
            size=jnp.minimum(self.size + count, capacity),
        )

    def sample(self, key: Array, count: int) -> tuple[Seen, Float[Array, "B n"], Float[Array, "B m"]]:
        """So many steps, all equally likely: what was seen, the label, and what was remembered."""
        row, world = self._some(key, count)
        seen = Seen(self.vector[row, world], self.picture[row, world])
        return seen, self.label[row, world], self.recalled[row, world]

    def told(self, key: Array, count: int) -> Told:
        """So many steps without their pictures: vector, label, what was remembered, and the guess."""
        row, world = self._some(key, count)
        return self.vector[row, world], self.label[row, world], self.recalled[row, world], self.guess[row, world]

    def _some(self, key: Array, count: int) -> tuple[Int[Array, "B"], Int[Array, "B"]]:
        row_key, world_key = jax.random.split(key)
        row = jax.random.randint(row_key, (count,), 0, jnp.maximum(self.size, 1))
        return row, jax.random.randint(world_key, (count,), 0, self.label.shape[1])


class Imitation:
    """An actor that learns labels. All methods are pure.

    Attributes:
      actor: the network. recall: what it remembers; None: nothing.
    """

    def __init__(self, perception: Perception, action_size: int, config: Any, axis: str | None = None):
        """`config`: of cloning or DAgger. `axis`: the name of an axis of devices over which gradients are averaged."""
        guess = perception.hidden.size if perception.hidden and config.guess else 0
        shape = perception.picture_shape
        self.recall: Recall | None = None
        if getattr(config, "recall", 0):
            assert perception.hidden is not None, "without pictures nothing is hidden"
            parts = perception.hidden.poses.values()
            poses = [k for place, turned in parts for k in (*place, *turned)]
            places = [[int(perception.hidden.plain[k]) for k in place] for place, _ in parts]
            self.recall = Recall(
                perception.actor_size, poses, perception.grips, perception.hands, places, config.recall > 1
            )
        self.actor = Actor(action_size, config.actor, shape, config.net, guess, config.choices, perception.objects)
        self._perception, self._weight, self._shift, self._axis = perception, config.guess, config.shift, axis
        self._adam = averaged_adam(10.0, axis)

    def init(self, key: Array) -> tuple[Any, Any]:
        """Parameters and the optimiser's state, untrained."""
        seen, size = blank(self._perception, 1), self._perception.actor_size
        recalled = None if self.recall is None else jnp.zeros((1, self.recall.shown))
        params = self.actor.init(jnp.asarray(key), seen.vector[:, :size], seen.picture, recalled=recalled)["params"]
        return params, self._adam.init(params)

    def loss(
        self,
        params: Any,
        moments: Moments,
        seen: Seen,
        label: Float[Array, "L n"],
        key: Array,
        told: Told | None = None,
        recalled: Float[Array, "L m"] | None = None,
    ) -> tuple[Array, dict[str, Array]]:
        """How far the actor is from the label ("actor_loss", see `heads.label_loss`; "label_error", the mean absolute
        difference of its action); with pictures, also its guess from the truth of what it cannot see.

        Args:
          seen: L samples that have labels, and any number that do not, of which only the guess is learnt.
          told: more samples without their pictures. There the actor is told what it guessed as it acted, so that its
            layers, which cost little, learn from more samples than its encoder can.
          recalled: what was remembered in the samples that have labels.
        """
        count, normal, found = label.shape[0], moments.normal(seen.vector), dict[str, Array]()
        picture, size = seen.picture, self._perception.actor_size
        if self._perception.picture_shape is not None:
            picture = shifted(picture, self._perception.picture_shape, key, self._shift)
        shake = {SHAKEN: jax.random.fold_in(key, 1)}
        known = None
        if self.recall is not None:
            none = jnp.zeros((len(picture) - count, self.recall.size))
            recalled = none if recalled is None else jnp.concatenate([recalled, none])
            known = self._recalled(moments, recalled, seen.vector)
        looked: Any = self.actor.apply({"params": params}, normal[:, :size], picture, None, known, rngs=shake)
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
                vector, wanted, kept, guessed = told
                none, own = jnp.zeros((len(wanted), 0), jnp.uint8), moments.normal(vector)[:, :size]
                known = self._recalled(moments, kept, vector)
                looked = self.actor.apply({"params": params}, own, none, guessed, known)
                found["told_loss"] = label_loss(looked[0], wanted)
                loss += found["told_loss"]
        return loss, found

    def choose(
        self,
        params: Any,
        moments: Moments,
        seen: Seen,
        kept: Float[Array, "W m"],
        begins: Bool[Array, "W"],
    ) -> tuple[Float[Array, "W n *K"], Float[Array, "W m"], Float[Array, "W g"]]:
        """What the actor's last layer says, what it remembers from now on, and its guess. `kept`: of the last step."""
        vector = seen.vector[:, : self._perception.actor_size]

        def look(*given: Any) -> Any:
            return self.actor.apply({"params": params}, *given)

        scales = moments.scales(seen.vector.shape[-1])
        said, kept = looked(look, self.recall, scales, vector, seen.picture, kept, begins)
        return said[0], kept, said[2]

    def _recalled(
        self, moments: Moments, kept: Float[Array, "B m"] | None, vector: Float[Array, "B v"]
    ) -> Float[Array, "B n"] | None:
        """As the network takes it."""
        if self.recall is None or kept is None:
            return None
        return self.recall.normal(kept, vector, *moments.scales(vector.shape[-1]))

    def update(
        self,
        learner: Any,
        seen: Seen,
        label: Float[Array, "L n"],
        key: Array,
        rate: Array,
        told: Any = None,
        recalled: Float[Array, "L m"] | None = None,
    ) -> tuple[Any, dict[str, Array]]:
        """One update of a learner that has `actor`, `opt`, `moments` and `updates`; the rest as for `loss`."""
        also = seen, label, key, told, recalled
        slope, found = jax.grad(self.loss, has_aux=True)(learner.actor, learner.moments, *also)
        step, opt = self._adam.update(slope, learner.opt)
        actor = jax.tree.map(lambda a, s: a - rate * s, learner.actor, step)
        return dataclasses.replace(learner, actor=actor, opt=opt, updates=learner.updates + 1), found
