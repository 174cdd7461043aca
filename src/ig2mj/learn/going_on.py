"""Beginning with a policy's networks instead of untrained ones: `ig2mj train --begin-with`.

A policy's file holds what acts: the actor and the scales of what it sees and guesses. What else an algorithm keeps,
such as the optimiser's state and labels, begins anew.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.errors import InputError
from ig2mj.learn.moments import Moments
from ig2mj.learn.policies import Policy, flat, nested

KNOWN = 1e6
"""Samples that a policy's scales count for: what follows hardly moves them, since its networks are made for them."""

GROWS = "trunk/Dense_0/kernel"
"""The layer that may take more than it did: what the actor remembers comes last among its inputs, with weights of 0."""


def further(algorithm: Any, policy: Policy, seed: int, file: object = "the policy") -> Any:
    """An algorithm's learner with a policy's actor.

    Args:
      algorithm: DAgger, made for what the policy was made for (`Policy.check`). file: of the policy, for messages.

    Raises:
      InputError: its networks have other layers, or its scales are not in the file.
    """
    learner = algorithm.init(jax.random.PRNGKey(seed))
    mine, theirs = flat(learner.actor), policy.weights
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
    mean, deviation = policy.mean, policy.deviation
    if hidden:
        unseen = policy.hidden
        if unseen is None and algorithm.actor.uses_guess:
            fix = "policies of now do: train it anew"
            raise InputError(file, "does not say in which scales it guesses what is hidden", fix=fix)
        unseen = unseen or (np.zeros(hidden, np.float32), np.ones(hidden, np.float32))  # whoever guesses nothing
        mean, deviation = (np.concatenate(pair) for pair in zip((mean, deviation), unseen, strict=True))
    # One update lies behind it, so that it acts at once.
    scales = Moments.of(mean, deviation, KNOWN)
    return algorithm.begun(dataclasses.replace(learner, actor=nested(new), moments=scales, updates=jnp.int32(1)))


def _settings(policy: Policy) -> str:
    """What to train with."""
    net = policy.card["net"]
    found = {"net": net["net"], "actor": ",".join(map(str, net["sizes"])), "choices": net.get("choices", 0)}
    if "recall" in net:
        found["recall"] = 2 if net["recall"].get("hands") and net["recall"].get("whole", True) else 1
    return "its settings: --set " + " ".join(f"{name}={value}" for name, value in found.items())
