"""The action of a task: velocities of one hand or of both, while the rest of the robot stays where it is.

Six numbers of -1 to 1 for each hand: linear velocity, then angular velocity, about the axes of the robot's base. At 1
they are 0.5 m/s and 0.5 rad/s (paper, appendix A.3), or what the robot's `HandControl` says. Where hands do not stick
by themselves, a seventh number of each closes them.

Axes: W worlds, n numbers of an action, m of the controller's action.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.task_robot import HandControl
from ig2mj.engine.view import Array
from ig2mj.errors import EngineError

SPEED, TURN_SPEED = 0.5, 0.5
"""m/s and rad/s of a hand at 1 (paper, appendix A.3)."""

DRIVE = ("forward", "turn_left")
"""Numbers of a controller's action that drive a robot."""


@dataclasses.dataclass(frozen=True, eq=False)
class ActionMap:
    """From a task's action to the robot's.

    Attributes:
      names: what each number moves. places: [n] index into the controller's action of each.
      scale: [n] by which it is multiplied. rest: [m] the controller's action where nothing moves.
    """

    names: tuple[str, ...]
    places: Int[np.ndarray, "n"]
    scale: Float[np.ndarray, "n"]
    rest: Float[np.ndarray, "m"]

    @property
    def size(self) -> int:
        """n."""
        return len(self.names)

    def __call__(self, action: Float[Array, "W n"]) -> Float[Array, "W m"]:
        """The controller's action. Pure."""
        source = np.full(len(self.rest), -1)
        source[self.places] = np.arange(self.size)  # a gather: next to the native engine no scatter runs in one call
        return jnp.where(source >= 0, (jnp.clip(action, -1.0, 1.0) * self.scale)[:, source], self.rest)


def hand_actions(
    names: Sequence[str],
    controls: Sequence[HandControl],
    hands: tuple[int, ...],
    closing: bool,
    period: float = ACTION_PERIOD,
) -> ActionMap:
    """The action that moves these hands of a robot.

    Args:
      names: of the robot's action (`Controller.action_names`). controls: of all of its hands.
      hands: numbers among them. closing: with a number for each hand that closes it. period: seconds of an action.

    Raises:
      EngineError: the robot has no such hands to move.
    """
    names = tuple(names)
    if not set(hands) <= set(range(len(controls))):
        raise EngineError(f"a robot with {len(controls)} hands that tasks can move has no hands {hands}")
    chosen, scale = [], []
    for control in (controls[h] for h in hands):
        rate = period if control.displaces else 1.0
        chosen += [*control.move, *control.turn]
        scale += [control.move_scale * rate] * 3 + [control.turn_scale * rate] * 3
        if closing:
            chosen.append(control.close)
            scale.append(1.0)
    places = np.array([names.index(name) for name in chosen])
    return ActionMap(tuple(chosen), places, np.array(scale, np.float32), _rest(names, controls))


def whole_actions(names: Sequence[str], high: Float[np.ndarray, "n"]) -> ActionMap:
    """All numbers of a robot's action; 1 is its limit `high`."""
    return ActionMap(tuple(names), np.arange(len(names)), high.astype(np.float32), np.zeros(len(names), np.float32))


def robot_actions(
    names: Sequence[str], controls: Sequence[HandControl] = (), arm: bool = False, gripper: bool = False
) -> ActionMap:
    """The robot's own numbers, -1 to 1: of its drive and, if requested, of its first hand.

    Args:
      names: of the robot's action (`Controller.action_names`). controls: of its hands.
      arm, gripper: the action also moves the first hand, and closes it. Other parts of the robot stay as they are,
        open hands open.

    Raises:
      EngineError: the robot does not drive, or has no hand.
    """
    names = tuple(names)
    if (arm or gripper) and not controls:
        raise EngineError(f"a robot with the actions {', '.join(names[:6])} has no hand that tasks can move")
    moved = (*controls[0].move, *controls[0].turn) if arm else ()
    chosen = (*DRIVE, *moved, *((controls[0].close,) if gripper else ()))
    missing = [name for name in chosen if name not in names]
    if missing:
        raise EngineError(f"a robot with the actions {', '.join(names[:6])} lacks {', '.join(missing)}")
    places = np.array([names.index(name) for name in chosen])
    return ActionMap(chosen, places, np.ones(len(chosen), np.float32), _rest(names, controls))


def _rest(names: tuple[str, ...], controls: Sequence[HandControl]) -> Float[np.ndarray, "m"]:
    """The controller's action in which nothing moves and hands that rest open are open."""
    rest = np.zeros(len(names), np.float32)
    for control in controls:
        if control.rests_open:
            rest[names.index(control.close)] = control.opens
    return rest
