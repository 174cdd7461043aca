"""Soft actor-critic for many worlds, from state or from pixels.

Two critics give distributions of the return over K atoms (C51). They see `privileged_state`; the actor sees what
`perception` shows it, so that pictures cost gradients only where the actor learns, every fourth update. The recipe is
that of Squint (arXiv 2602.21203) and FlashSAC (arXiv 2604.04539): many updates for each step of the worlds, layer
normalization, returns over three steps, rewards scaled to the atoms' range, a target entropy that belongs to a standard
deviation of 0.15, exploration noise that is held for a random number of steps.

With an expert episodes begin under it, and its labels draw the actor, ever less, until the policy is left alone
(`ig2mj.learn.guidance`).
With demonstrations the actor begins as their clone, the critics learn alone for a while, and up to half of a batch is
of demonstrations: a share that falls to nothing along the run.
An iteration is `length` steps of all worlds, then `updates` updates for each of them. Time limits do not end the value:
where an episode was cut off, what was seen last is evaluated; where it succeeded, nothing comes after.

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
from ig2mj.learn.adam import averaged_adam
from ig2mj.learn.collect import GUIDED, Advice, Hint, Transition, if_ready
from ig2mj.learn.demos import Demos
from ig2mj.learn.guidance import guided, share, uncounted
from ig2mj.learn.heads import drawn_with_density
from ig2mj.learn.moments import Moments, RewardScale, share_of
from ig2mj.learn.networks import SHAKEN, Actor, projected, shifted, twins
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.replay import Replay, Sample
from ig2mj.process import entry_point


@dataclasses.dataclass(frozen=True)
class SACConfig:
    """Settings; `ig2mj train --set name=value` changes them.

    Attributes:
      length: steps of the worlds in an iteration. updates: for each of them.
      batch: samples of an update, of all devices together.
      capacity: steps that are replayed, of all worlds together. warm_up: steps of each world before the first update.
      refill: the same after a resume, where the policy plays the buffer full again.
      horizon: steps of a return before the critics' value. gamma: discount of a step (1/10 s).
      atoms, largest: of the critics' distribution, from -largest to largest.
      tau: share of the critics that goes into the targets at an update. every: updates per update of the actor.
      alpha: weight of the entropy at first. std: standard deviation of actions that the target entropy belongs to.
      held: longest time that exploration noise is held, in steps.
      head_start: updates of the critics before the actor learns, where it begins as a clone of demonstrations.
      guided: share of the run over which an expert helps. reach: steps of an episode that it acts at most, at first.
      disturbance: deviation of what is added to its actions.
      copy: weight of its labels in the actor's loss, at first. copied: share of the run over which that falls to 0.
      trust: 1: labels count only where critics value them more than the actor's action (Nair et al. 2018); 0: always.
      guess: weight of the actor's guess of the privileged state, from pixels. shift: pixels they are moved by at most.
      lr: learning rate, falling to `last_lr` along a cosine over the run.
      actor, critic: sizes of the layers. net: encoder (`networks.NETS`).
    """

    length: int = 2
    updates: int = 32
    batch: int = 1024
    capacity: int = 1_000_000
    warm_up: int = 10
    refill: int = 100
    horizon: int = 3
    gamma: float = 0.97
    atoms: int = 101
    largest: float = 5.0
    tau: float = 0.01
    every: int = 4
    alpha: float = 0.01
    std: float = 0.15
    held: int = 16
    head_start: int = 2000
    guided: float = 0.7
    reach: int = 120
    disturbance: float = 0.1
    copy: float = 5.0
    copied: float = 0.7
    trust: int = 0
    guess: float = 1.0
    shift: int = 2
    lr: float = 3e-4
    last_lr: float = 1e-4
    actor: tuple[int, ...] = (256, 256, 256)
    critic: tuple[int, ...] = (512, 512, 512)
    net: str = "small"


@struct.dataclass
class SACLearner:
    """All that is learned. `updates`: of the critics so far. `progress`: share of the run that is over."""

    actor: Any
    critic: Any
    target: Any
    log_alpha: Float[Array, ""]
    actor_opt: Any
    critic_opt: Any
    alpha_opt: Any
    moments: Moments
    updates: Int[Array, ""]
    progress: Float[Array, ""]


@struct.dataclass
class SACMemory:
    """What belongs to the worlds of a device, and is not kept by checkpoints unless asked for.

    `demos`: the steps of demonstrations, as of one world; None without any.
    """

    replay: Replay
    scale: RewardScale
    demos: Replay | None


@struct.dataclass
class Noise:
    """Exploration noise of every world, and for how many more steps it is held.

    `handover`, `helpless`: see `ig2mj.learn.guidance`.
    """

    value: Float[Array, "W n"]
    left: Int[Array, "W"]
    handover: Int[Array, "W"]
    helpless: Int[Array, "W"]


@entry_point
class SAC:
    """See the module's text. All methods are pure."""

    name = "sac"

    def __init__(
        self,
        perception: Perception,
        action_size: int,
        config: SACConfig | None = None,
        axis: str | None = None,
        demos: Demos | None = None,
        expert: Hint = None,
    ):
        """`axis`: the name of an axis of devices over which gradients are averaged. `demos`, `expert`: see above."""
        self.perception, self.action_size, self.axis = perception, action_size, axis
        self._demos, self.hint = demos, expert
        self.config = c = config or SACConfig()
        guess = perception.hidden.size if perception.hidden and c.guess else 0
        self.actor = Actor(action_size, c.actor, perception.picture_shape, c.net, guess, objects=perception.objects)
        self.critic = twins(c.atoms, c.critic)
        self._support = jnp.linspace(-c.largest, c.largest, c.atoms)
        self._entropy = 0.5 * action_size * math.log(2 * math.pi * math.e * c.std**2)
        self._adam = averaged_adam(10.0, axis)

    @property
    def length(self) -> int:
        """Steps of an iteration."""
        return self.config.length

    def warm_up(self, resumed: bool) -> int:
        """Iterations without updates: the buffer fills. After a resume without the buffer, a good part of it."""
        c = self.config
        steps = max(c.refill if resumed else c.warm_up, c.horizon + 1, 3 * c.length)
        return -(-steps // c.length)

    @property
    def samples(self) -> int:
        """Updates of an iteration."""
        groups = max(1, self.config.length * self.config.updates // self.config.every)
        return groups * self.config.every

    def init(self, key: Array) -> SACLearner:
        """Untrained."""
        seen, p = blank(self.perception, 1), self.perception
        actor_key, critic_key = jax.random.split(key)
        actor = self.actor.init(actor_key, seen.vector[:, : p.actor_size], seen.picture)["params"]
        critic = self.critic.init(critic_key, seen.vector, jnp.zeros((1, self.action_size)))["params"]
        log_alpha = jnp.log(jnp.float32(self.config.alpha))
        return SACLearner(
            actor=actor,
            critic=critic,
            target=jax.tree.map(jnp.copy, critic),
            log_alpha=log_alpha,
            actor_opt=self._adam.init(actor),
            critic_opt=self._adam.init(critic),
            alpha_opt=self._adam.init(log_alpha),
            moments=Moments.initial(p.vector_size),
            updates=jnp.int32(0),
            progress=jnp.float32(0),
        )

    def memory(self, num_worlds: int) -> SACMemory:
        """An empty replay buffer."""
        c = self.config
        rows = max(c.capacity // (num_worlds * c.length), 1) * c.length
        rows = max(rows, -(-(c.horizon + 1) // c.length) * c.length)
        labels = self.action_size if self.hint is not None else 0
        replay = Replay.empty(rows, num_worlds, self.perception, self.action_size, labels)
        demos = Replay.of_demos(self._demos, labelled=labels > 0) if self._demos is not None else None
        return SACMemory(replay, RewardScale.initial(num_worlds), demos)

    def cloned(self, learner: SACLearner, actor: Any, moments: Moments) -> SACLearner:
        """With an actor that was cloned, and the means that it was cloned with."""
        return dataclasses.replace(learner, actor=actor, moments=moments)

    def noise(self, num_worlds: int) -> Noise:
        """Before the first step."""
        held, handover, helpless = jnp.zeros((3, num_worlds), jnp.int32)
        return Noise(jnp.zeros((num_worlds, self.action_size)), held, handover, helpless)

    # How it acts.

    def act(
        self, learner: SACLearner, noise: Noise, seen: Seen, key: Array, advice: Advice | None = None
    ) -> tuple[Float[Array, "W n"], dict[str, Array], Noise]:
        """Actions with noise, held for a time from a zeta(2) distribution; the expert's where it has the episode."""
        noise_key, time_key = jax.random.split(key)
        fresh = jax.random.normal(noise_key, noise.value.shape)
        # the largest k with u < 1 / k has about zeta(2)'s tail: P(at least k) = 1 / k
        uniform = jax.random.uniform(time_key, noise.left.shape, minval=1e-6)
        held = jnp.minimum(jnp.floor(1.0 / uniform).astype(jnp.int32), self.config.held)
        over = noise.left <= 0
        value, left = jnp.where(over[:, None], fresh, noise.value), jnp.where(over, held, noise.left) - 1
        mean, log_std, _ = self._look(learner.actor, learner.moments, seen)
        action = jnp.tanh(mean + jnp.exp(log_std) * value)
        if advice is None or advice.label is None:
            return action, {}, Noise(value, left, noise.handover, noise.helpless)
        limit = self.config.reach * share(learner.progress, self.config.guided)
        noise_key = jax.random.fold_in(key, 1)
        action, label, handover = guided(noise_key, action, advice, noise.handover, limit, self.config.disturbance)
        apart, helpless = uncounted(handover >= 0, noise.helpless, jnp.round(limit) > 0)
        return action, {"label": label, GUIDED: apart}, Noise(value, left, handover, helpless)

    def _look(self, actor: Any, moments: Moments, seen: Seen, shake: Array | None = None) -> tuple[Array, Array, Array]:
        """`shake`: a key, while it learns (`networks.SHAKEN`)."""
        own = moments.normal(seen.vector[:, : self.perception.actor_size])
        rngs: Any = {} if shake is None else {SHAKEN: shake}
        return self.actor.apply({"params": actor}, own, seen.picture, rngs=rngs)  # pyright: ignore[reportReturnType]

    def _draw(
        self, actor: Any, moments: Moments, seen: Seen, key: Array, shake: Array | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Actions, the logarithm of their density, the guess, and the middle of the actions' distribution."""
        mean, log_std, guess = self._look(actor, moments, seen, shake)
        action, density = drawn_with_density(mean, log_std, key)
        return action, density, guess, jnp.tanh(mean)

    # How it learns.

    def learn(
        self,
        learner: SACLearner,
        memory: SACMemory,
        rollout: Transition,
        key: Array,
        progress: Float[Array, ""],
        ready: Bool[Array, ""],
    ) -> tuple[SACLearner, SACMemory, dict[str, Array]]:
        """Stores a rollout, and makes an iteration's updates.

        Args:
          progress: share of the run that is over. ready: without it nothing is updated: the buffer fills.
        """
        c = self.config
        scale = memory.scale.update(rollout.reward, rollout.done, c.gamma, self.axis)
        memory = SACMemory(memory.replay.insert(rollout), scale, memory.demos)
        moments = learner.moments.update(rollout.seen.vector, self.axis)
        learner = dataclasses.replace(learner, moments=moments, progress=progress)
        rate = jnp.asarray(optax.cosine_decay_schedule(c.lr, 1, c.last_lr / c.lr)(progress))

        def many(learner: SACLearner) -> tuple[SACLearner, dict[str, Array]]:
            def group(learner: SACLearner, key: Array) -> tuple[SACLearner, dict[str, Array]]:
                return self._group(learner, memory, key, rate, progress)

            keys = jax.random.split(key, self.samples // c.every)
            learner, losses = jax.lax.scan(group, learner, keys)
            return learner, jax.tree.map(jnp.mean, losses)

        learner, losses = if_ready(ready, many, learner)
        extra = {"alpha": jnp.exp(learner.log_alpha), "reward_scale": scale.factor(c.largest)}
        return learner, memory, {**losses, **extra, "updates": ready * jnp.float32(self.samples)}

    def _group(
        self, learner: SACLearner, memory: SACMemory, key: Array, rate: Array, progress: Array
    ) -> tuple[SACLearner, dict[str, Array]]:
        """Updates of the critics, and one of the actor."""
        c = self.config
        sample_key, target_key, actor_key = jax.random.split(key, 3)
        size = share_of(c.batch, self.axis)
        batch = memory.replay.sample(sample_key, c.every * size, c.horizon, c.gamma)
        late = True
        if memory.demos is not None:
            batch = self._with_demos(batch, memory.demos, sample_key, progress)
            late = learner.updates >= c.head_start
        batch = dataclasses.replace(batch, reward=batch.reward * memory.scale.factor(c.largest))
        action, density, _, _ = self._draw(learner.actor, learner.moments, batch.after, target_key)  # of all at once
        alpha = jnp.exp(learner.log_alpha)
        parts = jax.tree.map(lambda a: a.reshape(c.every, size, *a.shape[1:]), (batch, action, density))

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
            learner, critic=params, target=target, critic_opt=opt, updates=learner.updates + c.every
        )
        learner, of_actor = self._update_actor(learner, last, actor_key, rate * late)
        return learner, {**jax.tree.map(jnp.mean, losses), **of_actor}

    def _with_demos(self, batch: Sample, demos: Replay, key: Array, progress: Array) -> Sample:
        """Every second sample is of a demonstration at first, none at the end of the run."""
        c = self.config
        count = batch.reward.shape[0]
        demo_key, which_key = jax.random.split(jax.random.fold_in(key, 1))
        shown = demos.sample(demo_key, count, c.horizon, c.gamma)
        use = jax.random.uniform(which_key, (count,)) < 0.5 * (1.0 - jnp.clip(progress, 0, 1))
        return jax.tree.map(lambda a, b: jnp.where(use.reshape(-1, *[1] * (a.ndim - 1)), a, b), shown, batch)

    def _critic_loss(
        self,
        params: Any,
        target: Any,
        moments: Moments,
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
        wanted = projected(chance, batch.reward[:, None] + batch.discount[:, None] * soft, self._support)
        logits: Any = self.critic.apply({"params": params}, moments.normal(batch.seen.vector), batch.action)
        logs = jax.nn.log_softmax(logits)
        loss = -(jax.lax.stop_gradient(wanted) * logs).sum(-1).mean(-1).sum()
        return loss, (jnp.exp(logs) @ self._support).mean()

    def _update_actor(
        self, learner: SACLearner, batch: Sample, key: Array, rate: Array
    ) -> tuple[SACLearner, dict[str, Array]]:
        c, p = self.config, self.perception
        shift_key, draw_key, shake_key = jax.random.split(key, 3)
        seen, normal = batch.seen, learner.moments.normal(batch.seen.vector)
        if p.picture_shape is not None:
            seen = Seen(seen.vector, shifted(seen.picture, p.picture_shape, shift_key, c.shift))
        alpha = jnp.exp(learner.log_alpha)

        def value(action: Array) -> Float[Array, "B"]:
            logits: Any = self.critic.apply({"params": learner.critic}, normal, action)
            return (jax.nn.softmax(logits) @ self._support).mean(0)

        def loss(actor: Any) -> tuple[Array, dict[str, Array]]:
            action, density, guess, middle = self._draw(actor, learner.moments, seen, draw_key, shake_key)
            total, found = (alpha * density - value(action)).mean(), {"entropy": -density.mean()}
            if p.hidden is not None and guess.shape[-1]:
                found["guess_loss"] = p.hidden.loss(guess, batch.seen.vector, normal)
                total += c.guess * found["guess_loss"]
            if batch.label.shape[-1]:
                apart = jnp.square(middle - batch.label).mean(-1)
                counts = 1.0 * (value(batch.label) > value(middle)) if c.trust else jnp.ones_like(apart)
                found |= {"copy_loss": apart.mean(), "copied": counts.mean()}
                total += c.copy * share(learner.progress, c.copied) * (counts * apart).mean()
            return total, found

        (total, found), slope = jax.value_and_grad(loss, has_aux=True)(learner.actor)
        step, actor_opt = self._adam.update(slope, learner.actor_opt)
        actor = jax.tree.map(lambda a, s: a - rate * s, learner.actor, step)
        lack = found["entropy"] - self._entropy  # more entropy than wanted lowers its weight
        step, alpha_opt = self._adam.update(lack, learner.alpha_opt)
        learner = dataclasses.replace(
            learner,
            actor=actor,
            actor_opt=actor_opt,
            log_alpha=learner.log_alpha - rate * step,  # pyright: ignore[reportOperatorIssue]
            alpha_opt=alpha_opt,
        )
        return learner, {"actor_loss": total, **found}
