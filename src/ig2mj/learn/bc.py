"""Behaviour cloning: an actor learns what an expert did, from a file of demonstrations alone.

One in ten steps is held out: the loss on those says whether more training helps. No environment is stepped; `ig2mj
evaluate` measures the policy.

Axes: N steps of all demonstrations, B samples, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
from flax import struct
from jaxtyping import Int

from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError
from ig2mj.learn.checkpoints import TAKEN, Checkpoints, only_run
from ig2mj.learn.demos import Demos
from ig2mj.learn.imitation import Imitation
from ig2mj.learn.log import Log
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.running_stats import RunningStats
from ig2mj.learn.settings import old_names_work
from ig2mj.learn.train import Run
from ig2mj.process import entry_point

HELD_OUT = 10
"""One in so many steps, in stretches of `STRETCH`, is held out."""

STRETCH = 50
CALL = 100
"""Updates of one call."""


@old_names_work
@dataclasses.dataclass(frozen=True)
class BCConfig:
    """Settings.

    Attributes:
      num_updates: of the run. batch_size: samples of an update. input_noise: deviation of what is added to normalized
        observations, against copying what was done before.
      aux_coef: weight of the privileged prediction's loss. image_shift: pixels that images are moved by at most.
      lr: learning rate, falling to `final_lr` along a cosine.
      action_bins: discretized values of each number of the action; 0: the action is the mean of a Gaussian.
      actor_layers: sizes. encoder: of images (`ig2mj.learn.networks.ENCODERS`).
    """

    num_updates: int = 20_000
    batch_size: int = 1024
    input_noise: float = 0.0
    aux_coef: float = 1.0
    image_shift: int = 2
    lr: float = 1e-3
    final_lr: float = 1e-5
    action_bins: int = 0
    actor_layers: tuple[int, ...] = (256, 256, 256)
    encoder: str = "small"


@struct.dataclass
class BCLearner:
    """What a run learns: weights, the optimizer's state and running statistics."""

    actor: Any
    opt: Any
    moments: RunningStats
    updates: Int[Array, ""]


@entry_point
class BC:
    """See the module's text."""

    name = "bc"

    def __init__(self, perception: Perception, action_size: int, config: BCConfig | None = None):
        """Compiles nothing yet."""
        self.perception, self.action_size = perception, action_size
        self.config = c = config or BCConfig()
        self.imitation = Imitation(perception, action_size, c)
        self.actor = self.imitation.actor
        self.learn = jax.jit(self.learn_fn, donate_argnums=0)
        self.judge = jax.jit(self.judge_fn)

    def init(self, key: Array, demos: Demos) -> BCLearner:
        """Untrained, with the means of the demonstrations."""
        actor, opt = self.imitation.init(key)
        moments = RunningStats.initial(self.perception.vector_size).update(demos.seen.vector)
        return BCLearner(actor, opt, moments, jnp.int32(0))

    def learn_fn(
        self, learner: BCLearner, demos: Demos, rows: Int[Array, "k"], key: Array
    ) -> tuple[BCLearner, dict[str, Array]]:
        """`CALL` updates on these rows of the demonstrations."""
        c = self.config

        def update(learner: BCLearner, key: Array) -> tuple[BCLearner, dict[str, Array]]:
            row_key, noise_key, shift_key = jax.random.split(key, 3)
            row = rows[jax.random.randint(row_key, (c.batch_size,), 0, rows.shape[0])]
            vector = demos.seen.vector[row]
            _, deviation = learner.moments.scales(len(learner.moments.var))
            vector += c.input_noise * deviation * jax.random.normal(noise_key, vector.shape)
            seen = Seen(vector, demos.seen.image[row])
            rate = jnp.asarray(optax.cosine_decay_schedule(c.lr, c.num_updates, c.final_lr / c.lr)(learner.updates))
            return self.imitation.update(learner, seen, demos.label[row], shift_key, rate)

        learner, found = jax.lax.scan(update, learner, jax.random.split(key, CALL))
        return learner, jax.tree.map(jnp.mean, found)

    def judge_fn(self, learner: BCLearner, demos: Demos, rows: Int[Array, "k"], key: Array) -> Array:
        """The loss on these rows, 4,096 of them at most."""
        row = rows[: 4 * 1024]
        seen = Seen(demos.seen.vector[row], demos.seen.image[row])
        _, found = self.imitation.loss(learner.actor, learner.moments, seen, demos.label[row], key)
        return found["actor_loss"]


