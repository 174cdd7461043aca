"""`UrdfRobot`: a robot of one's own in a scene.

    from ig2mj_converters.convert_robot import convert_robot

    convert_robot("my_robot.urdf", "my_robot")                       # once; or: ig2mj convert robot
    env = ig2mj.make("PointNavigation", robot=UrdfRobot.load("my_robot"))

Bodies, shapes and masses are those of the URDF. Every motor is a servo with the URDF's limits of force and speed;
gravity is compensated but for the base, as robots' own controllers do it, and links of the robot do not collide with
each other.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.parts import Vector, exclude_all, extend_keyframes, multiply, normalized, servo
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.controller import UrdfController
from ig2mj.agents.urdf.description import Description
from ig2mj.agents.urdf.grip import gripper_rays, with_closed_limits
from ig2mj.agents.urdf.layout import Layout
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

SERVO_RATE = 25.0
"""1/s: natural frequency of the critically damped servos of arms."""

ROTOR_SHARE = 0.3
"""Inertia of motor and gear, as a share of what the joint moves."""

SLIP = 0.2
"""Share of a wheel's largest speed that it is behind when its motor pushes with all its force."""

SQUEEZE, GRIP_RATE = 0.5, 60.0
"""Share of a finger's way by which it is behind when it presses with all its force; 1/s: natural frequency of its
servo, which a step of 1/120 s must follow."""

WHEEL_RATE = 100.0
"""1/s: how fast a wheel's servo may change its speed, at most."""

FRICTION = 1.0
"""Sliding friction of wheels and fingers."""

FIELD_OF_VIEW = 90.0
"""Degrees, vertical."""

FROM_LINK = (0.5, 0.5, -0.5, -0.5)
"""From a camera's link (x forward, z up) to MuJoCo's camera frame."""


