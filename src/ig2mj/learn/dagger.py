"""DAgger: a policy acts, an expert says what it would have done, and the policy learns that.

The experts of `ig2mj.tasks.experts` answer in any state, so labels cost nothing, and the policy learns in the states
that it comes to itself (Ross, Gordon and Bagnell 2011). At first the expert acts in a share of the worlds that falls
to none over the first part of the run; the expert's own actions are disturbed, so that ways back are seen as well.

What is learned is for each number of the action how likely each of some values is, or the mean of the same actor as
SAC's and PPO's (`ig2mj.learn.heads`). An iteration is `length` steps of all worlds, then
`updates` updates for each of them, on samples of all steps that are kept.

Axes: W worlds, T steps, B samples, K objects, n numbers of an action.
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
from ig2mj.learn.belief import beliefs_of, errors_of
from ig2mj.learn.belief import nothing as nothing_believed
from ig2mj.learn.collect import GUIDED, Advice, Hint, Transition, if_ready
from ig2mj.learn.guidance import ALONE, uncounted
from ig2mj.learn.heads import likeliest
from ig2mj.learn.hidden import Hidden
from ig2mj.learn.labels import Imitation, Labels
from ig2mj.learn.moments import Moments, share_of
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.recall import Recall
from ig2mj.process import entry_point
from ig2mj.tasks.experts.sight import Belief
from ig2mj.tasks.task import HORIZON

RECALLED = "recalled"
"""The name among a transition's extras of what was remembered."""

GUESSED = "guessed"
"""And of the actor's guess, where it is kept."""


@dataclasses.dataclass(frozen=True)
class DaggerConfig:
    """Settings; `ig2mj train --set name=value` changes them.

    Attributes:
      length: steps of the worlds in an iteration. updates: for each of them.
      batch: samples of an update, of all devices together.
      capacity: labels that are kept, of all worlds together. warm_up: steps of each world before the first update.
      alone: share of the run after which the expert acts no more. noise: deviation of what is added to actions.
      disturbed: share of the expert's steps in which its action is replaced by a random one.
      guess: weight of the actor's guess of the privileged state, from pixels. shift: pixels they are moved by at most.
      lr: learning rate, falling to `last_lr` along a cosine over the run.
      starts: pictures of so many start states, from which the guess learns, too: half as many samples again in each
        update. look: updates of the guess on those before the first step. opening: so many first steps of each such
        episode are the expert's, and every seventh is among the pictures.
      told: samples of an update besides, of which only the actor's layers learn: what it guessed of their pictures as
        it acted is kept. Pictures cost time, these next to none. For the encoder `glimpses`.
      recall: 1: the actor remembers what a hand soon hides (`ig2mj.learn.recall`). 2: it also sees what was felt and
        guessed when a hand last took something, as older policies do. For the encoder `glimpses`.
      believed: 1: the expert's labels are for where such an actor takes objects to be (`ig2mj.learn.belief`).
      average: updates over which the weights of the actor that acts are averaged; 0: it acts with the last ones.
      choices: values of each number of an action that the actor chooses from; 0: it is the mean of a Gaussian.
      actor: sizes of the layers. net: encoder (`networks.NETS`).
    """

    length: int = 4
    updates: int = 16
    batch: int = 1024
    capacity: int = 1_000_000
    warm_up: int = 12
    alone: float = 0.2
    noise: float = 0.1
    disturbed: float = 0.1
    guess: float = 1.0
    shift: int = 2
    lr: float = 1e-3
    last_lr: float = 1e-4
    starts: int = 0
    opening: int = 0
    look: int = 0
    told: int = 0
    recall: int = 0
    believed: int = 0
    average: int = 0
    choices: int = 21
    actor: tuple[int, ...] = (256, 256, 256)
    net: str = "small"


@struct.dataclass
class DaggerLearner:
    """All that is learned. `actor`: weights of what acts. `progress`: share of the run that was over at the last
    iteration. `quick`: the last update's weights, where those of `actor` are a mean; else None."""

    actor: Any
    opt: Any
    moments: Moments
    progress: Float[Array, ""]
    updates: Int[Array, ""]
    quick: Any = None


