"""Proximal policy optimization for many worlds, from state or from images.

The value sees the whole vector, `privileged_state` included; the actor sees what `perception` shows it. An action is
tanh of a Gaussian's sample. Time limits do not end the value: where an episode was cut off, the value of the last
observation counts; after success nothing comes.

An iteration is `rollout_length` steps of all worlds, then `epochs` passes over them in `minibatches` parts.

Axes: W worlds, T steps, B samples, n numbers of an action, v of a vector.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.learn.adam import averaged_adam
from ig2mj.learn.collect import Advice, Transition, if_ready
from ig2mj.learn.networks import ActorNetwork, Value, conv_encoder, shifted
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.running_stats import RewardScale, RunningStats, average
from ig2mj.learn.settings import old_names_work
from ig2mj.process import entry_point


@old_names_work
@dataclasses.dataclass(frozen=True)
class PPOConfig:
    """Settings.

    Attributes:
      rollout_length: steps of the worlds in an iteration. epochs: passes over them. minibatches: of a pass.
      gamma: discount of a step (1/10 s). gae_lambda: of the advantages (GAE).
      clip_ratio: how far the ratio of new and old probabilities counts. value_coef: weight of the value's loss.
      entropy_coef: of the entropy. aux_coef: of the privileged prediction's loss.
      lr: learning rate, falling to `final_lr` linearly over the run.
      actor_layers, critic_layers: sizes. encoder: of images (`ig2mj.learn.networks.ENCODERS`).
    """

    rollout_length: int = 32
    epochs: int = 4
    minibatches: int = 16
    gamma: float = 0.97
    gae_lambda: float = 0.95
    clip_ratio: float = 0.2
    value_coef: float = 0.5
    entropy_coef: float = 1e-3
    aux_coef: float = 0.5
    lr: float = 5e-4
    final_lr: float = 1e-4
    actor_layers: tuple[int, ...] = (256, 256, 256)
    critic_layers: tuple[int, ...] = (256, 256, 256)
    encoder: str = "small"


@struct.dataclass
class PPOLearner:
    """What a run learns: weights, the optimizer's state and running statistics. `updates`: gradient steps so far."""

    actor: Any
    value: Any
    opt: Any
    moments: RunningStats
    updates: Int[Array, ""]


@struct.dataclass
class PPOBuffers:
    """What belongs to the worlds of a device."""

    scale: RewardScale


@struct.dataclass
class Minibatch:
    """Samples of a rollout. `raw`: actions before tanh. `chance`: logarithm of their density when they were chosen."""

    seen: Seen
    raw: Float[Array, "*b n"]
    chance: Float[Array, "*b"]
    advantage: Float[Array, "*b"]
    value_target: Float[Array, "*b"]


