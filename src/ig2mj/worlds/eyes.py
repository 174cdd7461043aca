"""`Eyes`: views of an engine with the agents' eyes where their controllers have them.

An engine knows the compiled camera only. The humanoid moves its eye without joints, so that where it looks is part of
what its controller remembers. Pictures are taken from there, and the view says so to goals and predicates.

Axes: W worlds, A agents.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Engine
from ig2mj.engine.view import Array, PhysicsView, replace_fields, with_eyes_later
from ig2mj.worlds.lazy.of_view import OfView


class Eyes:
    """The eyes of an engine's worlds. `seen` may be part of a compiled program on a pure engine.

    Attributes:
      moving: some controller moves its eye; otherwise views are as the engine makes them.
    """

    def __init__(self, engine: Engine, controllers: Sequence[Controller]):
        """`controllers`: of the scene's robots."""
        self._pure, self._controllers = engine.pure, tuple(controllers)
        self.moving = any(controller.moves_eye for controller in controllers)
        self._poses_of_view = OfView(self._poses)

    def seen(self, view: PhysicsView, states: tuple[Any, ...]) -> PhysicsView:
        """The view with all eyes in their places.

        Args:
          view: of the engine. states: what the controllers remember; empty: eyes are where they were compiled.
        """
        if not self.moving or not states:
            return view
        if not self._pure:
            return with_eyes_later(view, lambda: self._on_host(view, states))
        pos, quat = self._poses(view, states)
        return replace_fields(view, {"agent.eye_pos": pos, "agent.eye_quat": quat})

    def _on_host(self, view: PhysicsView, states: tuple[Any, ...]) -> tuple[np.ndarray, np.ndarray]:
        pos, quat = self._poses_of_view(view, states)
        return np.asarray(pos), np.asarray(quat)

    def _poses(self, view: PhysicsView, states: tuple[Any, ...]) -> tuple[Float[Array, "W A 3"], Float[Array, "W A 4"]]:
        pos, quat = jnp.asarray(view.agent.eye_pos), jnp.asarray(view.agent.eye_quat)
        for controller, state in zip(self._controllers, states, strict=True):
            if controller.moves_eye:
                own_pos, own_quat = controller.eye(view, state)
                pos, quat = pos.at[:, controller.agent].set(own_pos), quat.at[:, controller.agent].set(own_quat)
        return pos, quat
