"""`Controls`: MuJoCo's controls for an action of all robots of an engine's worlds.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Engine
from ig2mj.engine.view import Array, PhysicsView


class Controls:
    """Of the robots' controllers, one after the other.

    Attributes:
      low, high: [n] limits of an action.
    """

    def __init__(self, engine: Engine, controllers: Sequence[Controller]):
        self.low = np.concatenate([np.zeros(0), *(c.action_low for c in controllers)])
        self.high = np.concatenate([np.zeros(0), *(c.action_high for c in controllers)])
        self._controllers, self._worlds = tuple(controllers), engine.num_worlds
        self._act = engine.compile(self._acted)

    def first(self) -> tuple[Any, ...]:
        """What the controllers remember at the start."""
        return tuple(c.initial(self._worlds) for c in self._controllers)

    def act(
        self, action: Float[Array, "W n"], view: PhysicsView, states: tuple[Any, ...]
    ) -> tuple[Float[Array, "W nu"], tuple[Any, ...]]:
        """MuJoCo's controls for an action, clipped to its limits, and what the controllers remember now."""
        return self._act(view, action, states)

    def _acted(
        self, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]
    ) -> tuple[Float[Array, "W nu"], tuple[Any, ...]]:
        action = jnp.clip(jnp.asarray(action), self.low, self.high)
        sizes = np.cumsum([c.action_size for c in self._controllers])[:-1]
        asked = jnp.split(action, sizes, axis=-1)
        done = [c.control(a, view, s) for c, a, s in zip(self._controllers, asked, states, strict=True)]
        return jnp.concatenate([ctrl for ctrl, _ in done], axis=-1), tuple(state for _, state in done)
