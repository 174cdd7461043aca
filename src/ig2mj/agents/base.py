"""The protocols of robots and their controllers.

A robot adds its bodies to a scene before it is compiled; its controller turns actions into MuJoCo controls.

    scene = load_scene("birch", agents=[FloatingHand(pos=(0, 0, 1))])
    controller = FloatingHand().controller(scene.tables, agent=0)
    state = controller.initial(num_worlds)
    ctrl, state = controller.control(action, view, state)      # pure and batched: may be jitted and scanned

Axes: W worlds, n numbers of an action, m numbers of proprioception, U actuators of the agent, H hands of the agent.
"""

from __future__ import annotations

import dataclasses
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.parts import Vector
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

ACTION_PERIOD = 0.1
"""Seconds between two actions: three control steps (appendix of the paper)."""


@dataclasses.dataclass(frozen=True)
class HandReading:
    """Where in `proprioception` a hand is described. A controller may list one for each hand, `hand_readings`.

    Attributes:
      holds: the number that says whether the hand holds something, above one half or not.
      pose: the first of six numbers: x, y, z (m) and roll, pitch, yaw (rad) of the hand in the frame of the robot's
        base; None: there are none.
    """

    holds: int
    pose: int | None = None


ControllerState = Any
"""State of a controller between steps: a pytree of arrays whose first axis is the worlds."""


@runtime_checkable
class Controller(Protocol):
    """Actions and proprioception of one agent of a scene. All methods are pure, batched and traceable by JAX.

    Attributes:
      action_names: [n] what each number of an action means.
      action_low, action_high: [n] limits; actions beyond them are clipped.
      proprioception_names: [m] what each number of `proprioception` means.
      agent: its number in the scene's tables.
      moves_eye: `eye` depends on more than the view.
    """

    agent: int
    moves_eye: bool
    action_names: tuple[str, ...]
    action_low: Float[np.ndarray, "n"]
    action_high: Float[np.ndarray, "n"]
    proprioception_names: tuple[str, ...]

    @property
    def action_size(self) -> int:
        """n."""
        ...

    def initial(self, num_worlds: int) -> ControllerState:
        """The state of controllers whose agents stand at their start."""
        ...

    def control(
        self, action: Float[Array, "W n"], view: PhysicsView, state: ControllerState
    ) -> tuple[Float[Array, "W U"], ControllerState]:
        """Controls of the agent's actuators, in the order of the model. Called once per action, which they hold for.

        Args:
          action: clipped to the limits.
          view: of the present physics.
          state: as returned by the last call.
        """
        ...

    def grip(self, state: ControllerState) -> Float[Array, "W H"]:
        """How far each hand is asked to close: 0 open, 1 closed. From one half on it grasps (paper, appendix A.1)."""
        ...

    def lag(self, view: PhysicsView, state: ControllerState) -> Float[Array, "W H"]:
        """Tracking error of each hand in metres; a large value means an overload or an obstacle."""
        ...

    def eye(self, view: PhysicsView, state: ControllerState) -> tuple[Float[Array, "W 3"], Float[Array, "W 4"]]:
        """Pose of the agent's camera in the world (MuJoCo's camera axes). Engines know the compiled camera only. If
        an agent moves its camera without joints (`moves_eye`), the core puts this pose into views."""
        ...

    def proprioception(self, view: PhysicsView, state: ControllerState) -> Float[Array, "W m"]:
        """Proprioception of the agent."""
        ...


@runtime_checkable
class Robot(Protocol):
    """Something that acts: adds its bodies to a scene and makes the controller for them.

    Attributes:
      name: of the agent; prefix of its bodies, joints and actuators. Unique in a scene.
    """

    @property
    def name(self) -> str: ...

    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        """Adds the robot's bodies to a scene that is not compiled yet.

        Args:
          spec: of the scene; changed in place.
          pos, quat: where it starts, world frame, m and w-x-y-z; None: the robot's own start.

        Returns:
          What was added, for the manifest.
        """
        ...

    def hand_rays(self) -> tuple[HandRays, ...]:
        """Rays of each hand for assistive grasping, in the order of the hands in the manifest's entry."""
        ...

    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> Controller:
        """The controller of this robot, compiled into the scene of these tables as agent number `agent`.

        Args:
          period: seconds between two calls of `control`.
        """
        ...
