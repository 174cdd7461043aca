"""What the planner knows of the arms of each kind of controller: their joints, postures, and the numbers of an action.

An arm of another controller is a class here and one line of `KINDS`.

Axes: W worlds, J joints of the arm, n numbers of an action.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.agents.base import ACTION_PERIOD, Controller
from ig2mj.agents.fetch.controller import AHEAD, EASE, GAIN, POSTURE, FetchController
from ig2mj.agents.fetch.figures import CHAIN, CHAIN_JOINTS, VELOCITY
from ig2mj.agents.fetch.robot import HAND
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.agents.urdf.controller import UrdfArm, UrdfController
from ig2mj.planning.arm_model import ArmModel
from ig2mj.scene.scene import Scene

Places = Callable[..., Any]
"""Where numbers of these names are in an action."""


class ArmKind(abc.ABC):
    """See the module's text.

    Attributes:
      joints: names, without the robot's. climbs: the robot's base passes over what is as low as a carpet.
      tucked, carry: m, grasp point of an empty hand at rest, pointing ahead, and of one that carries something, base's
        frame; None: as the arm begins. carrying: greatest commands of driving and turning while something is held;
        None: as for every base. drawn: inverse kinematics draw the arm to its posture at rest in every agent step.
    """

    joints: Sequence[str]
    climbs = drawn = False
    tucked: tuple[float, float, float] | None = None
    carry: tuple[float, float, float] | None = None
    carrying: tuple[float, float] | None = None

    @abc.abstractmethod
    def model(self, joints: Int[np.ndarray, "J"]) -> ArmModel:
        """`joints`: numbers of the arm's joints among those of all robots."""

    @abc.abstractmethod
    def write(
        self,
        action: Float[np.ndarray, "W n"],
        places: Places,
        moves: Bool[np.ndarray, "W"],
        by: tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "W 3"]],
        model: ArmModel,
        q: Float[np.ndarray, "W Q"] | None,
    ) -> None:
        """Writes the numbers of an action that move the arm.

        Args:
          moves: worlds in which the hand moves. by: m and rad (rotation vector) by which it is to move and turn in this
            agent step, base's frame. q: of all robots' joints.
        """


class FetchArmKind(ArmKind):
    """Fetch's: the action has the gripper's displacement. So tucked, no link is farther from the axis than the base
    is; a hand that carries turns to where it takes hold, with its arm no farther to the sides. What is heavy is lost
    where a base turns faster than `carrying`: a hand 0.7 m from the axis is at 0.4 m/s then."""

    joints = (
        *("torso_lift_joint", "shoulder_pan_joint", "shoulder_lift_joint", "upperarm_roll_joint", "elbow_flex_joint"),
        *("forearm_roll_joint", "wrist_flex_joint", "wrist_roll_joint"),
    )
    climbs = drawn = True
    tucked, carry = (0.22, 0.12, 0.95), (0.42, 0.1, 1.15)
    carrying = (0.3, 0.1)

    def __init__(self, controller: FetchController):
        self._controller = controller

    def model(self, joints: Int[np.ndarray, "J"]) -> ArmModel:
        """See `ArmKind.model`."""
        rest, speed = self._controller.rest[CHAIN_JOINTS], VELOCITY[CHAIN_JOINTS]
        return ArmModel(CHAIN, joints, rest, EASE, speed, (AHEAD, GAIN * ACTION_PERIOD), POSTURE)

    def write(
        self,
        action: Float[np.ndarray, "W n"],
        places: Places,
        moves: Bool[np.ndarray, "W"],
        by: tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "W 3"]],
        model: ArmModel,
        q: Float[np.ndarray, "W Q"] | None,
    ) -> None:
        """See `ArmKind.write`."""
        scale = self._controller.stretch * GAIN * ACTION_PERIOD
        action[:, places(*HAND.move)] = np.clip(by[0] / scale[:3], -1.0, 1.0)
        action[:, places(*HAND.turn)] = np.clip(by[1] / scale[3:], -1.0, 1.0)


class UrdfArmKind(ArmKind):
    """That of a robot from a URDF: the action has the speeds of joints, which the arm's model computes."""

    def __init__(self, arm: UrdfArm):
        self._arm, self.joints = arm, tuple(arm.names)

    def model(self, joints: Int[np.ndarray, "J"]) -> ArmModel:
        """See `ArmKind.model`."""
        arm = self._arm
        return ArmModel(arm.chain, joints, arm.rest, np.ones(len(joints)), arm.speed, (1.0, 1.0), 0.0)

    def write(
        self,
        action: Float[np.ndarray, "W n"],
        places: Places,
        moves: Bool[np.ndarray, "W"],
        by: tuple[Float[np.ndarray, "W 3"], Float[np.ndarray, "W 3"]],
        model: ArmModel,
        q: Float[np.ndarray, "W Q"] | None,
    ) -> None:
        """See `ArmKind.write`."""
        assert q is not None
        own = q[:, model.joints]
        new = np.asarray(model.step(jnp.asarray(own, jnp.float32), jnp.asarray(by[0]), jnp.asarray(by[1])))
        asked = np.where(moves[:, None], (new - own) / (self._arm.speed * ACTION_PERIOD), 0.0)
        action[:, places(*self.joints)] = np.clip(asked, -1.0, 1.0)


def _of_urdf(controller: UrdfController) -> ArmKind | None:
    arm = controller.arms[0] if controller.arms else None
    return None if arm is None else UrdfArmKind(arm)


KINDS: Mapping[type, Callable[[Any], ArmKind | None]] = {FetchController: FetchArmKind, UrdfController: _of_urdf}
"""By class of the controller; None: the robot has no arm."""


def arm_of(scene: Scene, controller: Controller, agent: int) -> tuple[ArmKind, ArmModel] | None:
    """The arm of a robot; None: it has none with a hand, or its controller moves it in no known way."""
    tables, name = scene.tables, scene.tables.agent_names[agent]
    hands = np.flatnonzero(tables.hand_agent == agent)
    kind = next((make(controller) for known, make in KINDS.items() if isinstance(controller, known)), None)
    if len(hands) != 1 or kind is None:
        return None
    names = [f"{name}_{joint}" for joint in kind.joints]
    model = kind.model(np.array([tables.agent_joint_names.index(n) for n in names]))
    robot = scene.agents[agent]
    assert isinstance(robot, TaskRobot)
    data = scene.start_data()
    q = np.array([data.qpos[scene.model.joint(n).qposadr[0]] for n in names])
    mujoco.mj_kinematics(scene.model, data)
    palm, base = int(tables.hand_body[hands[0]]), scene.model.body(name).id
    model.calibrate(data, base, palm, np.asarray(robot.hand_rays()[0].grasp_point, float), q)
    return kind, model
