"""`HandResets`: a hand beyond its arm's reach is teleported back when the action asks for it.

A hand that an obstacle blocks stays behind when the body moves on, and its own force may never bring it back. As in
iGibson (behavior_robot.py), a reset teleports the hand to its target. Here that happens only beyond the arm's reach:
nearer hands are pulled back, since a hand that jumps could land inside something.

Axes: W worlds, n numbers of an action, K hands of a robot, nq coordinates.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.agents.base import Controller
from ig2mj.engine.base import Engine, Physics, Write
from ig2mj.engine.view import Array, PhysicsView


@runtime_checkable
class WithHandResets(Protocol):
    """A controller whose hands can be reset.

    Attributes:
      reset_numbers: [K] indices into the action of each hand's reset, which acts above 0.
      hand_qposadr: [K, 3] addresses of the coordinates that are the hand's position in the world.
    """

    reset_numbers: Int[np.ndarray, "K"]
    hand_qposadr: Int[np.ndarray, "K 3"]

    def out_of_reach(self, view: PhysicsView, state: Any) -> tuple[Bool[Array, "W K"], Float[Array, "W K 3"]]:
        """Hands beyond their arm's reach, and where in the world they are pulled to, m."""
        ...


class HandResets:
    """Of an engine's worlds. `act` may be part of a compiled program."""

    def __init__(self, engine: Engine, controllers: Sequence[Controller], enabled: bool):
        """`enabled`: adds a write to every compiled program that steps; for actions that can ask a hand back."""
        self._engine, self._parts = engine, []
        numbers, address, first = [np.zeros(0, int)], [np.zeros((0, 3), int)], 0
        for number, controller in enumerate(controllers):
            if enabled and isinstance(controller, WithHandResets):
                self._parts.append((number, controller))
                numbers.append(first + controller.reset_numbers)
                address.append(controller.hand_qposadr)
            first += controller.action_size
        self._numbers, self._address = np.concatenate(numbers), np.concatenate(address)
        self._find = engine.compile(self._found, self._none_asked)

    def act(self, physics: Physics, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]) -> Physics:
        """Physics with such hands where they are pulled to.

        Args:
          action: of all robots. states: of their controllers, after the action.
        """
        if not self._parts:
            return physics
        jumps, mask, pos = self._find(view, action, states)

        def put_back(physics: Physics) -> Physics:
            return self._engine.write(physics, Write(qpos_mask=mask, qpos=pos))

        return self._engine.when_any(jumps, put_back, physics)

    def _none_asked(self, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]) -> tuple | None:
        """What `_found` returns where no action asks a hand back."""
        asked = np.asarray(action)[:, self._numbers] > 0
        return None if asked.any() else (asked.any(1), None, None)

    def _found(
        self, view: PhysicsView, action: Float[Array, "W n"], states: tuple[Any, ...]
    ) -> tuple[Bool[Array, "W"], Bool[Array, "W nq"], Float[Array, "W nq"]]:
        """Worlds in which a hand of any robot jumps, and the coordinates that put those hands at their targets."""
        found = [controller.out_of_reach(view, states[number]) for number, controller in self._parts]
        beyond, target = (jnp.concatenate(parts, axis=1) for parts in zip(*found, strict=True))
        jumps = beyond & (jnp.asarray(action)[:, self._numbers] > 0)
        source = np.full(self._engine.scene.model.nq, -1)  # the number of a target that a coordinate becomes
        source[self._address.ravel()] = np.arange(self._address.size)
        mask = jnp.broadcast_to(jumps[..., None], target.shape).reshape(len(jumps), -1)[:, source] & (source >= 0)
        return jumps.any(1), mask, target.reshape(len(jumps), -1)[:, source]
