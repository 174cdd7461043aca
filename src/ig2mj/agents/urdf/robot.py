"""`UrdfRobot`: a robot of one's own in a scene, from a URDF or an MJCF file.

    from ig2mj_converters.convert_robot import convert_robot

    convert_robot("my_robot.urdf", "my_robot")                       # once; or: ig2mj convert robot
    env = ig2mj.make("PointNavigation", robot="my_robot")            # the folder

Bodies, shapes and masses are those of the file. Every motor is a servo with the file's limits of force and speed;
gravity is compensated but for the base, as robots' own controllers do it, and links of the robot do not collide with
each other. An omnidirectional base glides on wheels without friction, pushed by three velocity servos in its own frame.
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
from ig2mj.agents.parts import (
    GEOM,
    Vector,
    collision,
    exclude_all,
    extend_keyframes,
    material,
    multiply,
    normalized,
    servo,
    visual,
)
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.agents.urdf.adding import add_robot
from ig2mj.agents.urdf.assignment import find_layout, raised
from ig2mj.agents.urdf.base_motion import glide
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.controller import UrdfController
from ig2mj.agents.urdf.description import Description
from ig2mj.agents.urdf.grip import hand_rays, with_closed_limits
from ig2mj.agents.urdf.layout import OMNIDIRECTIONAL, Layout
from ig2mj.agents.urdf.layout_file import read_entries
from ig2mj.agents.urdf.wrists import wrist_views
from ig2mj.agents.wrist_cameras import add_wrist_camera
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

SERVO_RATE = 25.0
"""1/s: natural frequency of the critically damped servos of arms."""

ROTOR_SHARE = 0.3
"""Inertia of motor and gear, as a share of what the joint moves; larger where the servo is stiffer (`GIVES`)."""

GIVES, GIVES_SLIDING = 0.3, 0.05
"""rad and m by which a joint of an arm gives at most under all its motor's force: light arms hold loads, too."""

SLIP = 0.2
"""Share of a wheel's largest speed that it is behind when its motor pushes with all its force."""

SQUEEZE, GRIP_RATE = 0.5, 60.0
"""Share of a finger's way by which it is behind when it presses with all its force; 1/s: natural frequency of its
servo, which a step of 1/120 s must follow."""

MOST_PRESSED = 100.0
"""N at the end of a finger: a Panda's press with 70 N, a Robotiq 2F-85's with 235 N. Files often give a number that
stands for any, with which fingers would press what they hold out of the hand."""

WHEEL_RATE = 100.0
"""1/s: how fast a wheel's servo may change its speed, at most."""

FRICTION = 1.0
"""Sliding friction of wheels and fingers."""

FIELD_OF_VIEW = 90.0
"""Degrees, vertical."""

FROM_LINK, FROM_OPTICAL = (0.5, 0.5, -0.5, -0.5), (0.0, 1.0, 0.0, 0.0)
"""From a camera's link (x forward, z up), and from its optical frame (z forward, y down), to MuJoCo's camera frame."""

OPTICAL = "optical"
"""In the name of a link whose z axis points forward."""

LAYOUT_FILES = ("layout.toml", "layout.json")
"""In a converted robot's folder: what corrects its layout."""

GLIDE_RATE = 10.0
"""1/s: how fast an omnidirectional base reaches the speed that it is to have."""

SUCTION_FORCE = 40.0
"""N with which a suction cup of 4 cm across holds at a fifth of an atmosphere less than outside."""

SHOULDER_HEIGHT = 0.8
"""m above the floor of an arm's first joint in activities: furniture is 0.4 to 0.95 m high."""

PEDESTAL = (0.06, 0.25)
"""m: least and largest half width of a pedestal."""