@entry_point
class PPO:
    """See the module's text. All methods are pure."""

    name, adviser, replays = "ppo", None, False

    def __init__(
        self, perception: Perception, action_size: int, config: PPOConfig | None = None, axis: str | None = None
    ):
        """`axis`: the name of an axis of devices over which gradients are averaged."""
        self.perception, self.action_size, self.axis = perception, action_size, axis
        self.config = c = config or PPOConfig()
        predictions = perception.targets.size if perception.targets and c.aux_coef else 0
        self.actor = ActorNetwork(
            action_size, c.actor_layers, conv_encoder(perception.image_shape, c.encoder, predictions)
        )
        self.value = Value(c.critic_layers)
        self._adam = averaged_adam(1.0, axis, eps=1e-5)

    @property
    def length(self) -> int:
        """Steps of an iteration."""
        return self.config.rollout_length

    def warm_up(self, resumed: bool) -> int:
        """Iterations without updates: the means of observations are those of a policy that does not change."""
        return 2 if resumed else 3

    @property
    def updates(self) -> int:
        """Updates of an iteration."""
        return self.config.epochs * self.config.minibatches

    # What there is at first.

    def init(self, key: Array) -> PPOLearner:
        """Untrained."""
        seen, p = blank(self.perception, 1), self.perception
        actor_key, value_key = jax.random.split(key)
        actor = self.actor.init(actor_key, seen.vector[:, : p.actor_size], seen.image)["params"]
        value = self.value.init(value_key, seen.vector)["params"]
        return PPOLearner(
            actor, value, self._adam.init((actor, value)), RunningStats.initial(p.vector_size), jnp.int32(0)
        )

    def buffer(self, num_worlds: int) -> PPOBuffers:
        """Nothing is replayed."""
        return PPOBuffers(RewardScale.initial(num_worlds))

    def acting_state(self, num_worlds: int) -> None:
        """The noise of a step does not depend on the one before."""

    # How it acts.

    def act(
        self, learner: PPOLearner, acting: None, seen: Seen, key: Array, advice: Advice | None = None
    ) -> tuple[Float[Array, "W n"], dict[str, Array], None]:
        """Actions, with what is needed to learn from them."""
        mean, log_std, _ = self._look(learner.actor, learner.moments, seen)
        raw = mean + jnp.exp(log_std) * jax.random.normal(key, mean.shape)
        return jnp.tanh(raw), {"raw": raw, "chance": chance(raw, mean, log_std)}, None

    def _look(self, actor: Any, moments: RunningStats, seen: Seen) -> tuple[Array, Array, Array]:
        own = moments.normal(seen.vector[..., : self.perception.actor_size])
        output: Any = self.actor.apply({"params": actor}, own, seen.image)
        return output

    def _worth(self, value: Any, moments: RunningStats, vector: Float[Array, "T W v"]) -> Float[Array, "T W"]:
        flat = moments.normal(vector).reshape(math.prod(vector.shape[:-1]), vector.shape[-1])
        found: Any = self.value.apply({"params": value}, flat)
        return found.reshape(vector.shape[:-1])

    # How it learns.

    def learn(
        self,
        learner: PPOLearner,
        buffers: PPOBuffers,
        rollout: Transition,
        key: Array,
        progress: Float[Array, ""],
        ready: Bool[Array, ""],
    ) -> tuple[PPOLearner, PPOBuffers, dict[str, Array]]:
        """All epochs over a rollout.

        Args:
          progress: share of the run that is over. ready: without it only the observations' means are updated.
        """
        c = self.config
        buffers = PPOBuffers(buffers.scale.update(rollout.reward, rollout.done, c.gamma, self.axis))
        factor = buffers.scale.factor(jnp.inf)
        worth = self._worth(learner.value, learner.moments, rollout.seen.vector)
        after = self._worth(learner.value, learner.moments, rollout.after.vector)
        advantage = advantages(
            rollout.reward * factor, worth, after, rollout.terminated, rollout.done, c.gamma, c.gae_lambda
        )
        mean, square = average((advantage.mean(), jnp.square(advantage).mean()), self.axis)
        even = (advantage - mean) / jnp.sqrt(jnp.maximum(square - mean**2, 0.0) + 1e-8)
        rows = Minibatch(rollout.seen, rollout.extra["raw"], rollout.extra["chance"], even, advantage + worth)
        count = rollout.reward.size
        rows = jax.tree.map(lambda a: a.reshape(count, *a.shape[2:]), rows)
        rate = c.lr + (c.final_lr - c.lr) * jnp.clip(progress, 0, 1)
        size = max(count // c.minibatches, 1)

        def epoch(learner: PPOLearner, key: Array) -> tuple[PPOLearner, dict[str, Array]]:
            order_key, part_key = jax.random.split(key)
            order = jax.random.permutation(order_key, count)[: c.minibatches * size].reshape(-1, size)

            def part(learner: PPOLearner, drawn: tuple[Array, Array]) -> tuple[PPOLearner, dict[str, Array]]:
                return self._update(learner, jax.tree.map(lambda a: a[drawn[0]], rows), drawn[1], rate)

            return jax.lax.scan(part, learner, (order, jax.random.split(part_key, order.shape[0])))

        def epochs(learner: PPOLearner) -> tuple[PPOLearner, dict[str, Array]]:
            learner, losses = jax.lax.scan(epoch, learner, jax.random.split(key, c.epochs))
            return learner, jax.tree.map(jnp.mean, losses)

        learner, losses = if_ready(ready, epochs, learner)
        learner = dataclasses.replace(learner, moments=learner.moments.update(rollout.seen.vector, self.axis))
        extra = {"reward_scale": factor, "updates": ready * jnp.float32(self.updates)}
        return learner, buffers, {**losses, **extra}

    def _update(
        self, learner: PPOLearner, batch: Minibatch, key: Array, rate: Array
    ) -> tuple[PPOLearner, dict[str, Array]]:
        c, p = self.config, self.perception
        seen, normal = batch.seen, learner.moments.normal(batch.seen.vector)
        if p.image_shape is not None:
            seen = Seen(seen.vector, shifted(seen.image, p.image_shape, key))

        def loss(params: tuple[Any, Any]) -> tuple[Array, dict[str, Array]]:
            mean, log_std, prediction = self._look(params[0], learner.moments, seen)
            change = chance(batch.raw, mean, log_std) - batch.chance
            ratio = jnp.exp(change)
            kept = jnp.clip(ratio, 1 - c.clip_ratio, 1 + c.clip_ratio)
            actor = -jnp.minimum(ratio * batch.advantage, kept * batch.advantage).mean()
            worth: Any = self.value.apply({"params": params[1]}, normal)
            value = jnp.square(worth - batch.value_target).mean()
            entropy = (log_std + 0.5 * math.log(2 * math.pi * math.e)).sum(-1).mean()
            total = actor + c.value_coef * value - c.entropy_coef * entropy
            found = {"actor_loss": actor, "critic_loss": value, "entropy": entropy}
            found["divergence"] = (ratio - 1 - change).mean()
            if p.targets is not None and prediction.shape[-1]:
                found["prediction_loss"] = p.targets.loss(prediction, batch.seen.vector, normal)
                total += c.aux_coef * found["prediction_loss"]
            return total, found

        params = learner.actor, learner.value
        slope, found = jax.grad(loss, has_aux=True)(params)
        step, opt = self._adam.update(slope, learner.opt)
        actor, value = jax.tree.map(lambda a, s: a - rate * s, params, step)
        return dataclasses.replace(learner, actor=actor, value=value, opt=opt, updates=learner.updates + 1), found


def chance(raw: Float[Array, "*b n"], mean: Float[Array, "*b n"], log_std: Float[Array, "*b n"]) -> Float[Array, "*b"]:
    """Logarithm of the density before tanh: in a ratio of two chances of one action, tanh has no part."""
    return (-0.5 * jnp.square((raw - mean) / jnp.exp(log_std)) - log_std - 0.5 * math.log(2 * math.pi)).sum(-1)


def advantages(
    reward: Float[Array, "T W"],
    worth: Float[Array, "T W"],
    after: Float[Array, "T W"],
    terminated: Bool[Array, "T W"],
    done: Bool[Array, "T W"],
    gamma: float,
    smooth: float,
) -> Float[Array, "T W"]:
    """Generalized advantage estimates. Of an episode that was cut off, what was seen last counts (`after`)."""
    error = reward + gamma * jnp.where(terminated, 0.0, after) - worth

    def back(later: Array, now: tuple[Array, Array]) -> tuple[Array, Array]:
        found = now[0] + gamma * smooth * jnp.where(now[1], 0.0, later)
        return found, found

    return jax.lax.scan(back, jnp.zeros_like(reward[0]), (error, done), reverse=True)[1]
