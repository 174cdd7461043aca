"""Behaviour cloning: an actor learns what an expert did, from a file of demonstrations alone.

One in ten runs' steps is kept apart: the loss on those says whether more training helps. No environment is stepped;
`ig2mj evaluate` tells how good the policy is.

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
from ig2mj.learn.labels import Imitation
from ig2mj.learn.log import Log
from ig2mj.learn.moments import Moments
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.train import Run
from ig2mj.process import entry_point

APART = 10
"""One in so many steps, in stretches of `STRETCH`, is kept apart."""

STRETCH = 50
CALL = 100
"""Updates of one call."""


@dataclasses.dataclass(frozen=True)
class BCConfig:
    """Settings; `ig2mj train --set name=value` changes them.

    Attributes:
      steps: updates. batch: samples of an update. noise: deviation of what is added to normalized numbers that are
        seen, against copying what was done before.
      guess: weight of the actor's guess of the privileged state, from pixels. shift: pixels they are moved by at most.
      lr: learning rate, falling to `last_lr` along a cosine. actor: sizes of the layers. net: encoder.
      choices: values of each number of an action that the actor chooses from; 0: it is the mean of a Gaussian.
    """

    steps: int = 20_000
    batch: int = 1024
    noise: float = 0.0
    guess: float = 1.0
    shift: int = 2
    lr: float = 1e-3
    last_lr: float = 1e-5
    choices: int = 0
    actor: tuple[int, ...] = (256, 256, 256)
    net: str = "small"


@struct.dataclass
class BCLearner:
    """All that is learned."""

    actor: Any
    opt: Any
    moments: Moments
    updates: Int[Array, ""]


@entry_point
class BC:
    """See the module's text."""

    name = "bc"

    def __init__(self, perception: Perception, action_size: int, config: BCConfig | None = None):
        """Compiles nothing yet."""
        self.perception, self.action_size = perception, action_size
        self.config = c = config or BCConfig()
        self._imitation = Imitation(perception, action_size, c)
        self.actor = self._imitation.actor
        self.learn = jax.jit(self.learn_fn, donate_argnums=0)
        self.judge = jax.jit(self.judge_fn)

    def init(self, key: Array, demos: Demos) -> BCLearner:
        """Untrained, with the means of the demonstrations."""
        actor, opt = self._imitation.init(key)
        moments = Moments.initial(self.perception.vector_size).update(demos.seen.vector)
        return BCLearner(actor, opt, moments, jnp.int32(0))

    def learn_fn(
        self, learner: BCLearner, demos: Demos, rows: Int[Array, "k"], key: Array
    ) -> tuple[BCLearner, dict[str, Array]]:
        """`CALL` updates on these rows of the demonstrations."""
        c = self.config

        def update(learner: BCLearner, key: Array) -> tuple[BCLearner, dict[str, Array]]:
            row_key, noise_key, shift_key = jax.random.split(key, 3)
            row = rows[jax.random.randint(row_key, (c.batch,), 0, rows.shape[0])]
            vector = demos.seen.vector[row]
            _, deviation = learner.moments.scales(len(learner.moments.var))
            vector += c.noise * deviation * jax.random.normal(noise_key, vector.shape)
            seen = Seen(vector, demos.seen.picture[row])
            rate = jnp.asarray(optax.cosine_decay_schedule(c.lr, c.steps, c.last_lr / c.lr)(learner.updates))
            return self._imitation.update(learner, seen, demos.label[row], shift_key, rate)

        learner, found = jax.lax.scan(update, learner, jax.random.split(key, CALL))
        return learner, jax.tree.map(jnp.mean, found)

    def judge_fn(self, learner: BCLearner, demos: Demos, rows: Int[Array, "k"], key: Array) -> Array:
        """The loss on these rows, 4,096 of them at most."""
        row = rows[: 4 * 1024]
        seen = Seen(demos.seen.vector[row], demos.seen.picture[row])
        _, found = self._imitation.loss(learner.actor, learner.moments, seen, demos.label[row], key)
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
    learner = algorithm.init(key, demos)
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
    apart = (rows // STRETCH) % APART == APART - 1 if len(rows) >= STRETCH * APART else rows % APART == 0
    training, testing = jnp.asarray(rows[~apart]), jnp.asarray(rows[apart])
    began = logged = saved = time.monotonic()
    row: dict[str, Any] = {}
    while True:
        key, now = jax.random.split(key)
        learner, losses = algorithm.learn(learner, demos, training, now)
        losses = {name: float(value) for name, value in losses.items()}
        updates, clock = int(learner.updates), time.monotonic()
        if not all(np.isfinite(v) for v in losses.values()):
            raise Ig2mjError(f"training stopped: a loss is not finite ({losses})")
        over = updates >= algorithm.config.steps or clock - began > run.minutes * 60
        if over or clock - logged > run.log_every:
            kept_apart = float(algorithm.judge(learner, demos, testing, now))
            seconds = clock - began
            row = {"seconds": seconds, "iteration": updates // CALL, "env_steps": updates, "success": None}
            row |= {"steps_per_second": None, "updates_per_second": updates / seconds, **losses}
            row["loss_apart"] = kept_apart
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
def begin_as_clone(algorithm: Any, demos: Demos, seed: int, steps: int = 2000) -> Any:
    """What another algorithm learns from, where its actor begins as a clone of demonstrations (SAC's `cloned`)."""
    c = algorithm.config
    config = BCConfig(steps=steps, batch=min(c.batch, 1024), guess=c.guess, shift=c.shift, actor=c.actor, net=c.net)
    cloner = BC(algorithm.perception, algorithm.action_size, config)
    learner, _ = clone(cloner, demos, Run(minutes=60.0, seed=seed, quiet=True))
    return algorithm.cloned(algorithm.init(jax.random.PRNGKey(seed)), learner.actor, learner.moments)
