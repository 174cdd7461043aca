"""Pretraining of an encoder on images of start states, before the first step of a run.

An episode shows one start state in some dozens of images, so a run is slow to cover many. Images of start states alone
are therefore taken first. The encoder learns its predictions from them before the first step, and along with the run.
Where a hand soon hides what it reaches for, images of an expert's first steps belong to them.

Axes: N images, W worlds.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import Array
from ig2mj.learn.collect import TrainingEnv
from ig2mj.learn.dagger import Dagger, DaggerLearner, random_rows
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.protocols import Expert

CALL = 50
"""Updates of one compiled call."""

BETWEEN = 7
"""Steps of an expert between two images."""

FIRST = 1_000_003
"""The first seed of the worlds that are pictured: others than those of a run's episodes."""


def start_images(
    env: TrainingEnv, perception: Perception, count: int, expert: Expert | None = None, expert_steps: int = 0
) -> Seen:
    """What is seen in N = `count` states, as arrays of NumPy: worlds are reset, again and again.

    Args:
      expert_steps: so many first steps of each episode are the `expert`'s, and every `BETWEEN`th of them is seen, too.
    """
    see, found = jax.jit(perception), []
    rounds = -(-count // (env.num_worlds * (1 + expert_steps // BETWEEN)))
    for k in range(rounds):
        state = env.reset(FIRST + k)
        found.append(jax.device_get(see(state.obs)))
        for step in range(1, expert_steps + 1):
            assert expert is not None, "the first steps are an expert's"
            state = env.step_autoreset(state, expert(state))
            if step % BETWEEN == 0:
                found.append(jax.device_get(see(state.obs)))
    return jax.tree.map(lambda *a: np.concatenate(a)[:count], *found)


def pretrain(
    algorithm: Dagger, updates: int, seed: int, report: Callable[[int, Any, float], None] | None = None
) -> DaggerLearner:
    """A learner whose encoder has learned from the algorithm's images without labels (`Dagger.unlabelled`).

    Args:
      report: called now and then with the updates so far, the learner and the loss; None: that is printed.
    """
    key, first_key = jax.random.split(jax.random.PRNGKey(seed))
    learner, began = jax.jit(algorithm.init)(first_key), time.monotonic()
    images = jax.tree.map(jnp.asarray, algorithm.unlabelled)
    learner = dataclasses.replace(learner, moments=learner.moments.update(images.vector))
    program = jax.jit(
        lambda learner, images, count, key: _pretrained(algorithm, learner, images, count, key), static_argnums=2
    )
    for done in range(0, updates, CALL):
        key, now = jax.random.split(key)
        count = min(CALL, updates - done)
        learner, found = program(learner, images, count, now)
        loss = float(found["prediction_loss"])
        if report is not None:
            report(done + count, learner, loss)
        elif done // CALL % 10 == 9:
            spent = time.monotonic() - began
            print(
                f"encoder pretraining: update {done + count} of {updates}, {spent:.0f} s, loss {loss:.3f}", flush=True
            )
    return dataclasses.replace(learner, updates=jnp.zeros_like(learner.updates))


def _pretrained(
    algorithm: Dagger, learner: DaggerLearner, images: Seen, count: int, key: Array
) -> tuple[DaggerLearner, dict[str, Array]]:
    """The learner after `count` updates, and the means of its losses."""
    c = algorithm.config

    def update(learner: DaggerLearner, key: Array) -> tuple[DaggerLearner, dict[str, Array]]:
        sample_key, augment_key = jax.random.split(key)
        seen, no_labels = random_rows(images, sample_key, c.batch_size), jnp.zeros((0, algorithm.action_size))
        return algorithm.imitation.update(learner, seen, no_labels, augment_key, jnp.float32(c.lr))

    learner, found = jax.lax.scan(update, learner, jax.random.split(key, count))
    return algorithm.with_fresh_average(learner), jax.tree.map(jnp.mean, found)
