"""DAgger: the policy acts, an expert labels the states that it reaches, and the policy learns the labels.

The experts of `ig2mj.tasks.experts` answer in any state, so labels are free (Ross, Gordon and Bagnell 2011). At first
the expert acts in a share of the worlds, beta, that falls to 0 over the first part of the run; its own actions are
disturbed, so that recoveries are seen as well.

The policy is a categorical distribution over discretized values for each number of the action, or the Gaussian of SAC
and PPO (`ig2mj.learn.action_distributions`). An iteration is `rollout_length` steps of all worlds, then `utd_ratio`
updates for each of them, on samples of the buffer.

Axes: W worlds, T steps, B samples, m numbers that are remembered, g of a prediction, n of an action.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import optax
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError
from ig2mj.learn.action_distributions import mode
from ig2mj.learn.collect import GUIDED, Advice, Transition, if_ready
from ig2mj.learn.demos import Demos
from ig2mj.learn.guidance import UNAIDED, uncounted
from ig2mj.learn.imitation import Imitation
from ig2mj.learn.imitation_buffer import ImitationBuffer
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.protocols import Adviser, Encoder, Expert, Memory, as_adviser
from ig2mj.learn.running_stats import RunningStats, share_of
from ig2mj.learn.settings import old_names_work
from ig2mj.process import entry_point

REMEMBERED = "remembered"
"""The name among a transition's extras of what was remembered."""

PREDICTION = "prediction"
"""And of what the actor predicted, where it is kept."""

LONGEST_TURN = 50
"""Steps after which it is sampled again who acts in a world, at most."""


@old_names_work
@dataclasses.dataclass(frozen=True)
class DaggerConfig:
    """Settings.

    Attributes:
      rollout_length: steps of the worlds in an iteration. utd_ratio: updates for each of them.
      batch_size: samples of an update, of all devices together.
      buffer_size: steps that are kept, of all worlds together. warm_up_steps: of each world before the first update.
      beta_decay: share of the run after which the expert acts no more. action_noise: deviation of what is added to
        actions. random_actions: share of the expert's steps in which its action is replaced by a random one.
      aux_coef: weight of the privileged prediction's loss. image_shift: pixels that images are moved by at most.
      imageless_batch: samples of an update besides, without images, of which only the actor's layers learn: its
        prediction of each as it acted is kept. For encoders whose prediction the actor acts on.
      average_updates: of which the weights of the actor that acts are a running mean; 0: it acts with the last ones.
      lr: learning rate, falling to `final_lr` along a cosine over the run.
      action_bins: discretized values of each number of the action; 0: the action is the mean of a Gaussian.
      actor_layers: sizes. encoder: of images (`ig2mj.learn.algorithms.ENCODERS`).
    """

    rollout_length: int = 4
    utd_ratio: int = 16
    batch_size: int = 1024
    buffer_size: int = 1_000_000
    warm_up_steps: int = 12
    beta_decay: float = 0.2
    action_noise: float = 0.1
    random_actions: float = 0.1
    aux_coef: float = 1.0
    image_shift: int = 2
    imageless_batch: int = 0
    average_updates: int = 0
    lr: float = 1e-3
    final_lr: float = 1e-4
    action_bins: int = 21
    actor_layers: tuple[int, ...] = (256, 256, 256)
    encoder: str = "small"


@struct.dataclass
class DaggerLearner:
    """What a run learns: weights, the optimizer's state and running statistics.

    Attributes:
      actor: weights of what acts. last: weights of the last update, where those of `actor` are a mean; else None.
      progress: share of the run that was over at the last iteration.
    """

    actor: Any
    opt: Any
    moments: RunningStats
    progress: Float[Array, ""]
    updates: Int[Array, ""]
    last: Any = None


@struct.dataclass
class DaggerState:
    """Who acts in each world, and what is carried from step to step.

    Attributes:
      draw: a number from 0 to 1; the expert acts where beta is larger. left: steps until it is sampled again.
      unaided: the expert has no part in this episode. helped: it had one. since: steps since the expert's part ended.
      remembered: by the actor. notes: of the adviser.
    """

    draw: Float[Array, "W"]
    left: Int[Array, "W"]
    unaided: Bool[Array, "W"]
    helped: Bool[Array, "W"]
    since: Int[Array, "W"]
    remembered: Float[Array, "W m"]
    notes: Any = None