@struct.dataclass
class Turns:
    """Who acts in each world: a number from 0 to 1; the expert, where its share is larger.

    `left`: steps until it is drawn anew. `alone`: the expert has no part in this episode. `helped`: it had one.
    `helpless`: steps since the expert's part ended. `recalled`: what the actor remembers. `beliefs`: where it takes
    objects to be, if the expert is to know. `at_first`: m by which it was off in the episode's first step.
    """

    draw: Float[Array, "W"]
    left: Int[Array, "W"]
    alone: Bool[Array, "W"]
    helped: Bool[Array, "W"]
    helpless: Int[Array, "W"]
    recalled: Float[Array, "W m"]
    beliefs: dict[str, Belief] | None = None
    at_first: Float[Array, "W K"] | None = None


@entry_point
class Dagger:
    """See the module's text. All methods are pure."""

    name = "dagger"

    def __init__(
        self,
        perception: Perception,
        action_size: int,
        expert: Hint,
        config: DaggerConfig | None = None,
        axis: str | None = None,
        starts: Seen | None = None,
    ):
        """`expert`: see `collect.Hint`. `axis`: the name of an axis of devices over which gradients are averaged.
        `starts`: pictures of start states (`ig2mj.learn.looking`), on the host.

        Raises:
          Ig2mjError: something is to be told to an encoder that cannot be told it, or there is nothing to
            look at; or start states are to be shared by several devices.
        """
        self.perception, self.action_size, self.hint, self.axis = perception, action_size, expert, axis
        self.config = c = config or DaggerConfig()
        self.starts = starts
        if c.opening and starts is None:
            raise Ig2mjError(f"opening={c.opening}: no pictures of start states are taken (--set starts=4096)")
        if starts is not None and axis is not None:
            raise Ig2mjError(f"starts={c.starts}: pictures of start states are for one device (--devices 1)")
        if c.look and starts is None:
            raise Ig2mjError(f"look={c.look}: there are no start states to look at (--set starts=4096)")
        for name, value in (("told", c.told), ("recall", c.recall)):
            if value and (c.net != "glimpses" or not perception.objects):
                raise Ig2mjError(f"{name}={value}: only for actors of pictures with net=glimpses, which guess")
        if c.believed and not c.recall:
            raise Ig2mjError(f"believed={c.believed}: only an actor that remembers believes anything (--set recall=1)")
        self._imitation = Imitation(perception, action_size, c, axis)
        self.actor = self._imitation.actor

    @property
    def length(self) -> int:
        """Steps of an iteration."""
        return self.config.length

    @property
    def samples(self) -> int:
        """Updates of an iteration."""
        return self.config.length * self.config.updates

    def warm_up(self, resumed: bool) -> int:
        """Iterations without updates: labels are gathered."""
        return -(-max(self.config.warm_up, 3 * self.config.length) // self.config.length)

    def init(self, key: Array) -> DaggerLearner:
        """Untrained."""
        actor, opt = self._imitation.init(key)
        moments = Moments.initial(self.perception.vector_size)
        return self.begun(DaggerLearner(actor, opt, moments, jnp.float32(0), jnp.int32(0)))

    def begun(self, learner: DaggerLearner) -> DaggerLearner:
        """The same, its mean of weights begun anew with those that it acts with."""
        copy = jax.tree.map(jnp.copy, learner.actor) if self.config.average else None
        return dataclasses.replace(learner, quick=copy)

    def averaged(self, learner: DaggerLearner, learnt: DaggerLearner) -> DaggerLearner:
        """`learnt`, whose `actor` has been updated from `learner.quick`, acting with a mean of weights.

        That is a running mean, by iterations, and as long as fewer updates lie behind it the plain one.
        """
        before = jnp.float32(learner.updates) / self.samples
        part = jnp.maximum(1.0 / (1.0 + before), min(self.samples / self.config.average, 1.0))
        mean = jax.tree.map(lambda old, new: old + part * (new - old), learner.actor, learnt.actor)
        return dataclasses.replace(learnt, actor=mean, quick=learnt.actor)

    def looked(
        self, learner: DaggerLearner, starts: Seen, count: int, key: Array
    ) -> tuple[DaggerLearner, dict[str, Array]]:
        """A learner whose guess has learnt from start states in `count` updates, and its losses. Not compiled."""
        c = self.config

        def update(learner: DaggerLearner, key: Array) -> tuple[DaggerLearner, dict[str, Array]]:
            sample_key, shake_key = jax.random.split(key)
            seen, none = _some(starts, sample_key, c.batch), jnp.zeros((0, self.action_size))
            return self._imitation.update(learner, seen, none, shake_key, jnp.float32(c.lr))

        learner, found = jax.lax.scan(update, learner, jax.random.split(key, count))
        return self.begun(learner), jax.tree.map(jnp.mean, found)

    def memory(self, num_worlds: int) -> Labels:
        """No labels yet."""
        rows = max(self.config.capacity // (num_worlds * self.length), 1) * self.length
        starts = jax.tree.map(jnp.asarray, self.starts)
        kept = self._remembers, self.guesses
        return Labels.empty(rows, num_worlds, self.perception, self.action_size, starts, *kept)

    @property
    def guesses(self) -> int:
        """Numbers of a guess that are kept with each label; 0: none are."""
        return self.actor.guess + 2 * self.actor.objects if self.config.told else 0

    @property
    def recall(self) -> Recall | None:
        """What the actor remembers; None: nothing."""
        return self._imitation.recall

    @property
    def _remembers(self) -> int:
        """Numbers."""
        return 0 if self.recall is None else self.recall.size

    def noise(self, num_worlds: int) -> Turns:
        """Before the first step."""
        # one for each, since buffers are donated
        no, none = jnp.zeros(num_worlds, bool), jnp.zeros(num_worlds, bool)
        zero, nought = jnp.zeros(num_worlds, jnp.int32), jnp.zeros(num_worlds, jnp.int32)
        nothing = jnp.zeros((num_worlds, self._remembers))
        new = Turns(jnp.zeros(num_worlds), zero, no, none, nought, nothing)
        if self._believer is None:
            return new
        _, hidden = self._believer
        at_first = jnp.zeros((num_worlds, len(hidden.poses)))
        return dataclasses.replace(new, beliefs=nothing_believed(hidden, num_worlds), at_first=at_first)

    def act(
        self, learner: DaggerLearner, turns: Turns, seen: Seen, key: Array, advice: Advice
    ) -> tuple[Float[Array, "W n"], dict[str, Array], Turns]:
        """The expert's action in its worlds, the policy's in the others; a world's turn is up to 50 steps long.

        A tenth of the episodes is the policy's alone from the first update on; success is reported of those, and of all
        once the longest episode has passed without the expert.
        """
        assert advice.label is not None, "DAgger needs an expert"
        c = self.config
        draw_key, time_key, noise_key, any_key, which_key, alone_key = jax.random.split(key, 6)
        over = turns.left <= 0
        draw = jnp.where(over, jax.random.uniform(draw_key, over.shape), turns.draw)
        left = jnp.where(over, jax.random.randint(time_key, over.shape, 1, 51), turns.left) - 1
        begins = advice.steps == 0
        head, recalled, guess = self._imitation.choose(learner.actor, learner.moments, seen, turns.recalled, begins)
        own_action = likeliest(head)
        share = jnp.where(learner.updates == 0, 1.0, 1.0 - learner.progress / max(c.alone, 1e-6))
        alone = jnp.where(begins, jax.random.uniform(alone_key, begins.shape) < ALONE, turns.alone)
        expert = (draw < share) & ~(alone & (learner.updates > 0))
        helped = expert | (turns.helped & ~begins)
        label = jnp.clip(advice.label, -1.0, 1.0)
        wild = (jax.random.uniform(which_key, expert.shape) < c.disturbed) & expert
        action = jnp.where(expert[:, None], label, own_action)
        action = action + c.noise * jax.random.normal(noise_key, action.shape)
        action = jnp.where(wild[:, None], jax.random.uniform(any_key, action.shape, minval=-1.0), action)
        # Of the episodes that begin alone as the expert's part ends the short ones end first, and those succeed; as do
        # those of the first that the policy has alone.
        apart, helpless = uncounted(~alone, turns.helpless, share > 0)
        apart |= learner.updates < HORIZON * c.updates
        extra = {"label": label, GUIDED: helped | apart, **({RECALLED: recalled} if self._remembers else {})}
        extra |= {GUESSED: guess} if self.guesses else {}
        new = Turns(draw, left, alone, helped, helpless, recalled)
        if self._believer is not None:
            new = self._with_beliefs(*self._believer, new, turns, learner.moments, seen, guess, begins)
        return jnp.clip(action, -1.0, 1.0), extra, new

    @property
    def _believer(self) -> tuple[Recall, Hidden] | None:
        """What the actor remembers and guesses, if the expert is to know where it takes objects to be; else None."""
        recall, hidden = self.recall, self.perception.hidden
        return (recall, hidden) if self.config.believed and recall is not None and hidden is not None else None

    def _with_beliefs(
        self,
        recall: Recall,
        hidden: Hidden,
        new: Turns,
        old: Turns,
        moments: Moments,
        seen: Seen,
        guess: Float[Array, "W g"],
        begins: Bool[Array, "W"],
    ) -> Turns:
        """`new` with where the actor takes objects to be. `old`: of the step before."""
        assert old.at_first is not None
        scales, vector = moments.scales(seen.vector.shape[-1]), seen.vector
        at_first = jnp.where(begins[:, None], errors_of(recall, scales, vector, guess), old.at_first)
        beliefs = beliefs_of(recall, hidden, scales, vector, new.recalled, guess, at_first)
        return dataclasses.replace(new, beliefs=beliefs, at_first=at_first)

    def learn(
        self,
        learner: DaggerLearner,
        memory: Labels,
        rollout: Transition,
        key: Array,
        progress: Float[Array, ""],
        ready: Bool[Array, ""],
    ) -> tuple[DaggerLearner, Labels, dict[str, Array]]:
        """Keeps a rollout's labels, and makes an iteration's updates.

        Args:
          progress: share of the run that is over. ready: without it nothing is updated: labels are gathered.
        """
        c = self.config
        extra = rollout.extra
        memory = memory.insert(rollout.seen, extra["label"], extra.get(RECALLED), extra.get(GUESSED))
        moments = learner.moments.update(rollout.seen.vector, self.axis)
        learner = dataclasses.replace(learner, moments=moments, progress=progress)
        rate = jnp.asarray(optax.cosine_decay_schedule(c.lr, 1, c.last_lr / c.lr)(progress))

        def many(learner: DaggerLearner) -> tuple[DaggerLearner, dict[str, Array]]:
            def update(learner: DaggerLearner, key: Array) -> tuple[DaggerLearner, dict[str, Array]]:
                sample_key, shift_key, start_key, told_key = jax.random.split(key, 4)
                count = share_of(c.batch, self.axis)
                seen, label, recalled = memory.sample(sample_key, count)
                if memory.starts is not None:
                    more = _some(memory.starts, start_key, count // 2)
                    seen = jax.tree.map(lambda *a: jnp.concatenate(a), seen, more)
                told = memory.told(told_key, share_of(c.told, self.axis)) if c.told else None
                return self._imitation.update(learner, seen, label, shift_key, rate, told, recalled)

            last = learner if learner.quick is None else dataclasses.replace(learner, actor=learner.quick)
            learnt, found = jax.lax.scan(update, last, jax.random.split(key, self.samples))
            learner = learnt if learner.quick is None else self.averaged(learner, learnt)
            return learner, jax.tree.map(jnp.mean, found)

        learner, losses = if_ready(ready, many, learner)
        return learner, memory, {**losses, "updates": ready * jnp.float32(self.samples)}


def _some(starts: Seen, key: Array, count: int) -> Seen:
    """So many of them, all equally likely."""
    row = jax.random.randint(key, (count,), 0, starts.vector.shape[0])
    return Seen(starts.vector[row], starts.picture[row])
