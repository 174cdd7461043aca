"""What an action of a task moves: the velocities of one hand or of both, while the rest of the robot stays.

Six numbers of -1 to 1 for each hand: linear velocity, then angular velocity, about the axes of the robot's base. At 1
they are 0.5 m/s and 0.5 rad/s (paper, appendix A.3). Where hands do not stick by themselves a
seventh number of each closes them: the humanoid's opens or closes by that much, Fetch's opens from 0 on.

Fetch's controller makes a fifth of the way to a goal 0.2 m ahead in an action: its 1 is 0.4 m/s.

Axes: W worlds, n numbers of an action, m of the controller's action.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.engine.view import Array
from ig2mj.errors import EngineError

SPEED, TURN_SPEED = 0.5, 0.5
"""m/s and rad/s of a 1."""

FETCH_TURN = 0.5
"""Share of Fetch's largest turn, 1 rad/s, that is `TURN_SPEED`."""

_POSE = ("x", "y", "z", "roll", "pitch", "yaw")
_ROTATION = ("x", "y", "z", "rx", "ry", "rz")


@dataclasses.dataclass(frozen=True, eq=False)
class ActionMap:
    """From a task's action to the robot's.

    Attributes:
      names: what each number moves. places: [n] number of the controller's action that it becomes.
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
        rest = jnp.broadcast_to(jnp.asarray(self.rest), (action.shape[0], len(self.rest)))
        return rest.at[:, self.places].set(jnp.clip(action, -1.0, 1.0) * self.scale)


def hand_actions(
    names: Sequence[str], hands: tuple[int, ...], closing: bool, period: float = ACTION_PERIOD
) -> ActionMap:
    """The action that moves these hands of a robot.

    Args:
      names: of the robot's action (`Controller.action_names`). hands: numbers among the robot's hands.
      closing: with a number for each hand that closes it. period: seconds of an action.

    Raises:
      EngineError: the robot has no such hands to move.
    """
    names = tuple(names)
    rest = np.zeros(len(names), np.float32)
    step = SPEED * period, TURN_SPEED * period
    if "right_hand_x" in names:
        sides = [("left_hand", "right_hand")[h] for h in hands]
        wanted = [[f"{s}_{n}" for n in (*_POSE, *(["trigger"] if closing else []))] for s in sides]
        scale = [step[0]] * 3 + [step[1]] * 3 + [1.0] * closing
    elif "eef_x" in names and hands == (0,):
        wanted = [[*(f"eef_{n}" for n in _ROTATION), *(["gripper"] if closing else [])]]
        scale = [1.0] * 3 + [FETCH_TURN] * 3 + [1.0] * closing
    else:
        raise EngineError(
            f"a robot with the actions {', '.join(names[:6])}, ... has no hands {hands} that a task moves"
        )
    if "gripper" in names and not closing:
        rest[names.index("gripper")] = 1.0  # open
    chosen = [name for hand in wanted for name in hand]
    places = np.array([names.index(name) for name in chosen])
    return ActionMap(tuple(chosen), places, np.array(scale * len(hands), np.float32), rest)


def whole_actions(names: Sequence[str], high: Float[np.ndarray, "n"]) -> ActionMap:
    """All numbers of a robot's action; 1 is its limit `high`."""
    return ActionMap(tuple(names), np.arange(len(names)), high.astype(np.float32), np.zeros(len(names), np.float32))


DRIVE = ("forward", "turn_left")
ARM = tuple(f"eef_{n}" for n in _ROTATION)


def robot_actions(names: Sequence[str], arm: bool = False, gripper: bool = False) -> ActionMap:
    """The robot's own numbers, -1 to 1, of its drive, and where they are wanted of its arm and gripper.

    Args:
      names: of the robot's action (`Controller.action_names`). What is not wanted stays as it is, the gripper open.

    Raises:
      EngineError: the robot does not drive, or has no arm.
    """
    names = tuple(names)
    wanted = (*DRIVE, *(ARM if arm else ()), *(("gripper",) if gripper else ()))
    missing = [name for name in wanted if name not in names]
    if missing:
        raise EngineError(f"a robot with the actions {', '.join(names[:6])} lacks {', '.join(missing)}")
    rest = np.zeros(len(names), np.float32)
    if "gripper" in names:
        rest[names.index("gripper")] = 1.0
    places = np.array([names.index(name) for name in wanted])
    return ActionMap(wanted, places, np.ones(len(wanted), np.float32), rest)
