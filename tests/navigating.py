"""What tests of navigation share: the tasks in the smallest home, and a driver that follows the way."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np

from ig2mj.envs.actor import Actor
from ig2mj.tasks.registry import load_task


def small(name: str, **changes):
    """The task in the smallest home."""
    return dataclasses.replace(load_task(name), home="small_home", **changes)


def column(env, state, *names):
    """These numbers of the privileged state, [W, n]."""
    at = [env.privileged_names.index(name) for name in names]
    return np.asarray(state.obs["privileged_state"])[:, at]


def drive(env, state):
    """Turns to the next point of the way, and drives on when it is ahead."""
    x, y = column(env, state, "ahead_x", "ahead_y").T
    return _towards(x, y, np).astype(np.float32)


def driver(env) -> Actor:
    """Who drives so, on a pure engine many steps in one program."""
    x, y = (env.privileged_names.index(name) for name in ("ahead_x", "ahead_y"))

    def choose(obs, kept, begins, key):
        seen = obs["privileged_state"]
        return _towards(seen[:, x], seen[:, y], jnp), kept

    return Actor(env, choose)


def _towards(x, y, xp):
    angle = xp.arctan2(y, x)
    return xp.stack([xp.where(xp.abs(angle) < 0.5, 0.8, 0.0), xp.clip(angle, -0.3, 0.3)], 1)
