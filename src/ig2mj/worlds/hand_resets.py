"""`HandResets`: hands that are asked back while they are out of their arm's reach come back at once.

A hand that something blocks stays behind when the body goes on, and may never come back by its own force. iGibson's
reset of a hand teleports it to where it is pulled (iGibson's behavior_robot.py). So it is here for hands
beyond their reach; nearer ones are pulled back, since a hand that jumps could land inside something.

Axes: W worlds, n numbers of an action, K hands of a robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Engine, Physics, Write
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.worlds.lazy.of_view import OfView


@runtime_checkable
class WithHandResets(Protocol):
    """A controller whose hands can be asked back.

    Attributes:
      reset_numbers: [K] numbers of the action that ask a hand back, above 0.
      hand_qposadr: [K, 3] addresses of the coordinates that are the hand's position in the world.
    """

    reset_numbers: Int[np.ndarray, "K"]
    hand_qposadr: Int[np.ndarray, "K 3"]

    def out_of_reach(self, view: PhysicsView, state: Any) -> tuple[Bool[Array, "W K"], Float[Array, "W K 3"]]:
        """Hands beyond their arm's reach, and where in the world they are pulled to, m."""
        ...


class HandResets:
    """Of an engine's worlds. `act` may be part of a compiled program on a pure engine."""

    def __init__(self, engine: Engine, controllers: Sequence[Controller], enabled: bool):
        """`enabled`: on a pure engine a write more in every program that steps; so only where hands may be reset."""
        self._engine, self._parts = engine, []
        first = 0
        for number, controller in enumerate(controllers):
            if enabled and isinstance(controller, WithHandResets):
                self._parts.append((number, first + controller.reset_numbers, controller))
            first += controller.action_size
        self._find = OfView(self._found)

    def act(self, physics: Physics, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]) -> Physics:
        """Physics with such hands where they are pulled to.

        Args:
          action: of all robots. states: of their controllers, after the action.
        """
        if not self._parts:
            return physics
        if self._engine.pure:
            asked, mask, pos = self._found(view, action, states)
            write = Write(qpos_mask=mask, qpos=pos)
            return jax.lax.cond(asked, lambda p: self._engine.write(p, write), lambda p: p, physics)
        numbers = np.concatenate([numbers for _, numbers, _ in self._parts])
        if not (np.asarray(action)[:, numbers] > 0).any():
            return physics
        asked, mask, pos = self._find(view, action, states)
        if not bool(asked):
            return physics
        return self._engine.write(physics, Write(qpos_mask=np.asarray(mask), qpos=np.asarray(pos)))

    def _found(
        self, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]
    ) -> tuple[Bool[Array, ""], Bool[Array, "W nq"], Float[Array, "W nq"]]:
        """Whether any hand jumps, and the coordinates that are written."""
        worlds, length = action.shape[0], self._engine.scene.model.nq
        mask, pos = jnp.zeros((worlds, length), bool), jnp.zeros((worlds, length), jnp.float32)
        for number, numbers, controller in self._parts:
            beyond, target = controller.out_of_reach(view, states[number])
            jumps = beyond & (jnp.asarray(action)[:, numbers] > 0)
            address = controller.hand_qposadr
            mask = mask.at[:, address].set(jnp.broadcast_to(jumps[..., None], target.shape))
            pos = pos.at[:, address].set(target)
        return mask.any(), mask, pos