@entry_point
def clone(algorithm: BC, demos: Demos, run: Run, depends: Mapping[str, Any] | None = None) -> tuple[Any, dict]:
    """Trains on demonstrations until the configured number of updates, or the run's minutes, are over.

    Returns:
      What was learned, and the last row of the report.

    Raises:
      Ig2mjError: the loss is not finite, or the run's folder has a run already, or another run is writing there.
    """
    with only_run(run.out):
        return _clone(algorithm, demos, run, depends or {})


def _clone(algorithm: BC, demos: Demos, run: Run, depends: Mapping[str, Any]) -> tuple[Any, dict]:
    depends = {**depends, "algorithm": "bc", "settings": dataclasses.asdict(algorithm.config)}
    key = jax.random.PRNGKey(run.seed)
    learner = jax.jit(algorithm.init)(key, demos)
    checkpoints, log = (
        (Checkpoints(run.out) if run.out is not None else None),
        Log(run.out, quiet=run.quiet, minutes=run.minutes),
    )
    if run.resume and checkpoints is not None:
        found = checkpoints.newest({"learner": learner}, depends)
        learner = found[0]["learner"] if found is not None else learner
    elif checkpoints is not None and checkpoints.numbers():
        raise Ig2mjError(f"{run.out} {TAKEN}")
    rows = np.arange(demos.reward.shape[0])
    held_out = (rows // STRETCH) % HELD_OUT == HELD_OUT - 1 if len(rows) >= STRETCH * HELD_OUT else rows % HELD_OUT == 0
    training, testing = jnp.asarray(rows[~held_out]), jnp.asarray(rows[held_out])
    began = logged = saved = time.monotonic()
    row: dict[str, Any] = {}
    while True:
        key, now = jax.random.split(key)
        learner, losses = algorithm.learn(learner, demos, training, now)
        losses = {name: float(value) for name, value in losses.items()}
        updates, clock = int(learner.updates), time.monotonic()
        if not all(np.isfinite(v) for v in losses.values()):
            raise Ig2mjError(f"training stopped: a loss is not finite ({losses})")
        over = updates >= algorithm.config.num_updates or clock - began > run.minutes * 60
        if over or clock - logged > run.log_every:
            row_held_out = float(algorithm.judge(learner, demos, testing, now))
            seconds = clock - began
            row = {"seconds": seconds, "iteration": updates // CALL, "env_steps": updates, "success": None}
            row |= {"steps_per_second": None, "updates_per_second": updates / seconds, **losses}
            row["held_out_loss"] = row_held_out
            log.row(row)
            logged = clock
        if checkpoints is not None and (over or clock - saved > run.checkpoint_every):
            meta = {"seconds": clock - began, "iteration": updates // CALL, "depends": depends}
            checkpoints.save(updates // CALL, {"learner": learner}, meta)
            saved = time.monotonic()
        if over:
            log.close()
            return learner, row


@entry_point
def begin_as_clone(algorithm: Any, demos: Demos, seed: int, updates: int = 2000) -> Any:
    """What another algorithm learns from, where its actor begins as a clone of demonstrations (SAC's `cloned`)."""
    c = algorithm.config
    config = BCConfig(
        num_updates=updates,
        batch_size=min(c.batch_size, 1024),
        aux_coef=c.aux_coef,
        image_shift=c.image_shift,
        actor_layers=c.actor_layers,
        encoder=c.encoder,
        action_bins=getattr(c, "action_bins", 0),
    )
    cloner = BC(algorithm.perception, algorithm.action_size, config)
    learner, _ = clone(cloner, demos, Run(minutes=60.0, seed=seed, quiet=True))
    return algorithm.cloned(jax.jit(algorithm.init)(jax.random.PRNGKey(seed)), learner.actor, learner.moments)
