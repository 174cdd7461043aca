"""`TaskRobot`: the base class of robots that tasks place, move and label; and what a task knows of a hand.

Tasks, experts, environments and the command line ask a robot for the members below and never for its name, so that a
robot is one class and one line in `ig2mj.agents.registry`.
"""

from __future__ import annotations

import abc
import dataclasses
import math
from typing import Any, ClassVar, TypeVar

import mujoco

from ig2mj.agents.base import ACTION_PERIOD, Controller
from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.parts import Vector
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

Own = TypeVar("Own", bound="TaskRobot")


@dataclasses.dataclass(frozen=True)
class HandControl:
    """The numbers of a controller's action that move one hand, and what experts know of its fingers.

    Attributes:
      move, turn: names of the numbers along and about x, y and z of the base's frame. close: of the one that closes it.
      move_scale, turn_scale: those numbers at 1 of a task's action (`ig2mj.tasks.actions`): a displacement (m, rad) in
        each second where `displaces`, else a velocity as a fraction of the controller's largest.
      speed: m/s of the hand at 1 of a task's action.
      opens: value of `close` that opens the hand, 1 or -1. rests_open: `close` is `opens` where a task does not close
        hands; else 0.
      opens_high: finger joints are open at their upper limits, not at their lower ones.
      closed_empty: how far the finger joints close without an object between them, 0 to 1.
      on_arm: an arm carries it, so that its reach and orientation depend on the base; else it floats.
      two_fingers: two parallel fingers at +-y of its frame, whose x axis points ahead.
    """

    move: tuple[str, str, str]
    turn: tuple[str, str, str]
    close: str
    move_scale: float = 1.0
    turn_scale: float = 1.0
    displaces: bool = False
    speed: float = 0.5
    opens: float = 1.0
    rests_open: bool = False
    opens_high: bool = True
    closed_empty: float = 0.9
    on_arm: bool = True
    two_fingers: bool = True


class TaskRobot(abc.ABC):
    """A robot that tasks know. Derived classes are frozen dataclasses with at least the fields `name`, `pos`, `quat`.

    Attributes:
      stands: m of `pos` above the floor on which the robot stands.
      drives: it has the actions "forward" and "turn_left" of navigation tasks.
      hand_lifts: kg that one of its hands lifts and carries; infinite: not known.
      hand_controls: of the hands that tasks can move, in the order of the scene's hands.
      own_actions: tasks give it every number of its controller, not only hands and drive.
    """

    name: Any
    pos: Any
    quat: Any
    stands: ClassVar[float] = 0.0
    drives: Any = False
    own_actions: ClassVar[bool] = False
    hand_lifts: ClassVar[float] = math.inf
    hand_controls: ClassVar[tuple[HandControl, ...]] = ()

    @property
    def hand_count(self) -> int:
        """Number of hands with which it can take hold of objects."""
        return len(self.hand_controls)

    def at(self: Own, x: float, y: float, yaw: float, z: float | None = None) -> Own:
        """The same robot at another start: `pos` in m, yaw in rad; `z` None: standing on the floor at height 0."""
        pos = (x, y, self.stands if z is None else z)
        return dataclasses.replace(self, pos=pos, quat=(math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))  # pyright: ignore

    def for_activity(self: Own, *, drives: bool, camera_tilt: float | None, camera_pan: float) -> Own:
        """The same robot as it takes part in activities of the paper.

        Args:
          drives: its base is free to move. camera_tilt, camera_pan: rad, downwards and to the left, of a camera that
            turns; None: the robot's own.
        """
        del drives, camera_tilt, camera_pan
        return self

    @abc.abstractmethod
    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        """See `ig2mj.agents.base.Robot`."""

    @abc.abstractmethod
    def hand_rays(self) -> tuple[HandRays, ...]:
        """See `ig2mj.agents.base.Robot`."""

    @abc.abstractmethod
    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> Controller:
        """See `ig2mj.agents.base.Robot`."""
