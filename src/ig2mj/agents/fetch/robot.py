"""Fetch: a driving base, a trunk that lifts, a head with a camera, an arm of seven joints with a gripper.

Frames, masses and limits are those of its maker (`figures`), geometry is our own, of primitives. Gravity is compensated
from the trunk on, as the robot's own controllers do it. The base's frame is on the floor, x forward, z up.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.fetch.appearance import FetchMaterials, draw_link
from ig2mj.agents.fetch.controller import FetchController
from ig2mj.agents.fetch.figures import (
    ARM_POSES,
    BASE,
    CAMERA,
    DAMPING,
    GRIPPER,
    GRIPPER_INERTIA,
    JOINTS,
    STIFFNESS,
    TORSO,
    FetchJoint,
    start_positions,
)
from ig2mj.agents.fetch.proprioception import LISTS
from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.parts import (
    GEOM,
    Vector,
    collision,
    exclude_all,
    extend_keyframes,
    normalized,
    servo,
    set_inertia,
)
from ig2mj.agents.task_robot import HandControl, TaskRobot
from ig2mj.agents.wrist_cameras import RIGHT, add_wrist_camera
from ig2mj.errors import UnknownNameError
from ig2mj.scene.manifest import AgentEntry
from ig2mj.scene.tables import SceneTables

ROTOR_SHARE = 0.3
"""Inertia of motor and gear, as a share of what a servo is made for: the servo is stable in any pose of the arm."""

WHEEL_CONTACT = 0.0613
"""m: radius of the sphere with which a wheel meets the floor."""

FINGER_REACH, FINGER_EDGE, FINGER_FACE = 0.03, 0.0115, 0.0155
"""m: corners of the fingers' inner faces in their frames, where rays run (iGibson's, on its own fingers: 0.04, 0.014
and 0.012). Ours are 6 cm long, and the grasp point is in their middle, where the gripper's frame is."""

SPRUNG, SPRING = 0.01, 20.0
"""m by which springs press a wheel below where a rigid one would stand, and their stiffness in 1/s2 (MuJoCo's direct
`solref`), critically damped: a base whose wheels and casters are rigid stands on its casters at the edge of a carpet of
1 cm, its wheels without load. The robot itself drives over thresholds of 13 mm (ADA)."""

LIFTED = 0.007
"""m: of a pinned base above its place, so that its wheels do not touch the floor."""

CASTERS = ((0.16, 0.11), (0.16, -0.11), (-0.21, 0.11), (-0.21, -0.11))
"""m: where they stand in the base's frame."""

FIELD_OF_VIEW = 90.0
"""Degrees, vertical."""

LASER = (0.30, 0.0, 0.2878)
"""m: before the shell. The maker's laser_link is at 0.235, in a slot that our shell has not, and sees 220 degrees."""

WRIST_EYE, WRIST_LOOKS_AT = (-0.15, 0.0, 0.16), (0.07, 0.0, -0.01)
"""m, gripper's frame: the gripper's camera, on top of its housing, and a point before the fingers."""


HAND = HandControl(
    move=("eef_x", "eef_y", "eef_z"),
    turn=("eef_rx", "eef_ry", "eef_rz"),
    close="gripper",
    turn_scale=0.5,  # of 1 rad/s
    speed=0.4,  # a fifth of the way to a goal 0.2 m ahead in an action of 0.1 s
    rests_open=True,
)


