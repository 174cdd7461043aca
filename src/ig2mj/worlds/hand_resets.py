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
        numbers, address, first = [np.zeros(0, int)], [np.zeros((0, 3), int)], 0
        for number, controller in enumerate(controllers):
            if enabled and isinstance(controller, WithHandResets):
                self._parts.append((number, controller))
                numbers.append(first + controller.reset_numbers)
                address.append(controller.hand_qposadr)
            first += controller.action_size
        self._numbers, self._address = np.concatenate(numbers), np.concatenate(address)
        self._find = OfView(self._found)

    def act(self, physics: Physics, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]) -> Physics:
        """Physics with such hands where they are pulled to.

        Args:
          action: of all robots. states: of their controllers, after the action.
        """
        if not self._parts:
            return physics
        worlds, length = action.shape[0], self._engine.scene.model.nq
        if self._engine.pure:
            jumps, target = self._found(view, action, states)
            mask, pos = jnp.zeros((worlds, length), bool), jnp.zeros((worlds, length), jnp.float32)
            mask = mask.at[:, self._address].set(jnp.broadcast_to(jumps[..., None], target.shape))
            write = Write(qpos_mask=mask, qpos=pos.at[:, self._address].set(target))
            return jax.lax.cond(jumps.any(), lambda p: self._engine.write(p, write), lambda p: p, physics)
        if not (np.asarray(action)[:, self._numbers] > 0).any():
            return physics
        jumps, target = self._find(view, action, states)
        if not jumps.any():
            return physics
        mask, pos = np.zeros((worlds, length), bool), np.zeros((worlds, length), np.float32)
        mask[:, self._address], pos[:, self._address] = jumps[..., None], target
        return self._engine.write(physics, Write(qpos_mask=mask, qpos=pos))

    def _found(
        self, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]
    ) -> tuple[Bool[Array, "W K"], Float[Array, "W K 3"]]:
        """Which hands of all robots jump, and where to."""
        found = [controller.out_of_reach(view, states[number]) for number, controller in self._parts]
        beyond, target = (jnp.concatenate(parts, axis=1) for parts in zip(*found, strict=True))
        return beyond & (jnp.asarray(action)[:, self._numbers] > 0), target
