"""Actions of the other robots of a navigation task: random ones, each repeated for `REPEAT` steps."""

from __future__ import annotations

from collections.abc import Callable

import jax
import numpy as np
from jaxtyping import Float, Int, UInt

from ig2mj.engine.view import Array
from ig2mj.worlds.random_streams import step_keys

REPEAT = 10
"""Agent steps for which a random action is held (`dynamic_objects_action_repeat`)."""


def wanderers(
    low: Float[np.ndarray, "n"], high: Float[np.ndarray, "n"]
) -> Callable[[UInt[Array, "W 2"], Int[Array, "W"]], Float[Array, "W n"]]:
    """Random actions between two limits, from the episode's key and the number of the agent step."""

    def act(key: UInt[Array, "W 2"], step: Int[Array, "W"]) -> Float[Array, "W n"]:
        keys = step_keys(key, step // REPEAT)
        return jax.vmap(lambda k: jax.random.uniform(k, low.shape, minval=low, maxval=high))(keys)

    return act