@dataclasses.dataclass(frozen=True, eq=False)
class Fetch(TaskRobot):
    """The robot.

    Attributes:
      pos, quat: of its base on the floor.
      pose: of the arm at the start, which inverse kinematics keeps near; iGibson's names (`figures.ARM_POSES`).
      proprioception: "default", iGibson's 41 numbers, or "experiments", the 49 of its activities.
      camera_tilt: rad, downwards, at the start; None: iGibson's, 0.45, or 0 with a tucked arm.
      camera_pan: rad, to the left, at the start.
      pinned: the base stays where it is, as in iGibson's experiments with an arm alone, which hold it with a constraint
        of 10 kN.
    """

    name: str = "fetch"
    pos: Vector = (0, 0, 0)
    quat: Vector = (1, 0, 0, 0)
    pose: str = "diagonal30"
    proprioception: str = "default"
    camera_tilt: float | None = None
    camera_pan: float = 0.0
    pinned: bool = False

    drives = True
    hand_controls = (HAND,)

    def __post_init__(self) -> None:
        if self.pose not in ARM_POSES:
            raise UnknownNameError("pose of Fetch's arm", self.pose, ARM_POSES)
        if self.proprioception not in LISTS:
            raise UnknownNameError("proprioception of Fetch", self.proprioception, LISTS)

    def for_activity(self, *, drives: bool, camera_tilt: float | None, camera_pan: float) -> Fetch:
        """With the proprioception of iGibson's experiments, pinned as there unless it drives."""
        return dataclasses.replace(
            self, proprioception="experiments", pinned=not drives, camera_tilt=camera_tilt, camera_pan=camera_pan
        )

    def attach(self, spec: mujoco.MjSpec, pos: Vector | None = None, quat: Vector | None = None) -> AgentEntry:
        pos, quat = self.pos if pos is None else pos, normalized(self.quat if quat is None else quat)
        lifted = [*pos[:2], pos[2] + LIFTED * self.pinned]
        base = spec.worldbody.add_body(name=self.name, pos=lifted, quat=list(quat))
        if not self.pinned:
            base.add_freejoint(name=f"{self.name}/free")
        set_inertia(base, *_joined(BASE, TORSO))
        look = FetchMaterials.of(spec, self.name)
        draw_link(base, "base_link", look)
        for x, y in CASTERS:
            collision(base, GEOM.mjGEOM_SPHERE, (0.03,), 0, (x, y, 0.0245), frictionless=True)
        links, start = {"base_link": base}, start_positions(self.pose, self.camera_tilt, self.camera_pan)
        for joint, q in zip(JOINTS, start, strict=True):
            links[joint.link] = self._add_link(spec, links[joint.parent], joint, float(q), look)
            if joint.link == "wrist_roll_link":
                gripper = links[joint.link].add_body(name=f"{self.name}_gripper_link", pos=list(GRIPPER), gravcomp=1)
                set_inertia(gripper, *GRIPPER_INERTIA)
                draw_link(gripper, "gripper_link", look)
                links["gripper_link"] = gripper
        links["head_tilt_link"].add_camera(
            name=f"{self.name}/eye", pos=list(CAMERA), quat=[0.5, 0.5, -0.5, -0.5], fovy=FIELD_OF_VIEW
        )
        wrist = add_wrist_camera(links["gripper_link"], self.name, RIGHT, WRIST_EYE, WRIST_LOOKS_AT, (0.0, 0.0, 1.0))
        exclude_all(spec, [body.name for body in links.values()])
        controls = [0.0, 0.0, *start[2:]]
        free = [] if self.pinned else [*map(float, pos), *map(float, quat)]
        extend_keyframes(spec, [*free, *start], 6 * (not self.pinned) + len(JOINTS), controls)
        return AgentEntry(
            name=self.name,
            body=self.name,
            camera=f"{self.name}/eye",
            fingers=[f"{self.name}_{side}_gripper_finger_link" for side in "rl"],
            hands=[f"{self.name}_gripper_link"],
            assisted=True,
            laser=LASER,
            wrist_cameras={RIGHT: wrist},
        )

    def _add_link(
        self, spec: mujoco.MjSpec, parent: mujoco.MjsBody, joint: FetchJoint, q: float, look: FetchMaterials
    ) -> mujoco.MjsBody:
        """The link at joint position `q`, which is the joint's reference; its servo."""
        kind, turned = mujoco.mjtJoint, np.array([1.0, 0.0, 0.0, 0.0])
        place = np.array(joint.origin)
        if joint.slides:
            place = place + joint.direction * q
        else:
            mujoco.mju_axisAngle2Quat(turned, joint.direction, q)
        wheel = "wheel" in joint.name
        body = parent.add_body(
            name=f"{self.name}_{joint.link}", pos=list(place), quat=list(turned), gravcomp=0 if wheel else 1
        )
        set_inertia(body, joint.mass, joint.com, joint.inertia)
        unit = np.rad2deg(1.0) if spec.compiler.degree and not joint.slides else 1.0  # MjSpec: the compiler's unit
        limited = joint.lower < joint.upper
        name = f"{self.name}_{joint.name}"
        rotor = 0.02 if wheel else ROTOR_SHARE * joint.moved
        body.add_joint(
            name=name,
            type=kind.mjJNT_SLIDE if joint.slides else kind.mjJNT_HINGE,
            axis=list(joint.direction),
            ref=q * unit,
            range=[joint.lower * unit, joint.upper * unit] if limited else [0, 0],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE if limited else mujoco.mjtLimited.mjLIMITED_FALSE,
            armature=rotor,
            damping=joint.damping if "head" not in joint.name else 0.0,
        )
        short = name.removesuffix("_joint")
        number = JOINTS.index(joint)
        servo(spec, name, float(STIFFNESS[number]), float(DAMPING[number]), joint.effort, name=short)
        if wheel:
            collision(body, GEOM.mjGEOM_SPHERE, (WHEEL_CONTACT + SPRUNG * (not self.pinned),), friction=1.0)
            if not self.pinned:
                body.geoms[-1].solref, body.geoms[-1].priority = [-SPRING, -2 * SPRING**0.5], 1
        draw_link(body, joint.link, look)
        return body

    def hand_rays(self) -> tuple[HandRays, ...]:
        """Sixteen rays from corners of the right finger to corners of the left one."""
        corners = np.array([(x, 0.0, z) for x in (-FINGER_REACH, FINGER_REACH) for z in (-FINGER_EDGE, FINGER_EDGE)])
        inward = np.array([0.0, FINGER_FACE, 0.0])
        right, left = (f"{self.name}_{side}_gripper_finger_link" for side in "rl")
        return (
            HandRays(
                palm=f"{self.name}_gripper_link",
                grasp_point=np.zeros(3),
                start_bodies=(right,) * 4,
                starts=corners - inward,
                end_bodies=(left,) * 4,
                ends=corners + inward,
            ),
        )

    def controller(self, tables: SceneTables, agent: int, period: float = ACTION_PERIOD) -> FetchController:
        return FetchController(
            tables, agent, period, start_positions(self.pose, self.camera_tilt, self.camera_pan), self.proprioception
        )


Inertia = tuple[float, tuple[float, ...], tuple[float, ...]]


def _joined(*parts: Inertia) -> Inertia:
    """Mass, centre and inertia (xx, xy, xz, yy, yz, zz) of parts whose centres are given in one frame."""
    total = sum(mass for mass, _, _ in parts)
    centre = np.sum([mass * np.array(com) for mass, com, _ in parts], axis=0) / total
    tensor = np.zeros((3, 3))
    for mass, com, (xx, xy, xz, yy, yz, zz) in parts:
        arm = np.array(com) - centre
        tensor += np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        tensor += mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return total, tuple(centre.tolist()), tuple(tensor[np.triu_indices(3)].tolist())
