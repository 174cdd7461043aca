"""Fetch's figures: frames, limits, masses and inertias of its maker's public description; drive and poses of iGibson.

Joints are in iGibson's order: right and left wheel, torso, head pan and
tilt, seven of the arm, right and left finger. The frames of all links are parallel at joint positions 0, x forward.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ig2mj.agents.kinematics import Chain


@dataclasses.dataclass(frozen=True)
class FetchJoint:
    """A joint and the link it moves.

    Attributes:
      name: of the joint. link, parent: of its link and the link that carries it.
      origin: m, in the parent's frame. axis: "x", "y", "z", or "-y". slides: prismatic.
      lower, upper: rad or m; equal where it turns without end.
      effort, velocity: limits; N or N m, m/s or rad/s. damping: N s/m or N m s.
      mass, com, inertia: of the link: kg; m; kg m^2 about the centre of mass (xx, xy, xz, yy, yz, zz).
      moved: kg or kg m^2 that its servo is made for, about what the joint moves with the arm stretched out (our own).
    """

    name: str
    link: str
    parent: str
    origin: tuple[float, float, float]
    axis: str
    slides: bool
    lower: float
    upper: float
    effort: float
    velocity: float
    damping: float
    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]
    moved: float

    @property
    def direction(self) -> np.ndarray:
        """Unit vector of the axis."""
        return np.eye(3)["xyz".index(self.axis[-1])] * (-1.0 if self.axis[0] == "-" else 1.0)


WHEEL_RADIUS, AXLE, MAX_WHEEL = 0.0613, 0.372, 17.4
"""m, m, rad/s."""

BASE = (70.1294, (-0.0036, 0.0, 0.0014), (1.225, 0.0099, 0.0062, 1.2853, -0.0034, 0.987))
TORSO = (13.2775, (-0.159075, 0.0057, 0.643025), (0.3861, 0.0015, -0.0102, 0.3388, 0.0117, 0.1018))
"""kg, m, kg m^2 of the base and of the column fixed to it, both in the base's frame."""

_WHEEL = {"axis": "y", "slides": False, "lower": 0.0, "upper": 0.0, "effort": 8.85, "velocity": 17.4, "damping": 0.0}
_WHEEL |= {"mass": 4.3542, "com": (0.0, 0.0, 0.0), "inertia": (0.0045, 0.0, 0.0, 0.005, 0.0, 0.0045), "moved": 0.3}
_FINGER = {"slides": True, "lower": 0.0, "upper": 0.05, "effort": 60.0, "velocity": 0.05, "damping": 100.0}
_FINGER |= {"mass": 0.0798, "com": (-0.01, 0.0, 0.0), "inertia": (2e-5, 0.0, 0.0, 3e-5, 0.0, 3e-5), "moved": 5.0}
_HEAD = {"slides": False, "velocity": 1.57, "damping": 0.1}

# fmt: off
JOINTS = (
    FetchJoint("r_wheel_joint", "r_wheel_link", "base_link", (0.0012914, -0.18738, 0.055325), **_WHEEL),
    FetchJoint("l_wheel_joint", "l_wheel_link", "base_link", (0.0012914, 0.18738, 0.055325), **_WHEEL),
    FetchJoint("torso_lift_joint", "torso_lift_link", "base_link", (-0.086875, 0.0, 0.37743), "z", True, 0.0, 0.38615,
          450.0, 0.1, 100.0, 10.7796, (-0.0013, -0.0009, 0.2935),
          (0.3354, 0.0, -0.0162, 0.3354, -0.0006, 0.0954), 30.0),
    FetchJoint("head_pan_joint", "head_pan_link", "torso_lift_link", (0.053125, 0.0, 0.603001), "z",
          lower=-1.57, upper=1.57, effort=0.32, mass=2.2556, com=(0.0321, 0.0161, 0.0390),
          inertia=(0.0129, 0.0002, 0.0007, 0.0095, 0.0, 0.0184), moved=0.05, **_HEAD),
    FetchJoint("head_tilt_joint", "head_tilt_link", "head_pan_link", (0.14253, 0.0, 0.057999), "y",
          lower=-0.76, upper=1.45, effort=0.68, mass=0.9087, com=(0.0081, 0.0025, 0.0113),
          inertia=(0.0061, 0.0, 0.0002, 0.0014, -0.0001, 0.0061), moved=0.05, **_HEAD),
    FetchJoint("shoulder_pan_joint", "shoulder_pan_link", "torso_lift_link", (0.119525, 0.0, 0.34858), "z", False,
          -1.6056, 1.6056, 33.82, 1.256, 1.0, 2.5587, (0.0927, -0.0056, 0.0564),
          (0.0043, -0.0001, 0.001, 0.0087, -0.0001, 0.0087), 2.5),
    FetchJoint("shoulder_lift_joint", "shoulder_lift_link", "shoulder_pan_link", (0.117, 0.0, 0.06), "y", False,
          -1.221, 1.518, 131.76, 1.454, 1.0, 2.6615, (0.1432, 0.0072, -0.0001),
          (0.0028, -0.0021, 0.0, 0.0111, 0.0, 0.0112), 2.5),
    FetchJoint("upperarm_roll_joint", "upperarm_roll_link", "shoulder_lift_link", (0.219, 0.0, 0.0), "x", False,
          0.0, 0.0, 76.94, 1.571, 5.0, 2.3311, (0.1165, 0.0014, 0.0),
          (0.0019, -0.0001, 0.0, 0.0045, 0.0, 0.0047), 0.8),
    FetchJoint("elbow_flex_joint", "elbow_flex_link", "upperarm_roll_link", (0.133, 0.0, 0.0), "y", False,
          -2.251, 2.251, 66.18, 1.521, 1.0, 2.1299, (0.1279, 0.0073, 0.0),
          (0.0024, -0.0016, 0.0, 0.0082, 0.0, 0.0084), 0.9),
    FetchJoint("forearm_roll_joint", "forearm_roll_link", "elbow_flex_link", (0.197, 0.0, 0.0), "x", False,
          0.0, 0.0, 29.35, 1.571, 5.0, 1.6563, (0.1097, -0.0266, 0.0),
          (0.0016, -0.0003, 0.0, 0.003, 0.0, 0.0035), 0.2),
    FetchJoint("wrist_flex_joint", "wrist_flex_link", "forearm_roll_link", (0.1245, 0.0, 0.0), "y", False,
          -2.16, 2.16, 25.7, 2.268, 1.0, 1.725, (0.0882, 0.0009, -0.0001),
          (0.0018, -0.0001, 0.0, 0.0042, 0.0, 0.0042), 0.25),
    FetchJoint("wrist_roll_joint", "wrist_roll_link", "wrist_flex_link", (0.1385, 0.0, 0.0), "x", False,
          0.0, 0.0, 7.36, 2.268, 5.0, 0.1354, (0.0095, 0.0004, -0.0002),
          (0.0001, 0.0, 0.0, 0.0001, 0.0, 0.0001), 0.05),
    FetchJoint("r_gripper_finger_joint", "r_gripper_finger_link", "gripper_link", (0.0, 0.015425, 0.0), "y", **_FINGER),
    FetchJoint("l_gripper_finger_joint", "l_gripper_finger_link", "gripper_link", (0.0, -0.015425, 0.0), "-y",
          **_FINGER),
)
# fmt: on
"""(The maker gives its fingers one axis of inertia only; theirs here are those of their shape.)"""

