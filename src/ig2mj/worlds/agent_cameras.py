"""`AgentCameras`: views of an engine with the agents' cameras where their controllers have them.

An engine knows a camera's compiled pose only. The humanoid moves its camera without joints: the pose is part of its
controller's state. Images are taken from that pose, and goals and predicates read it from the view.

Axes: W worlds, A agents.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
from jaxtyping import Float

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Engine
from ig2mj.engine.view import Array, PhysicsView


class AgentCameras:
    """The cameras on the robots of an engine's worlds. `placed` may be part of a compiled program.

    Attributes:
      moving: some controller moves its camera; otherwise views are as the engine makes them.
    """

    def __init__(self, engine: Engine, controllers: Sequence[Controller]):
        """`controllers`: of the scene's robots."""
        self._engine, self._controllers = engine, tuple(controllers)
        self.moving = any(controller.moves_eye for controller in controllers)
        self._poses = engine.compile(self._poses_fn)

    def placed(self, view: PhysicsView, states: tuple[Any, ...]) -> PhysicsView:
        """The view with all cameras at their poses.

        Args:
          view: of the engine. states: of the controllers; empty: cameras are where they were compiled.
        """
        if not self.moving or not states:
            return view
        return self._engine.with_eyes(view, lambda: self._poses(view, states))

    def _poses_fn(
        self, view: PhysicsView, states: tuple[Any, ...]
    ) -> tuple[Float[Array, "W A 3"], Float[Array, "W A 4"]]:
        pos, quat = jnp.asarray(view.agent.eye_pos), jnp.asarray(view.agent.eye_quat)
        for controller, state in zip(self._controllers, states, strict=True):
            if controller.moves_eye:
                own_pos, own_quat = controller.eye(view, state)
                pos, quat = pos.at[:, controller.agent].set(own_pos), quat.at[:, controller.agent].set(own_quat)
        return pos, quat
