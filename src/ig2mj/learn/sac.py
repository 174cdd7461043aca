"""Soft actor-critic for many worlds, from state or from images.

Two critics give distributions of the return over K atoms (C51). They see `privileged_state`; the actor sees what
`perception` shows it, so that images cost gradients only where the actor learns, every fourth update. The recipe is
that of Squint (arXiv 2602.21203) and FlashSAC (arXiv 2604.04539): many updates for each step of the worlds, layer
normalization, returns over three steps, rewards scaled to the atoms' range, a target entropy that belongs to a standard
deviation of 0.15, exploration noise that is repeated for a random number of steps.

With an expert, episodes begin under it, and its labels pull the actor (`bc_coef`), both annealed to zero over the run
(`ig2mj.learn.guidance`). With demonstrations the actor begins as their clone, and up to half of a batch is
demonstrations, a share that is annealed to zero over training. Where the actor begins as a clone or as a policy, the
critics learn alone for a while. An iteration is
`rollout_length` steps of all worlds, then `utd_ratio` updates for each of them. Time limits do not end the value: where
an episode was cut off, the last observation is evaluated; after success nothing comes.

Axes: W worlds, T steps, B samples, K atoms, n numbers of an action, v of a vector.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.learn.action_distributions import sample_with_log_prob
from ig2mj.learn.adam import averaged_adam
from ig2mj.learn.collect import GUIDED, Advice, Transition, if_ready
from ig2mj.learn.demos import Demos
from ig2mj.learn.guidance import guided, remaining, uncounted
from ig2mj.learn.networks import AUGMENTATION, ActorNetwork, conv_encoder, projected, shifted, twins
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.protocols import Adviser, Encoder, Expert, as_adviser
from ig2mj.learn.replay import Replay, Sample
from ig2mj.learn.running_stats import RewardScale, RunningStats, share_of
from ig2mj.learn.settings import old_names_work
from ig2mj.process import entry_point


@old_names_work
@dataclasses.dataclass(frozen=True)
class SACConfig:
    """Settings.

    Attributes:
      rollout_length: steps of the worlds in an iteration. utd_ratio: updates for each of them.
      batch_size: samples of an update, of all devices together.
      buffer_size: steps that are replayed, of all worlds. warm_up_steps: of each world before the first update.
      refill_steps: the same after a resume, where the policy plays the buffer full again.
      n_step: steps of a return before the critics' value. gamma: discount of a step (1/10 s).
      num_atoms, v_max: of the critics' distribution, from -v_max to v_max.
      tau: share of the critics that goes into the targets at an update. policy_delay: updates per update of the actor.
      init_alpha: weight of the entropy at first. target_std: deviation of actions that the target entropy belongs to.
      max_noise_repeat: longest time that exploration noise is repeated, in steps.
      critic_head_start: updates of the critics before the actor learns, where it begins as a clone of demonstrations or
        as a policy.
      expert_decay: share of the run over which an expert helps. expert_steps: of an episode that it acts at most, at
        first. expert_noise: deviation of what is added to its actions.
      bc_coef: weight of its labels in the actor's loss, at first. bc_decay: share of the run until that is 0.
      q_filter: 1: labels count only where critics value them above the actor's action (Nair et al. 2018); 0: always.
      aux_coef: weight of the privileged prediction's loss. image_shift: pixels that images are moved by at most.
      lr: learning rate, falling to `final_lr` along a cosine over the run.
      actor_layers, critic_layers: sizes. encoder: of images (`ig2mj.learn.algorithms.ENCODERS`).
    """

    rollout_length: int = 2
    utd_ratio: int = 32
    batch_size: int = 1024
    buffer_size: int = 1_000_000
    warm_up_steps: int = 10
    refill_steps: int = 100
    n_step: int = 3
    gamma: float = 0.97
    num_atoms: int = 101
    v_max: float = 5.0
    tau: float = 0.01
    policy_delay: int = 4
    init_alpha: float = 0.01
    target_std: float = 0.15
    max_noise_repeat: int = 16
    critic_head_start: int = 2000
    expert_decay: float = 0.7
    expert_steps: int = 120
    expert_noise: float = 0.1
    bc_coef: float = 5.0
    bc_decay: float = 0.7
    q_filter: int = 0
    aux_coef: float = 1.0
    image_shift: int = 2
    lr: float = 3e-4
    final_lr: float = 1e-4
    actor_layers: tuple[int, ...] = (256, 256, 256)
    critic_layers: tuple[int, ...] = (512, 512, 512)
    encoder: str = "small"


@struct.dataclass
class SACLearner:
    """What a run learns: weights, the optimizer's state and running statistics.

    `updates`: of the critics so far. `progress`: share of the run that is over.
    """

    actor: Any
    critic: Any
    target: Any
    log_alpha: Float[Array, ""]
    actor_opt: Any
    critic_opt: Any
    alpha_opt: Any
    moments: RunningStats
    updates: Int[Array, ""]
    progress: Float[Array, ""]


@struct.dataclass
class SACBuffers:
    """What belongs to the worlds of a device, and is in checkpoints only with `save_buffer`.

    `demos`: the steps of demonstrations, as of one world; None without any.
    """

    replay: Replay
    scale: RewardScale
    demos: Replay | None


@struct.dataclass
class Noise:
    """Exploration noise of every world, and for how many more steps it is repeated.

    `handover`, `since`: see `ig2mj.learn.guidance`.
    """

    value: Float[Array, "W n"]
    left: Int[Array, "W"]
    handover: Int[Array, "W"]
    since: Int[Array, "W"]


@entry_point
class SAC:
    """See the module's text. All methods are pure."""

    name, replays = "sac", True

    def __init__(
        self,
        perception: Perception,
        action_size: int,
        config: SACConfig | None = None,
        axis: str | None = None,
        demos: Demos | None = None,
        adviser: Adviser | Expert | None = None,
        *,
        horizon: int = 0,
        encoder: Encoder | None = None,
        begun: bool = False,
    ):
        """
        Args:
          axis: the name of an axis of devices over which gradients are averaged.
          demos, adviser: demonstrations and an expert, see the module's text.
          horizon: agent steps of an episode; success counts once so many have passed without the expert.
          encoder: of images; None: as `config` names it. begun: the actor begins as a policy, as with demonstrations.
        """
        self.perception, self.action_size, self.axis = perception, action_size, axis
        self._demos, self.adviser, self._horizon = demos, as_adviser(adviser), horizon
        self._begun = begun or demos is not None
        self.config = c = config or SACConfig()
        predictions = perception.targets.size if perception.targets and c.aux_coef else 0
        encoder = encoder or conv_encoder(perception.image_shape, c.encoder, predictions)
        self.actor = ActorNetwork(action_size, c.actor_layers, encoder)
        self.critic = twins(c.num_atoms, c.critic_layers)
        self._support = jnp.linspace(-c.v_max, c.v_max, c.num_atoms)
        self._entropy = 0.5 * action_size * math.log(2 * math.pi * math.e * c.target_std**2)
        self._adam = averaged_adam(10.0, axis)

    @property
    def length(self) -> int:
        """Steps of an iteration."""
        return self.config.rollout_length

    def warm_up(self, resumed: bool) -> int:
        """Iterations without updates: the buffer fills. After a resume without the buffer, a good part of it."""
        c = self.config
        steps = max(c.refill_steps if resumed else c.warm_up_steps, c.n_step + 1, 3 * c.rollout_length)
        return -(-steps // c.rollout_length)

    @property
    def updates(self) -> int:
        """Updates of an iteration."""
        groups = max(1, self.config.rollout_length * self.config.utd_ratio // self.config.policy_delay)
        return groups * self.config.policy_delay

    def init(self, key: Array) -> SACLearner:
        """Untrained."""
        seen, p = blank(self.perception, 1), self.perception
        actor_key, critic_key = jax.random.split(key)
        actor = self.actor.init(actor_key, seen.vector[:, : p.actor_size], seen.image)["params"]
        critic = self.critic.init(critic_key, seen.vector, jnp.zeros((1, self.action_size)))["params"]
        log_alpha = jnp.log(jnp.float32(self.config.init_alpha))
        return SACLearner(
            actor=actor,
            critic=critic,
            target=jax.tree.map(jnp.copy, critic),
            log_alpha=log_alpha,
            actor_opt=self._adam.init(actor),
            critic_opt=self._adam.init(critic),
            alpha_opt=self._adam.init(log_alpha),
            moments=RunningStats.initial(p.vector_size),
            updates=jnp.int32(0),
            progress=jnp.float32(0),
        )

    def buffer(self, num_worlds: int, groups: int = 1) -> SACBuffers:
        """An empty replay buffer. `groups`: of worlds that are stepped in turn."""
        c = self.config
        rows = max(c.buffer_size // (num_worlds * c.rollout_length), 1) * c.rollout_length
        rows = max(rows, -(-(c.n_step + 1) // c.rollout_length) * c.rollout_length)
        labels = self.action_size if self.adviser is not None else 0
        replay = Replay.empty(rows, num_worlds, self.perception, self.action_size, labels, groups)
        demos = Replay.of_demos(self._demos, labelled=labels > 0) if self._demos is not None else None
        return SACBuffers(replay, RewardScale.initial(num_worlds), demos)

    def cloned(self, learner: SACLearner, actor: Any, moments: RunningStats) -> SACLearner:
        """With the actor of a clone or of a policy, and the means that it was made with."""
        return dataclasses.replace(learner, actor=actor, moments=moments)

    def acting_state(self, num_worlds: int) -> Noise:
        """Before the first step."""
        left, handover, since = jnp.zeros((3, num_worlds), jnp.int32)
        return Noise(jnp.zeros((num_worlds, self.action_size)), left, handover, since)

    # How it acts.

    def act(
        self, learner: SACLearner, noise: Noise, seen: Seen, key: Array, advice: Advice | None = None
    ) -> tuple[Float[Array, "W n"], dict[str, Array], Noise]:
        """Actions with noise that is repeated for a zeta(2)-distributed time; the expert's where it has the episode."""
        noise_key, time_key = jax.random.split(key)
        fresh = jax.random.normal(noise_key, noise.value.shape)
        # the largest k with u < 1 / k has about zeta(2)'s tail: P(at least k) = 1 / k
        uniform = jax.random.uniform(time_key, noise.left.shape, minval=1e-6)
        held = jnp.minimum(jnp.floor(1.0 / uniform).astype(jnp.int32), self.config.max_noise_repeat)
        over = noise.left <= 0
        value, left = jnp.where(over[:, None], fresh, noise.value), jnp.where(over, held, noise.left) - 1
        mean, log_std, _ = self._look(learner.actor, learner.moments, seen)
        action = jnp.tanh(mean + jnp.exp(log_std) * value)
        if advice is None or advice.label is None:
            return action, {}, Noise(value, left, noise.handover, noise.since)
        limit = self.config.expert_steps * remaining(learner.progress, self.config.expert_decay)
        noise_key = jax.random.fold_in(key, 1)
        action, label, handover = guided(noise_key, action, advice, noise.handover, limit, self.config.expert_noise)
        left_out, since = uncounted(handover >= 0, noise.since, jnp.round(limit) > 0, self._horizon)
        return action, {"label": label, GUIDED: left_out}, Noise(value, left, handover, since)

    def _look(
        self, actor: Any, moments: RunningStats, seen: Seen, augment: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """`augment`: a key, while it learns (`networks.AUGMENTATION`)."""
        own = moments.normal(seen.vector[:, : self.perception.actor_size])
        rngs: Any = {} if augment is None else {AUGMENTATION: augment}
        return self.actor.apply({"params": actor}, own, seen.image, rngs=rngs)  # pyright: ignore[reportReturnType]

    def _draw(
        self, actor: Any, moments: RunningStats, seen: Seen, key: Array, augment: Array | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Actions, the logarithm of their density, the prediction, and the mode of the actions' distribution."""
        mean, log_std, prediction = self._look(actor, moments, seen, augment)
        action, density = sample_with_log_prob(mean, log_std, key)
        return action, density, prediction, jnp.tanh(mean)

    # How it learns.

    def learn(
        self,
        learner: SACLearner,
        buffers: SACBuffers,
        rollout: Transition,
        key: Array,
        progress: Float[Array, ""],
        ready: Bool[Array, ""],
        group: Int[Array, ""] | int = 0,
    ) -> tuple[SACLearner, SACBuffers, dict[str, Array]]:
        """Stores a rollout, and makes an iteration's updates.

        Args:
          progress: share of the run that is over. ready: without it nothing is updated: the buffer fills.
          group: number of the worlds that the rollout is of.
        """
        c = self.config
        scale = buffers.scale.update(rollout.reward, rollout.done, c.gamma, self.axis, group)
        buffers = SACBuffers(buffers.replay.insert(rollout, group), scale, buffers.demos)
        moments = learner.moments.update(rollout.seen.vector, self.axis)
        learner = dataclasses.replace(learner, moments=moments, progress=progress)
        rate = jnp.asarray(optax.cosine_decay_schedule(c.lr, 1, c.final_lr / c.lr)(progress))

        def many(learner: SACLearner) -> tuple[SACLearner, dict[str, Array]]:
            def group(learner: SACLearner, key: Array) -> tuple[SACLearner, dict[str, Array]]:
                return self._group(learner, buffers, key, rate, progress)

            keys = jax.random.split(key, self.updates // c.policy_delay)
            learner, losses = jax.lax.scan(group, learner, keys)
            return learner, jax.tree.map(jnp.mean, losses)

        learner, losses = if_ready(ready, many, learner)
        extra = {"alpha": jnp.exp(learner.log_alpha), "reward_scale": scale.factor(c.v_max)}
        return learner, buffers, {**losses, **extra, "updates": ready * jnp.float32(self.updates)}

    def _group(
        self, learner: SACLearner, buffers: SACBuffers, key: Array, rate: Array, progress: Array
    ) -> tuple[SACLearner, dict[str, Array]]:
        """Updates of the critics, and one of the actor."""
        c = self.config
        sample_key, target_key, actor_key = jax.random.split(key, 3)
        size = share_of(c.batch_size, self.axis)
        batch = buffers.replay.sample(sample_key, c.policy_delay * size, c.n_step, c.gamma)
        if buffers.demos is not None:
            batch = self._with_demos(batch, buffers.demos, sample_key, progress)
        late = learner.updates >= c.critic_head_start if self._begun else True
        batch = dataclasses.replace(batch, reward=batch.reward * buffers.scale.factor(c.v_max))
        action, density, _, _ = self._draw(learner.actor, learner.moments, batch.after, target_key)  # of all at once
        alpha = jnp.exp(learner.log_alpha)
        parts = jax.tree.map(lambda a: a.reshape(c.policy_delay, size, *a.shape[1:]), (batch, action, density))

        def critic(carry: tuple, part: tuple[Sample, Array, Array]) -> tuple[tuple, dict[str, Array]]:
            params, target, opt = carry
            (loss, q), slope = jax.value_and_grad(self._critic_loss, has_aux=True)(
                params, target, learner.moments, alpha, *part
            )
            step, opt = self._adam.update(slope, opt)
            params = jax.tree.map(lambda p, s: p - rate * s, params, step)
            target = jax.tree.map(lambda t, p: t + c.tau * (p - t), target, params)
            return (params, target, opt), {"critic_loss": loss, "q": q}

        start = (learner.critic, learner.target, learner.critic_opt)
        (params, target, opt), losses = jax.lax.scan(critic, start, parts)
        last = jax.tree.map(lambda a: a[-1], parts[0])
        learner = dataclasses.replace(
            learner, critic=params, target=target, critic_opt=opt, updates=learner.updates + c.policy_delay
        )
        learner, of_actor = self._update_actor(learner, last, actor_key, rate * late)
        return learner, {**jax.tree.map(jnp.mean, losses), **of_actor}

    def _with_demos(self, batch: Sample, demos: Replay, key: Array, progress: Array) -> Sample:
        """Every second sample is of a demonstration at first, none at the end of the run."""
        c = self.config
        count = batch.reward.shape[0]
        demo_key, which_key = jax.random.split(jax.random.fold_in(key, 1))
        shown = demos.sample(demo_key, count, c.n_step, c.gamma)
        use = jax.random.uniform(which_key, (count,)) < 0.5 * (1.0 - jnp.clip(progress, 0, 1))
        return jax.tree.map(lambda a, b: jnp.where(use.reshape(-1, *[1] * (a.ndim - 1)), a, b), shown, batch)

    def _critic_loss(
        self,
        params: Any,
        target: Any,
        moments: RunningStats,
        alpha: Array,
        batch: Sample,
        action: Float[Array, "B n"],
        density: Float[Array, "B"],
    ) -> tuple[Array, Array]:
        """Cross entropy between the critics' distributions and that of the reward and the more careful target."""
        after: Any = self.critic.apply({"params": target}, moments.normal(batch.after.vector), action)
        chances = jax.nn.softmax(after)
        careful = jnp.argmin(chances @ self._support, axis=0)
        chance = jnp.where(careful[:, None] == 0, chances[0], chances[1])
        soft = self._support - alpha * density[:, None]
        expected = projected(chance, batch.reward[:, None] + batch.discount[:, None] * soft, self._support)
        logits: Any = self.critic.apply({"params": params}, moments.normal(batch.seen.vector), batch.action)
        logs = jax.nn.log_softmax(logits)
        loss = -(jax.lax.stop_gradient(expected) * logs).sum(-1).mean(-1).sum()
        return loss, (jnp.exp(logs) @ self._support).mean()

    def _update_actor(
        self, learner: SACLearner, batch: Sample, key: Array, rate: Array
    ) -> tuple[SACLearner, dict[str, Array]]:
        c, p = self.config, self.perception
        shift_key, draw_key, augment_key = jax.random.split(key, 3)
        seen, normal = batch.seen, learner.moments.normal(batch.seen.vector)
        if p.image_shape is not None:
            seen = Seen(seen.vector, shifted(seen.image, p.image_shape, shift_key, c.image_shift))
        alpha = jnp.exp(learner.log_alpha)

        def value(action: Array) -> Float[Array, "B"]:
            logits: Any = self.critic.apply({"params": learner.critic}, normal, action)
            return (jax.nn.softmax(logits) @ self._support).mean(0)

        def loss(actor: Any) -> tuple[Array, dict[str, Array]]:
            action, density, prediction, mode = self._draw(actor, learner.moments, seen, draw_key, augment_key)
            total, found = (alpha * density - value(action)).mean(), {"entropy": -density.mean()}
            if p.targets is not None and prediction.shape[-1]:
                found["prediction_loss"] = p.targets.loss(prediction, batch.seen.vector, normal)
                total += c.aux_coef * found["prediction_loss"]
            if batch.label.shape[-1]:
                apart = jnp.square(mode - batch.label).mean(-1)
                counts = 1.0 * (value(batch.label) > value(mode)) if c.q_filter else jnp.ones_like(apart)
                found |= {"bc_loss": apart.mean(), "bc_share": counts.mean()}
                total += c.bc_coef * remaining(learner.progress, c.bc_decay) * (counts * apart).mean()
            return total, found

        (total, found), slope = jax.value_and_grad(loss, has_aux=True)(learner.actor)
        step, actor_opt = self._adam.update(slope, learner.actor_opt)
        actor = jax.tree.map(lambda a, s: a - rate * s, learner.actor, step)
        lack = found["entropy"] - self._entropy  # more entropy than the target lowers its weight
        step, alpha_opt = self._adam.update(lack, learner.alpha_opt)
        learner = dataclasses.replace(
            learner,
            actor=actor,
            actor_opt=actor_opt,
            log_alpha=learner.log_alpha - rate * step,  # pyright: ignore[reportOperatorIssue]
            alpha_opt=alpha_opt,
        )
        return learner, {"actor_loss": total, **found}