@dataclasses.dataclass(frozen=True, eq=False)
class UrdfRobot(TaskRobot):
    """See the module's text.

    Attributes:
      folder: what the converter wrote. name: of the agent; the converted robot's, or another.
      description, layout: what it is. pos, quat: of its base; z is the floor that it stands on.
      compiled: `body`, where it is compiled already.
    """

    folder: pathlib.Path
    name: str
    description: Description
    layout: Layout
    pos: Vector = (0, 0, 0)
    quat: Vector = (1, 0, 0, 0)
    compiled: RobotBody | None = dataclasses.field(default=None, repr=False)

    own_actions = True

    @classmethod
    def load(
        cls,
        folder: str | os.PathLike,
        layout: str | os.PathLike | Mapping[str, Any] | None = None,
        name: str | None = None,
    ) -> UrdfRobot:
        """A converted robot.

        Args:
          layout: file, or entries as in one (`ig2mj.agents.urdf.layout`); None: found from names of joints.
          name: of the agent; None: the robot's.

        Raises:
          InputError: a file is missing or broken. UnknownNameError: the layout names what the robot does not have.
        """
        path = pathlib.Path(folder)
        description = Description.load(path)
        if layout is None or isinstance(layout, Mapping):
            found = Layout.found(description, layout)
        else:
            found = Layout.load(description, layout)
        robot = cls(path, name or description.name, description, found)
        body = robot.body
        body.check(found)
        return dataclasses.replace(robot, layout=with_closed_limits(body, found), compiled=body)

    @functools.cached_property
    def body(self) -> RobotBody:
        """Its bodies and joints, compiled alone."""
        return RobotBody(self.folder, self.description) if self.compiled is None else self.compiled

    @property
    def drives(self) -> bool:
        """It can go somewhere."""
        return self.layout.base == "differential"

    @property
    def hand_count(self) -> int:
        return len(self.layout.hands)

    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        pos = np.array(self.pos if pos is None else pos, np.float64)
        pos[2] += self.body.height
        quat, layout = normalized(self.quat if quat is None else quat), self.layout
        bodies = self.body.add_to(spec, self.name, pos, quat, fixed=not self.drives, layout=layout)
        fingers = [link for gripper in layout.grippers for link in self.body.fingers(gripper)]
        for link, body in bodies.items():
            body.gravcomp = 0.0 if link == self.description.base or link in self._rolling else 1.0
            if link in self._rolling or link in fingers:
                for geom in body.geoms:
                    geom.friction[0] = FRICTION
        exclude_all(spec, [body.name for body in bodies.values()])
        for joint in self.description.joints:
            self._tune(spec.joint(f"{self.name}_{joint.name}"), joint.name)
        controls = self._add_servos(spec)
        start = self.body.start(layout)
        free = [*pos, *quat] if self.drives else []
        extend_keyframes(spec, [*free, *start], len(start) + (6 if self.drives else 0), controls)
        frames, camera = self.description.frames, None
        if layout.camera is not None:
            camera = f"{self.name}/eye"
            link, place, turn = self.body.frame(layout.camera)
            bodies[link].add_camera(
                name=camera, pos=list(place), quat=list(multiply(turn, FROM_LINK)), fovy=FIELD_OF_VIEW
            )
        laser = None
        if layout.laser is not None and frames[layout.laser].on == self.description.base:
            laser = frames[layout.laser].pos
        return AgentEntry(
            name=self.name,
            body=self.name,
            camera=camera,
            fingers=[bodies[link].name for link in fingers],
            hands=[bodies[link].name for link in self.holding],
            assisted=len(self.hand_rays()) > 0,
            laser=laser,
        )

    @property
    def holding(self) -> tuple[str, ...]:
        """Links that hold something, as the scene numbers them: those of grippers with two fingers, else all hands."""
        frames = self.description.frames
        gripping = [g.hand for g in self.layout.grippers if gripper_rays(self.name, self.body, g) is not None]
        return tuple(dict.fromkeys(frames[link].on for link in gripping or self.layout.hands))

    @property
    def _rolling(self) -> list[str]:
        """Links that roll on the floor."""
        joints = self.description.joints
        return [j.child for j in joints if j.type == "continuous" and j.name not in self.layout.arm]

    def _tune(self, joint: mujoco.MjsJoint, name: str) -> None:
        """Friction and rotor of a joint: the converter's are those of doors and drawers."""
        joint.frictionloss, joint.damping[:] = 0.0, 0.0
        if name in self.layout.arm:
            joint.armature = ROTOR_SHARE * self.body.moved(name)
        elif name in self.layout.gripper:
            joint.armature = max(self._gains(name)[0] / GRIP_RATE**2 - self.body.moved(name), 0.0)
        elif name in self.layout.wheels:
            joint.armature = self._gains(name)[1] / WHEEL_RATE

    def _add_servos(self, spec: mujoco.MjSpec) -> list[float]:
        """Servos of wheels, arm and gripper, in this order; their controls at the start."""
        controls = []
        for name in (*self.layout.wheels, *self.layout.arm, *self.layout.gripper):
            servo(spec, f"{self.name}_{name}", *self._gains(name), self.description.joint(name).force)
            controls.append(0.0 if name in self.layout.wheels else self.body.start_of(name, self.layout))
        return controls

    def _gains(self, name: str) -> tuple[float, float]:
        """Stiffness and damping of a joint's servo."""
        joint = self.description.joint(name)
        if name in self.layout.wheels:
            return 0.0, joint.force / (SLIP * joint.speed)
        if name in self.layout.gripper:
            low, high = self.body.limits(name)
            stiffness = joint.force / (SQUEEZE * (high - low))
            return stiffness, 2 * stiffness / GRIP_RATE
        moved = (1 + ROTOR_SHARE) * self.body.moved(name)
        return moved * SERVO_RATE**2, 2 * moved * SERVO_RATE

    def hand_rays(self) -> tuple[HandRays, ...]:
        """Of each gripper from corners of one finger to corners of another; none of one with fewer than two fingers."""
        rays = [gripper_rays(self.name, self.body, gripper) for gripper in self.layout.grippers]
        return tuple({hand.palm: hand for hand in rays if hand is not None}.values())

    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> UrdfController:
        return UrdfController(tables, agent, period, self.description, self.layout, self.body, self.holding)