@dataclasses.dataclass(frozen=True, eq=False)
class UrdfRobot(TaskRobot):
    """A robot of one's own in a scene, from the folder that `ig2mj convert robot` wrote of a URDF or an MJCF file.

    Every motor is a servo with the file's limits of force and speed.

    Attributes:
      folder: what the converter wrote. name: of the agent; the converted robot's, or another.
      description, layout: what it is. pos, quat: of its base; z is the floor that it, or its pedestal, stands on.
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
          layout: file, or entries as in one (`ig2mj.agents.urdf.layout`); None: the folder's own `layout.toml`, and
            what that does not say is found (`ig2mj.agents.urdf.assignment`).
          name: of the agent; None: the robot's.

        Raises:
          InputError: a file is missing or broken, or the robot has legs. UnknownNameError: the layout names what the
            robot does not have.
        """
        path = pathlib.Path(folder)
        description = Description.load(path)
        if layout is None:
            layout = own_layout(path)
        if layout is None or isinstance(layout, Mapping):
            given, where = layout, "layout"
        else:
            given, where = read_entries(layout), str(layout)
        body = RobotBody(path, description)
        found = find_layout(description, body, given, where)
        body.check(found)
        whole = raised(body, with_closed_limits(body, found))
        return cls(path, name or description.name, description, whole, compiled=body)

    @functools.cached_property
    def body(self) -> RobotBody:
        """Its bodies and joints, compiled alone."""
        return RobotBody(self.folder, self.description) if self.compiled is None else self.compiled

    @property
    def drives(self) -> bool:
        """It can go somewhere."""
        return self.layout.drives

    @property
    def hand_count(self) -> int:
        return len(self.layout.hands)

    def for_activity(self, *, drives: bool, camera_tilt: float | None, camera_pan: float) -> UrdfRobot:
        """An arm that is bolted down, and has no `mount` of its own, stands on a pedestal that brings its first joint
        to `SHOULDER_HEIGHT`."""
        if self.drives or self.layout.mount is not None or not self.layout.arm:
            return self
        shoulder = min(self.body.hub(name)[2] for name in self.layout.arm) + self.body.standing(self.layout)
        mount = round(max(SHOULDER_HEIGHT - shoulder, 0.0), 3)
        return dataclasses.replace(self, layout=dataclasses.replace(self.layout, mount=mount))

    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        pos = np.array(self.pos if pos is None else pos, np.float64)
        standing, mount = self.body.standing(self.layout), 0.0 if self.drives else self.layout.mount or 0.0
        pos[2] += standing + mount
        quat, layout = normalized(self.quat if quat is None else quat), self.layout
        bodies = add_robot(self.body, spec, self.name, pos, quat, fixed=not self.drives, layout=layout)
        fingers = self.finger_links
        for link, body in bodies.items():
            body.gravcomp = 0.0 if link == self.description.base or link in self._rolling else 1.0
            if link in self._rolling or link in fingers:
                for geom in body.geoms:
                    geom.friction[0] = max(float(geom.friction[0]), FRICTION)
                    if layout.base == OMNIDIRECTIONAL and link in self._rolling:
                        geom.condim, geom.priority = 1, 1
        if mount:
            self._add_pedestal(spec, bodies[self.description.base], standing, mount)
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
            forward = FROM_OPTICAL if OPTICAL in layout.camera.lower() else FROM_LINK
            bodies[link].add_camera(
                name=camera, pos=list(place), quat=list(multiply(turn, forward)), fovy=FIELD_OF_VIEW
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
            wrist_cameras=self._add_wrist_cameras(bodies),
        )

    def _add_wrist_cameras(self, bodies: Mapping[str, mujoco.MjsBody]) -> dict[str, str]:
        """On the hands farthest to the right and to the left at the start; on a single one, the right camera."""
        views = wrist_views(self.body, self.layout, self.holding, self.name)
        return {
            wrist: add_wrist_camera(bodies[view.link], self.name, wrist, view.eye, view.at, view.up)
            for wrist, view in views.items()
        }

    @property
    def holding(self) -> tuple[str, ...]:
        """Links that hold something, as the scene numbers them: those with rays, else all hands."""
        frames, palms = self.description.frames, {hand.palm for hand in self.hand_rays()}
        named = [(frames[link].on, self.body_name(frames[link].on)) for link in self.layout.hands]
        holding = [link for link, body in named if body in palms]
        return tuple(dict.fromkeys(holding or [link for link, _ in named]))

    def body_name(self, link: str) -> str:
        """Of a link that moves, or the base, in a scene."""
        return self.name if link == self.description.base else f"{self.name}_{link}"

    @property
    def finger_links(self) -> list[str]:
        """Links that press on what a hand holds: fingers, the fixed jaw of a gripper with one, palms of suction."""
        body, found = self.body, []
        for gripper in self.layout.grippers:
            links = body.fingers(gripper)
            found += [*links, *([body.frame(gripper.hand)[0]] if sum(map(body.shapes.has_shape, links)) == 1 else [])]
        found += [body.frame(link)[0] for link in self.layout.suction]
        return list(dict.fromkeys(found))

    @property
    def _rolling(self) -> list[str]:
        """Links that roll on the floor."""
        joints = self.description.joints
        named = [self.description.joint(name).child for name in self.layout.wheels]
        turning = [j.child for j in joints if j.type == "continuous" and j.name not in self.layout.arm]
        return list(dict.fromkeys((*named, *turning)))

    def _add_pedestal(self, spec: mujoco.MjSpec, base: mujoco.MjsBody, standing: float, mount: float) -> None:
        """A box from the floor to the underside of a base that is bolted to it."""
        centre, half = self.body.shapes.box(self.description.base)
        wide = float(np.clip(max(half[:2]), *PEDESTAL))
        size, pos = (wide, wide, mount / 2), (float(centre[0]), float(centre[1]), -standing - mount / 2)
        collision(base, GEOM.mjGEOM_BOX, size, 0.0, pos)
        visual(base, GEOM.mjGEOM_BOX, size, material(spec, f"{self.name}/pedestal", (0.32, 0.34, 0.37)), pos)

    def _tune(self, joint: mujoco.MjsJoint, name: str) -> None:
        """Friction and rotor of a joint: the converter's are those of doors and drawers. Passive joints keep theirs."""
        if self.description.joint(name).passive:
            return
        joint.frictionloss, joint.damping[:] = 0.0, 0.0
        if name in self.layout.arm:
            joint.armature = self._gains(name)[0] / SERVO_RATE**2 - self.body.moved(name)
        elif name in self.layout.gripper:
            joint.armature = max(self._gains(name)[0] / GRIP_RATE**2 - self.body.moved(name), 0.0)
        elif name in self.layout.wheels and self.layout.base != OMNIDIRECTIONAL:
            joint.armature = self._gains(name)[1] / WHEEL_RATE

    def _add_servos(self, spec: mujoco.MjSpec) -> list[float]:
        """Servos of the base or its wheels, of arm, gripper and suction, in this order; their controls at the start."""
        controls, layout = [], self.layout
        if layout.base == OMNIDIRECTIONAL:
            controls += self._add_glide(spec)
        for name in (*(layout.wheels if layout.base != OMNIDIRECTIONAL else ()), *layout.arm, *layout.gripper):
            servo(spec, f"{self.name}_{name}", *self._gains(name), self._force(name))
            controls.append(0.0 if name in layout.wheels else self.body.start_of(name, layout))
        for link in layout.suction:
            added = spec.add_actuator(
                name=f"{self.name}_{link}_suction",
                target=self.body_name(self.body.frame(link)[0]),
                trntype=mujoco.mjtTrn.mjTRN_BODY,
                gaintype=mujoco.mjtGain.mjGAIN_FIXED,
                ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
                ctrlrange=[0.0, 1.0],
            )
            added.gainprm[0] = SUCTION_FORCE
            controls.append(0.0)
        return controls

    def _add_glide(self, spec: mujoco.MjSpec) -> list[float]:
        """Velocity servos of the base, forwards, to the left and about the vertical, in its own frame."""
        base, centre = spec.body(self.name), self.body.centre
        site = f"{self.name}/glide"
        base.add_site(name=site, pos=[0.0, 0.0, float(centre[2])], rgba=[0.0] * 4, size=[1e-3] * 3)
        speed, turn, force = glide(self.body, self.layout)
        for axis, name, inertia, most in (
            (0, "forward", self.body.mass, force),
            (1, "left", self.body.mass, force),
            (5, "turn_left", self.body.yaw_inertia(), force * speed / turn),
        ):
            gain = inertia * GLIDE_RATE
            added = spec.add_actuator(
                name=f"{site}_{name}",
                target=site,
                trntype=mujoco.mjtTrn.mjTRN_SITE,
                gaintype=mujoco.mjtGain.mjGAIN_FIXED,
                biastype=mujoco.mjtBias.mjBIAS_AFFINE,
                forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
                forcerange=[-most, most],
            )
            added.gainprm[0], added.biasprm[2] = gain, -gain
            added.gear[:] = 0.0
            added.gear[axis] = 1.0
        return [0.0, 0.0, 0.0]

    def _force(self, name: str) -> float:
        """N m or N of a joint's motor; fingers press with `MOST_PRESSED` at their ends at most."""
        joint = self.description.joint(name)
        if name not in self.layout.gripper:
            return joint.force
        lever = self.body.lever(name) if joint.type != "prismatic" else 1.0
        return min(joint.force, MOST_PRESSED * lever)

    def _gains(self, name: str) -> tuple[float, float]:
        """Stiffness and damping of a joint's servo."""
        joint = self.description.joint(name)
        if name in self.layout.wheels:
            return 0.0, joint.force / (SLIP * joint.speed)
        if name in self.layout.gripper:
            low, high = self.body.limits(name)
            stiffness = self._force(name) / (SQUEEZE * (high - low))
            return stiffness, 2 * stiffness / GRIP_RATE
        moved = (1 + ROTOR_SHARE) * self.body.moved(name)
        gives = GIVES_SLIDING if joint.type == "prismatic" else GIVES
        stiffness = max(moved * SERVO_RATE**2, joint.force / gives)
        return stiffness, 2 * stiffness / SERVO_RATE

    def hand_rays(self) -> tuple[HandRays, ...]:
        """See `ig2mj.agents.urdf.grip`; in the order of `holding`."""
        return hand_rays(self.name, self.body, self.layout)

    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> UrdfController:
        return UrdfController(tables, agent, period, self.description, self.layout, self.body, self.holding)


def own_layout(folder: pathlib.Path) -> pathlib.Path | None:
    """The file in a converted robot's folder that corrects its layout."""
    return next((file for name in LAYOUT_FILES if (file := folder / name).is_file()), None)