@entry_point
class Dagger:
    """See the module's text. All methods are pure."""

    name, replays = "dagger", True

    def __init__(
        self,
        perception: Perception,
        action_size: int,
        adviser: Adviser | Expert | None,
        config: DaggerConfig | None = None,
        axis: str | None = None,
        unlabelled: Seen | None = None,
        *,
        horizon: int = 0,
        encoder: Encoder | None = None,
        memory: Memory | None = None,
        demos: Demos | None = None,
    ):
        """
        Args:
          adviser: gives the labels. axis: the name of an axis of devices over which gradients are averaged.
          demos: labelled steps, of which half of the samples of an update are taken.
          unlabelled: samples, on the host, from which the prediction learns as well: half as many again in each update.
          horizon: agent steps of an episode; success counts once so many have passed without the expert.
          encoder: of images; None: as `config` names it. memory: what the actor remembers; None: nothing.

        Raises:
          Ig2mjError: samples without images need a prediction that the actor acts on, or samples without labels are to
            be shared by several devices.
        """
        self.perception, self.action_size, self.axis = perception, action_size, axis
        self.adviser, self.unlabelled, self._horizon = as_adviser(adviser), unlabelled, horizon
        self.demos = demos
        self.config = c = config or DaggerConfig()
        if demos is not None and (memory is not None or axis is not None or unlabelled is not None):
            raise Ig2mjError("--demos: for one device, without object_memory and pretrain_images")
        if unlabelled is not None and axis is not None:
            raise Ig2mjError("images of start states are for one device (--devices 1)")
        self.imitation = Imitation(perception, action_size, c, axis, encoder, memory)
        self.actor, self.memory = self.imitation.actor, memory
        acts = self.actor.acts_on_prediction
        for name, value in (("imageless_batch", c.imageless_batch), ("object_memory", memory is not None)):
            if value and not acts:
                raise Ig2mjError(f"{name}: only for actors that act on a prediction (encoder=glimpses)")

    @property
    def length(self) -> int:
        """Steps of an iteration."""
        return self.config.rollout_length

    @property
    def updates(self) -> int:
        """Updates of an iteration."""
        return self.config.rollout_length * self.config.utd_ratio

    def warm_up(self, resumed: bool) -> int:
        """Iterations without updates: labels are gathered."""
        return -(-max(self.config.warm_up_steps, 3 * self.length) // self.length)

    def init(self, key: Array) -> DaggerLearner:
        """Untrained."""
        actor, opt = self.imitation.init(key)
        moments = RunningStats.initial(self.perception.vector_size)
        return self.with_fresh_average(DaggerLearner(actor, opt, moments, jnp.float32(0), jnp.int32(0)))

    def with_fresh_average(self, learner: DaggerLearner) -> DaggerLearner:
        """The same, with the mean of weights started again from those that it acts with."""
        copy = jax.tree.map(jnp.copy, learner.actor) if self.config.average_updates else None
        return dataclasses.replace(learner, last=copy)

    def averaged(self, before: DaggerLearner, after: DaggerLearner) -> DaggerLearner:
        """`after`, whose `actor` has been updated from `before.last`, acting with a mean of weights.

        That is a running mean, by iterations, and the plain mean as long as there are fewer updates.
        """
        done = jnp.float32(before.updates) / self.updates
        part = jnp.maximum(1.0 / (1.0 + done), min(self.updates / self.config.average_updates, 1.0))
        mean = jax.tree.map(lambda old, new: old + part * (new - old), before.actor, after.actor)
        return dataclasses.replace(after, actor=mean, last=after.actor)

    def buffer(self, num_worlds: int, groups: int = 1) -> ImitationBuffer:
        """No labels yet. `groups`: of worlds that are stepped in turn."""
        rows = max(self.config.buffer_size // (num_worlds * self.length), 1) * self.length
        unlabelled, sizes = jax.tree.map(jnp.asarray, self.unlabelled), (self._remembered, self.kept_predictions)
        shown = None if self.demos is None else (self.demos.seen, self.demos.label)
        shape = rows, num_worlds, self.perception, self.action_size
        shown = jax.tree.map(jnp.array, shown)
        return ImitationBuffer.empty(*shape, unlabelled, *sizes, shown=shown, groups=groups)

    def cloned(self, learner: DaggerLearner, actor: Any, moments: RunningStats) -> DaggerLearner:
        """What begins with the actor of a clone or of a policy, and the means that it was made with."""
        return self.with_fresh_average(dataclasses.replace(learner, actor=actor, moments=moments))

    @property
    def kept_predictions(self) -> int:
        """Numbers of a prediction that are kept with each label; 0: none are."""
        return self.actor.predictions if self.config.imageless_batch else 0

    @property
    def _remembered(self) -> int:
        """m."""
        return 0 if self.memory is None else self.memory.size

    def acting_state(self, num_worlds: int) -> DaggerState:
        """Before the first step."""
        # one array for each field, since buffers are donated
        no, none = jnp.zeros(num_worlds, bool), jnp.zeros(num_worlds, bool)
        zero, nought = jnp.zeros(num_worlds, jnp.int32), jnp.zeros(num_worlds, jnp.int32)
        notes = None if self.adviser is None else self.adviser.begin(num_worlds)
        remembered = jnp.zeros((num_worlds, self._remembered))
        return DaggerState(jnp.zeros(num_worlds), zero, no, none, nought, remembered, notes)

    def act(
        self, learner: DaggerLearner, acting: DaggerState, seen: Seen, key: Array, advice: Advice
    ) -> tuple[Float[Array, "W n"], dict[str, Array], DaggerState]:
        """The expert's action in its worlds, the policy's in the others; a turn is up to `LONGEST_TURN` steps long.

        A tenth of the episodes is the policy's alone from the first update on; success is reported of those, and of all
        once a horizon has passed without the expert.
        """
        assert advice.label is not None, "DAgger needs an expert"
        c = self.config
        draw_key, time_key, noise_key, any_key, which_key, unaided_key = jax.random.split(key, 6)
        over = acting.left <= 0
        draw = jnp.where(over, jax.random.uniform(draw_key, over.shape), acting.draw)
        left = jnp.where(over, jax.random.randint(time_key, over.shape, 1, LONGEST_TURN + 1), acting.left) - 1
        begins = advice.steps == 0
        head, remembered, prediction = self.imitation.choose(
            learner.actor, learner.moments, seen, acting.remembered, begins
        )
        beta = jnp.where(learner.updates == 0, 1.0, 1.0 - learner.progress / max(c.beta_decay, 1e-6))
        unaided = jnp.where(begins, jax.random.uniform(unaided_key, begins.shape) < UNAIDED, acting.unaided)
        expert = (draw < beta) & ~(unaided & (learner.updates > 0))
        helped = expert | (acting.helped & ~begins)
        label = jnp.clip(advice.label, -1.0, 1.0)
        random = (jax.random.uniform(which_key, expert.shape) < c.random_actions) & expert
        action = jnp.where(expert[:, None], label, mode(head))
        action = action + c.action_noise * jax.random.normal(noise_key, action.shape)
        action = jnp.where(random[:, None], jax.random.uniform(any_key, action.shape, minval=-1.0), action)
        # When the expert's part ends, all worlds begin unaided episodes at once, and the short ones, which succeed, end
        # first; as do those of the first that the policy has alone.
        left_out, since = uncounted(~unaided, acting.since, beta > 0, self._horizon)
        left_out |= learner.updates < self._horizon * c.utd_ratio
        extra = {"label": label, GUIDED: helped | left_out}
        extra |= {REMEMBERED: remembered} if self._remembered else {}
        extra |= {PREDICTION: prediction} if self.kept_predictions else {}
        notes = acting.notes
        if self.adviser is not None:
            scales = learner.moments.scales(seen.vector.shape[-1])
            notes = self.adviser.observe(notes, begins, scales, seen.vector, remembered, prediction)
        new = DaggerState(draw, left, unaided, helped, since, remembered, notes)
        return jnp.clip(action, -1.0, 1.0), extra, new

    def learn(
        self,
        learner: DaggerLearner,
        buffer: ImitationBuffer,
        rollout: Transition,
        key: Array,
        progress: Float[Array, ""],
        ready: Bool[Array, ""],
        group: Int[Array, ""] | int = 0,
    ) -> tuple[DaggerLearner, ImitationBuffer, dict[str, Array]]:
        """Keeps a rollout's labels, and makes an iteration's updates.

        Args:
          progress: share of the run that is over. ready: without it nothing is updated: labels are gathered.
          group: number of the worlds that the rollout is of.
        """
        c, extra = self.config, rollout.extra
        buffer = buffer.insert(rollout.seen, extra["label"], extra.get(REMEMBERED), extra.get(PREDICTION), group)
        moments = learner.moments.update(rollout.seen.vector, self.axis)
        learner = dataclasses.replace(learner, moments=moments, progress=progress)
        rate = jnp.asarray(optax.cosine_decay_schedule(c.lr, 1, c.final_lr / c.lr)(progress))

        def update(learner: DaggerLearner, key: Array) -> tuple[DaggerLearner, dict[str, Array]]:
            sample_key, augment_key, unlabelled_key, imageless_key = jax.random.split(key, 4)
            count = share_of(c.batch_size, self.axis)
            if buffer.shown is None:
                seen, label, remembered = buffer.sample(sample_key, count)
            else:
                seen, label, remembered = buffer.sample_with_shown(sample_key, count)
            if buffer.unlabelled is not None:
                more = random_rows(buffer.unlabelled, unlabelled_key, count // 2)
                seen = jax.tree.map(lambda *a: jnp.concatenate(a), seen, more)
            imageless = None
            if c.imageless_batch:
                imageless = buffer.sample_imageless(imageless_key, share_of(c.imageless_batch, self.axis))
            return self.imitation.update(learner, seen, label, augment_key, rate, imageless, remembered)

        def updates(learner: DaggerLearner) -> tuple[DaggerLearner, dict[str, Array]]:
            last = learner if learner.last is None else dataclasses.replace(learner, actor=learner.last)
            after, found = jax.lax.scan(update, last, jax.random.split(key, self.updates))
            return after if learner.last is None else self.averaged(learner, after), jax.tree.map(jnp.mean, found)

        learner, losses = if_ready(ready, updates, learner)
        return learner, buffer, {**losses, "updates": ready * jnp.float32(self.updates)}


def random_rows(samples: Seen, key: Array, count: int) -> Seen:
    """So many samples, all equally likely."""
    row = jax.random.randint(key, (count,), 0, samples.vector.shape[0])
    return Seen(samples.vector[row], samples.image[row])
