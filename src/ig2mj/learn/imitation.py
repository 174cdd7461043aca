"""`Imitation`: an actor that learns labels, for cloning and DAgger.

Axes: W worlds, B samples, L of them with labels, n numbers of an action, v of a vector, m numbers that are remembered,
g of a prediction.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.learn.action_distributions import label_loss, mode
from ig2mj.learn.adam import averaged_adam
from ig2mj.learn.imitation_buffer import ImagelessBatch
from ig2mj.learn.networks import AUGMENTATION, ActorNetwork, apply_with_memory, conv_encoder, shifted
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.protocols import Encoder, Memory
from ig2mj.learn.running_stats import RunningStats


class Imitation:
    """An actor that learns labels. All methods are pure.

    Attributes:
      actor: the network. memory: what it remembers; None: nothing.
    """

    def __init__(
        self,
        perception: Perception,
        action_size: int,
        config: Any,
        axis: str | None = None,
        encoder: Encoder | None = None,
        memory: Memory | None = None,
    ):
        """
        Args:
          config: of cloning or DAgger. axis: the name of an axis of devices over which gradients are averaged.
          encoder: None: `conv_encoder` as `config` names it.
        """
        self.memory, targets = memory, perception.targets
        predictions = targets.size if targets and config.aux_coef else 0
        encoder = encoder or conv_encoder(perception.image_shape, config.encoder, predictions)
        self.actor = ActorNetwork(action_size, tuple(config.actor_layers), encoder, config.action_bins)
        self._perception, self._axis = perception, axis
        self._aux_coef, self._shift = config.aux_coef, config.image_shift
        self._adam = averaged_adam(10.0, axis)

    def init(self, key: Array) -> tuple[Any, Any]:
        """Parameters and the optimizer's state, untrained."""
        seen, size = blank(self._perception, 1), self._perception.actor_size
        known = None if self.memory is None else jnp.zeros((1, self.memory.shown))
        params = self.actor.init(jnp.asarray(key), seen.vector[:, :size], seen.image, remembered=known)["params"]
        return params, self._adam.init(params)

    def loss(
        self,
        params: Any,
        moments: RunningStats,
        seen: Seen,
        label: Float[Array, "L n"],
        key: Array,
        imageless: ImagelessBatch | None = None,
        remembered: Float[Array, "L m"] | None = None,
    ) -> tuple[Array, dict[str, Array]]:
        """The loss, and its parts by name.

        "actor_loss": how far the actor is from the label (`action_distributions.label_loss`). "label_error": the mean
        absolute difference of its action. "prediction_loss": of the privileged numbers. "imageless_loss": as
        "actor_loss", of the samples without images.

        Args:
          seen: L samples that have labels first, and any number that do not, of which only the prediction is learned.
          imageless: more samples, without images: the actor gets what it predicted as it acted, so that its layers,
            which are cheap, learn from more samples than its encoder can.
          remembered: what was remembered in the samples that have labels.
        """
        count, normal, found = label.shape[0], moments.normal(seen.vector), dict[str, Array]()
        image, size = seen.image, self._perception.actor_size
        if self._perception.image_shape is not None:
            image = shifted(image, self._perception.image_shape, key, self._shift)
        augment = {AUGMENTATION: jax.random.fold_in(key, 1)}
        known = None
        if self.memory is not None:
            none = jnp.zeros((len(image) - count, self.memory.size))
            remembered = none if remembered is None else jnp.concatenate([remembered, none])
            known = self._known(moments, remembered, seen.vector)
        output: Any = self.actor.apply({"params": params}, normal[:, :size], image, None, known, rngs=augment)
        head, _, prediction = output
        loss = jnp.float32(0)
        if count:
            loss = found["actor_loss"] = label_loss(head[:count], label)
            found["label_error"] = jnp.abs(mode(head[:count]) - label).mean()
        targets = self._perception.targets
        if targets is not None and prediction.shape[-1]:
            found["prediction_loss"] = targets.loss(prediction, seen.vector, normal)
            loss += self._aux_coef * found["prediction_loss"]
            if imageless is not None:
                vector, labels, kept, predicted = imageless
                none, own = jnp.zeros((len(labels), 0), jnp.uint8), moments.normal(vector)[:, :size]
                known = self._known(moments, kept, vector)
                output = self.actor.apply({"params": params}, own, none, predicted, known)
                found["imageless_loss"] = label_loss(output[0], labels)
                loss += found["imageless_loss"]
        return loss, found

    def choose(
        self,
        params: Any,
        moments: RunningStats,
        seen: Seen,
        kept: Float[Array, "W m"],
        begins: Bool[Array, "W"],
    ) -> tuple[Float[Array, "W n *K"], Float[Array, "W m"], Float[Array, "W g"]]:
        """The actor's output, what it remembers from now on, and its prediction.

        Args:
          kept: what it remembered in the step before. begins: the step is the first of an episode.
        """
        vector = seen.vector[:, : self._perception.actor_size]

        def apply(*given: Any) -> Any:
            return self.actor.apply({"params": params}, *given)

        scales = moments.scales(seen.vector.shape[-1])
        output, kept = apply_with_memory(apply, self.memory, scales, vector, seen.image, kept, begins)
        return output[0], kept, output[2]

    def _known(
        self, moments: RunningStats, kept: Float[Array, "B m"] | None, vector: Float[Array, "B v"]
    ) -> Float[Array, "B n"] | None:
        """What is remembered, as the network sees it."""
        if self.memory is None or kept is None:
            return None
        return self.memory.normal(kept, vector, *moments.scales(vector.shape[-1]))

    def update(
        self,
        learner: Any,
        seen: Seen,
        label: Float[Array, "L n"],
        key: Array,
        rate: Array,
        imageless: ImagelessBatch | None = None,
        remembered: Float[Array, "L m"] | None = None,
    ) -> tuple[Any, dict[str, Array]]:
        """One update of a learner that has `actor`, `opt`, `moments` and `updates`; the rest as for `loss`."""
        given = seen, label, key, imageless, remembered
        slope, found = jax.grad(self.loss, has_aux=True)(learner.actor, learner.moments, *given)
        step, opt = self._adam.update(slope, learner.opt)
        actor = jax.tree.map(lambda a, s: a - rate * s, learner.actor, step)
        return dataclasses.replace(learner, actor=actor, opt=opt, updates=learner.updates + 1), found
