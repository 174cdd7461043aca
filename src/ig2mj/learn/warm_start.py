"""Training that starts from a policy's networks instead of untrained ones: `ig2mj train --init-from`.

A policy's file holds what acts: the actor and the scales of what it sees and predicts. All else that an algorithm
keeps, such as critics, the optimizer's state and labels, starts from nothing.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.errors import InputError
from ig2mj.learn.policies import PREDICTION_LAYERS, Policy, flat, nested
from ig2mj.learn.running_stats import RunningStats

KNOWN = 1e6
"""Samples that a policy's scales count for, so that new ones hardly move them: its networks are trained on them."""

GROWS = "trunk/Dense_0/kernel"
"""The layer that may have more inputs than the policy's: those of a memory come last, with weights of 0."""


def init_from_policy(algorithm: Any, policy: Policy, seed: int, file: object = "the policy") -> Any:
    """An algorithm's learner with a policy's actor.

    Args:
      algorithm: SAC or DAgger, made for what the policy was made for (`Policy.check`).
      file: of the policy, for messages.

    Raises:
      InputError: its networks have other layers, or its scales are not in the file.
    """
    learner = jax.jit(algorithm.init)(jax.random.PRNGKey(seed))
    mine, theirs = flat(learner.actor), dict(policy.weights)
    if not algorithm.actor.acts_on_prediction:
        theirs |= {name: have for name, have in mine.items() if name.startswith(PREDICTION_LAYERS)}
    if mine.keys() != theirs.keys():
        other = sorted(mine.keys() ^ theirs.keys())[0]
        raise InputError(file, "has other networks", element=other, fix=_settings(policy))
    new = {}
    for name, have in mine.items():
        weights = np.asarray(theirs[name], np.float32)
        more = have.shape[0] - weights.shape[0] if name == GROWS else 0
        if more > 0:
            weights = np.pad(weights, ((0, more), (0, 0)))
        if weights.shape != have.shape:
            words = f"is of {'x'.join(map(str, weights.shape))} numbers, not of {'x'.join(map(str, have.shape))}"
            raise InputError(file, words, element=name, fix=_settings(policy))
        new[name] = jnp.asarray(weights)
    hidden = algorithm.perception.vector_size - algorithm.perception.actor_size
    mean, deviation, count = policy.mean, policy.deviation, np.full(algorithm.perception.vector_size, KNOWN)
    if hidden:
        unseen = policy.hidden
        if unseen is None and algorithm.actor.acts_on_prediction:
            raise InputError(file, "lacks the scales of its prediction", fix="train it again")
        if unseen is None:  # no action depends on them
            unseen = np.zeros(hidden, np.float32), np.ones(hidden, np.float32)
            count[-hidden:] = 0.0
        mean, deviation = (np.concatenate(pair) for pair in zip((mean, deviation), unseen, strict=True))
    learner = algorithm.cloned(learner, nested(new), RunningStats.of(mean, deviation, count))
    # with one update done, the policy acts from the first step on
    return dataclasses.replace(learner, updates=jnp.int32(1))


def _settings(policy: Policy) -> str:
    """What to train with."""
    net = policy.card["net"]
    layers = ",".join(map(str, net["sizes"]))
    found = {"encoder": net["net"], "actor_layers": layers, "action_bins": net.get("choices", 0)}
    if "recall" in net:
        full = net["recall"].get("hands") and net["recall"].get("whole", True)
        found["object_memory"] = "full" if full else "poses"
    return "its settings: --set " + " ".join(f"{name}={value}" for name, value in found.items())
