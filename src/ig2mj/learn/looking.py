"""Looking before the first step: an encoder learns from pictures of start states where things are.

How a thing lies at the start shows best in many start states, and episodes are slow to bring those: one for some dozens
of pictures. So pictures of start states alone are taken first, and the guess of the hidden numbers learns from them,
before the first step and along with what the episodes show. Where a hand soon hides what it reaches for, pictures of
an expert's first steps belong to them.

Axes: N start states, W worlds.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.learn.collect import Hint, TrainingEnv
from ig2mj.learn.perception import Perception, Seen

CALL = 50
"""Updates of one call."""

BETWEEN = 7
"""Steps of an opening from one picture to the next."""

FIRST = 1_000_003
"""The first seed of the pictures' worlds: other than those of a run's episodes."""


def start_pictures(env: TrainingEnv, perception: Perception, count: int, expert: Hint = None, opening: int = 0) -> Seen:
    """What is seen in N = `count` states, as arrays of NumPy: worlds are reset, again and again.

    Args:
      opening: so many first steps of each episode are played by the `expert`, and every `BETWEEN`th is seen, too.
    """
    see, found = jax.jit(perception), []
    rounds = -(-count // (env.num_worlds * (1 + opening // BETWEEN)))
    for k in range(rounds):
        state = env.reset(FIRST + k)
        found.append(jax.device_get(see(state.obs)))
        for step in range(1, opening + 1):
            assert expert is not None, "an opening is played by an expert"
            state = env.step_autoreset(state, expert(state))
            if step % BETWEEN == 0:
                found.append(jax.device_get(see(state.obs)))
    return jax.tree.map(lambda *a: np.concatenate(a)[:count], *found)


def look(algorithm: Any, seed: int, report: Callable[[int, Any, float], None] | None = None) -> Any:
    """A learner whose guess has learnt from the algorithm's start states (`Dagger.starts`), `config.look` updates.

    Args:
      report: called now and then with the updates so far, the learner and the loss; None: that is printed.
    """
    key, first_key = jax.random.split(jax.random.PRNGKey(seed))
    learner, began, many = algorithm.init(first_key), time.monotonic(), algorithm.config.look
    starts = jax.tree.map(jnp.asarray, algorithm.starts)
    learner = dataclasses.replace(learner, moments=learner.moments.update(starts.vector))
    program = jax.jit(algorithm.looked, static_argnums=2)
    for done in range(0, many, CALL):
        key, now = jax.random.split(key)
        count = min(CALL, many - done)
        learner, found = program(learner, starts, count, now)
        loss = float(found["guess_loss"])
        if report is not None:
            report(done + count, learner, loss)
        elif done // CALL % 10 == 9:
            told = f"looked {done + count} of {many} times, {time.monotonic() - began:.0f} s, error {loss:.3f}"
            print(told, flush=True)
    return dataclasses.replace(learner, updates=jnp.zeros_like(learner.updates))
