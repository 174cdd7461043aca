"""`ImitationBuffer`: what was seen in the last steps of all worlds, and what should have been done there.

Axes: T steps, W worlds, B samples, D steps of demonstrations, n numbers of an action, v of a vector, q bytes of an
image, m numbers that are remembered, g of a prediction.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Float, Int, UInt8

from ig2mj.engine.view import Array
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.replay import RingHeads

ImagelessBatch = tuple[Float[Array, "B v"], Float[Array, "B n"], Float[Array, "B m"], Float[Array, "B g"]]
"""Steps without their images (`ImitationBuffer.sample_imageless`)."""


@struct.dataclass
class ImitationBuffer:
    """The last T steps of W worlds.

    Attributes:
      head, size: `RingHeads`.
      remembered: what the actor remembered (`protocols.Memory`). prediction: what it predicted as it acted.
      unlabelled: samples that have no labels; None: there are none.
      shown: samples of demonstrations and their labels, which stay; None: there are none.
    """

    vector: Float[Array, "T W v"]
    image: UInt8[Array, "T W q"]
    label: Float[Array, "T W n"]
    head: Int[Array, "*G"]
    size: Int[Array, "*G"]
    remembered: Float[Array, "T W m"]
    prediction: Float[Array, "T W g"]
    unlabelled: Seen | None = None
    shown: tuple[Seen, Float[Array, "D n"]] | None = None

    @classmethod
    def empty(
        cls,
        steps: int,
        worlds: int,
        perception: Perception,
        action_size: int,
        unlabelled: Seen | None = None,
        remembered: int = 0,
        predictions: int = 0,
        shown: tuple[Seen, Float[Array, "D n"]] | None = None,
        groups: int = 1,
    ) -> ImitationBuffer:
        """Room for so many steps of so many worlds.

        Args:
          remembered: m. predictions: g; 0 where predictions are not kept. groups: of worlds that are stepped in turn.
        """

        @jax.jit  # one program, not one for each array
        def zeros() -> dict[str, Array]:
            return {
                "vector": jnp.zeros((steps, worlds, perception.vector_size)),
                "image": jnp.zeros((steps, worlds, perception.image_bytes), jnp.uint8),
                "label": jnp.zeros((steps, worlds, action_size)),
                **RingHeads.empty(groups).fields,
                "remembered": jnp.zeros((steps, worlds, remembered)),
                "prediction": jnp.zeros((steps, worlds, predictions)),
            }

        return cls(**zeros(), unlabelled=unlabelled, shown=shown)

    def insert(
        self,
        seen: Seen,
        label: Float[Array, "t w n"],
        remembered: Float[Array, "t w m"] | None = None,
        prediction: Float[Array, "t w g"] | None = None,
        group: Any = 0,
    ) -> ImitationBuffer:
        """With more steps of a group of worlds in place of the oldest; their number must divide T."""
        count, capacity = label.shape[0], self.label.shape[0]
        assert capacity % count == 0, "steps are written without a seam"

        heads = RingHeads(self.head, self.size)
        put = functools.partial(heads.write, group=group)
        return dataclasses.replace(
            self,
            vector=put(self.vector, seen.vector),
            image=put(self.image, seen.image),
            label=put(self.label, label),
            remembered=self.remembered if remembered is None else put(self.remembered, remembered),
            prediction=self.prediction if prediction is None else put(self.prediction, prediction),
            **heads.after(count, capacity, group).fields,
        )

    def sample(self, key: Array, count: int) -> tuple[Seen, Float[Array, "B n"], Float[Array, "B m"]]:
        """So many steps, all equally likely: what was seen, the label, and what was remembered."""
        row, world = self._random(key, count)
        seen = Seen(self.vector[row, world], self.image[row, world])
        return seen, self.label[row, world], self.remembered[row, world]

    def sample_with_shown(self, key: Array, count: int) -> tuple[Seen, Float[Array, "B n"], Float[Array, "B m"]]:
        """As `sample`, half of it from the demonstrations, of which nothing is remembered."""
        assert self.shown is not None
        own_key, shown_key = jax.random.split(key)
        seen, label, remembered = self.sample(own_key, count - count // 2)
        shown, labels = self.shown
        row = jax.random.randint(shown_key, (count // 2,), 0, labels.shape[0])
        more = Seen(shown.vector[row], shown.image[row])
        none = jnp.zeros((count // 2, remembered.shape[1]))
        return jax.tree.map(lambda *a: jnp.concatenate(a), (seen, label, remembered), (more, labels[row], none))

    def sample_imageless(self, key: Array, count: int) -> ImagelessBatch:
        """So many steps without their images: vector, label, what was remembered, and the prediction."""
        row, world = self._random(key, count)
        return tuple(a[row, world] for a in (self.vector, self.label, self.remembered, self.prediction))  # pyright: ignore

    def _random(self, key: Array, count: int) -> tuple[Int[Array, "B"], Int[Array, "B"]]:
        row_key, world_key = jax.random.split(key)
        world = jax.random.randint(world_key, (count,), 0, self.label.shape[1])
        _, size = RingHeads(self.head, self.size).of(world, self.label.shape[1])
        return jax.random.randint(row_key, (count,), 0, jnp.maximum(size, 1)), world