GRIPPER = (0.16645, 0.0, 0.0)
"""m: the gripper, which is the end effector, in the frame of the wrist's last link, to which it is fixed."""

GRIPPER_INERTIA = (1.5175, (-0.09, -0.0001, -0.0017), (0.0013, 0.0, 0.0, 0.0019, 0.0, 0.0024))

CAMERA = (0.055, 0.0, 0.0225)
"""m: in the frame of the tilting head."""

WHEELS, TRUNK, CAMERA_JOINTS, ARM, FINGERS = [0, 1], [2], [3, 4], [5, 6, 7, 8, 9, 10, 11], [12, 13]
"""Places of joints in `JOINTS`; `CHAIN` is the trunk and the arm."""

CHAIN_JOINTS = TRUNK + ARM


def _limits(joint: FetchJoint) -> tuple[float, float]:
    return (joint.lower, joint.upper) if joint.lower < joint.upper else (-np.inf, np.inf)


LOWER, UPPER = np.array([_limits(j) for j in JOINTS]).T
VELOCITY, EFFORT = np.array([(j.velocity, j.effort) for j in JOINTS]).T

SERVO_RATE = 30.0
"""1/s: natural frequency of the critically damped servos of trunk, head and arm."""

WHEEL_GAIN = 20.0
"""N m s of the wheels' velocity servos."""

STIFFNESS = np.array([0.0 if "wheel" in j.name else j.moved * SERVO_RATE**2 for j in JOINTS])
DAMPING = np.array([WHEEL_GAIN if "wheel" in j.name else 2 * j.moved * SERVO_RATE for j in JOINTS])
"""N m/rad and N m s/rad (N/m and N s/m) of the servos; without stiffness one follows velocities."""

CHAIN = Chain(
    origin=np.array([JOINTS[k].origin for k in CHAIN_JOINTS]),
    axis=np.stack([JOINTS[k].direction for k in CHAIN_JOINTS]),
    slides=np.array([JOINTS[k].slides for k in CHAIN_JOINTS]),
    lower=LOWER[CHAIN_JOINTS],
    upper=UPPER[CHAIN_JOINTS],
    tip=np.array(GRIPPER),
)

ARM_POSES = {
    "vertical": (-0.94121, -0.64134, 1.55186, 1.65672, -0.93218, 1.53416, 2.14474),
    "diagonal15": (-0.95587, -0.34778, 1.46388, 1.47821, -0.93813, 1.4587, 1.9939),
    "diagonal30": (-1.06595, -0.22184, 1.53448, 1.46076, -0.84995, 1.36904, 1.90996),
    "diagonal45": (-1.11479, -0.0685, 1.5696, 1.37304, -0.74273, 1.3983, 1.79618),
    "horizontal": (-1.43016, 0.20965, 1.86816, 1.77576, -0.27289, 1.31715, 2.01226),
    "tucked": (1.1707963, 1.4707963, -0.4, 1.6707963, 0.0, 1.5707963, 0.0),
}
"""rad: iGibson's poses of the arm."""

TRUNK_HEIGHT, TRUNK_TUCKED = 0.385, 0.02
"""m."""

CAMERA_TILT = 0.45
"""rad, downwards."""


def start_positions(pose: str, camera_tilt: float | None = None, camera_pan: float = 0.0) -> np.ndarray:
    """[14] joint positions of a pose of the arm, gripper open. `camera_tilt`, `camera_pan`: rad, down, left."""
    trunk, tilt = (TRUNK_TUCKED, 0.0) if pose == "tucked" else (TRUNK_HEIGHT, CAMERA_TILT)
    tilt = tilt if camera_tilt is None else camera_tilt
    return np.array([0.0, 0.0, trunk, camera_pan, tilt, *ARM_POSES[pose], 0.05, 0.05])
