"""What Fetch looks like and collides with: primitives of our own on its maker's frames."""

from __future__ import annotations

import dataclasses

import mujoco

from ig2mj.agents.parts import GEOM, collision, material, visual

SPHERE, CAPSULE, CYLINDER = GEOM.mjGEOM_SPHERE, GEOM.mjGEOM_CAPSULE, GEOM.mjGEOM_CYLINDER
BOX, ELLIPSOID = GEOM.mjGEOM_BOX, GEOM.mjGEOM_ELLIPSOID

FINGER_FRICTION = 2.5
"""iGibson uses 500, with which contacts in MuJoCo never slip."""

FINGER_HALF, FINGER_Y = (0.032, 0.0065, 0.0125), 0.0085
"""m: half size of a finger, and how far its middle is from its frame, inwards: closed fingers are 1 mm apart."""


@dataclasses.dataclass(frozen=True)
class FetchMaterials:
    """Names of materials."""

    white: str
    grey: str
    blue: str
    dark: str

    @classmethod
    def of(cls, spec: mujoco.MjSpec, name: str) -> FetchMaterials:
        return cls(
            material(spec, f"{name}/white", (0.93, 0.93, 0.94), 0.7, 0.5),
            material(spec, f"{name}/grey", (0.36, 0.36, 0.38), 0.5, 0.4),
            material(spec, f"{name}/blue", (0.09, 0.46, 0.74), 0.7, 0.5),
            material(spec, f"{name}/dark", (0.08, 0.08, 0.09), 0.4, 0.4),
        )


def draw_link(body: mujoco.MjsBody, link: str, look: FetchMaterials) -> None:
    """Adds a link's collision and visual geoms to its body."""
    DRAWINGS[link](body, look)


def _base(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    collision(body, CYLINDER, (0.275,), 0, (0, 0, 0.06), end=(0, 0, 0.35), friction=0.25)
    collision(body, BOX, (0.105, 0.155, 0.20), 0, (-0.155, 0, 0.56), friction=0.25)
    visual(body, CYLINDER, (0.268,), look.grey, (0, 0, 0.035), end=(0, 0, 0.19))
    visual(body, CYLINDER, (0.262,), look.dark, (0, 0, 0.19), end=(0, 0, 0.235))  # the laser's slit
    visual(body, CYLINDER, (0.272,), look.grey, (0, 0, 0.235), end=(0, 0, 0.325))
    visual(body, ELLIPSOID, (0.272, 0.272, 0.04), look.grey, (0, 0, 0.325))
    visual(body, CYLINDER, (0.276,), look.blue, (0, 0, 0.295), end=(0, 0, 0.303))
    visual(body, CYLINDER, (0.035,), look.dark, (0.225, 0, 0.20), end=(0.225, 0, 0.228))
    visual(body, BOX, (0.10, 0.15, 0.20), look.blue, (-0.155, 0, 0.55))  # the fixed column
    visual(body, CAPSULE, (0.05,), look.blue, (-0.205, -0.10, 0.36), end=(-0.205, -0.10, 0.72))
    visual(body, CAPSULE, (0.05,), look.blue, (-0.205, 0.10, 0.36), end=(-0.205, 0.10, 0.72))
    visual(body, CYLINDER, (0.020,), look.blue, (-0.125, 0.215, 0.34), end=(-0.125, 0.215, 0.372))


def _wheel(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    visual(body, CYLINDER, (0.0605,), look.dark, (0, -0.02, 0), end=(0, 0.02, 0))
    visual(body, CYLINDER, (0.035,), look.blue, (0, -0.022, 0), end=(0, 0.022, 0))


def _torso(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    collision(body, BOX, (0.095, 0.14, 0.17), 0, (0.0, 0, 0.43), friction=0.25)
    visual(body, BOX, (0.075, 0.115, 0.21), look.dark, (-0.03, 0, 0.14))  # bellows
    visual(body, BOX, (0.085, 0.125, 0.13), look.white, (0.0, 0, 0.42))
    visual(body, CAPSULE, (0.085,), look.white, (0.0, -0.055, 0.52), end=(0.0, 0.055, 0.52))
    visual(body, CYLINDER, (0.085,), look.white, (0.1195, 0, 0.27), end=(0.1195, 0, 0.352))
    visual(body, BOX, (0.06, 0.085, 0.041), look.white, (0.06, 0, 0.311))
    visual(body, CYLINDER, (0.045,), look.dark, (0.053, 0, 0.55), end=(0.053, 0, 0.606))
    visual(body, BOX, (0.055, 0.05, 0.03), look.white, (0.03, 0, 0.56))


def _head_pan(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    collision(body, BOX, (0.11, 0.125, 0.06), 0, (0.07, 0, 0.06), friction=0.25)
    visual(body, CYLINDER, (0.06,), look.grey, (0.0, 0, 0.0), end=(0.0, 0, 0.035))
    visual(body, ELLIPSOID, (0.115, 0.105, 0.045), look.grey, (0.055, 0, 0.045))
    for side in (-1, 1):
        visual(body, CAPSULE, (0.026,), look.grey, (0.06, 0.095 * side, 0.045), end=(0.1425, 0.115 * side, 0.058))


def _head_tilt(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    visual(body, CAPSULE, (0.036,), look.blue, (0, -0.078, 0.0), end=(0, 0.078, 0.0))
    visual(body, BOX, (0.018, 0.09, 0.018), look.dark, (0.033, 0, 0.0225))
    for y in (-0.045, 0.02, 0.045):
        visual(body, CYLINDER, (0.009,), look.grey, (0.050, y, 0.0225), end=(0.0535, y, 0.0225))


def _tube(radius: float, length: float, colour: str, from_x: float = 0.0):
    """An arm link along x: a tube with a rounded joint at its beginning."""

    def draw(body: mujoco.MjsBody, look: FetchMaterials) -> None:
        collision(body, CAPSULE, (radius,), 0, (from_x, 0, 0), end=(length - radius, 0, 0), friction=0.5)
        visual(body, CAPSULE, (radius,), getattr(look, colour), (from_x, 0, 0), end=(length - radius, 0, 0))

    return draw


def _elbow(radius: float, length: float, colour: str):
    """An arm link along x that turns about y: a disc across, then a tube."""

    def draw(body: mujoco.MjsBody, look: FetchMaterials) -> None:
        own = getattr(look, colour)
        collision(body, CAPSULE, (radius,), 0, (0, 0, 0), end=(length - radius, 0, 0), friction=0.5)
        visual(body, CYLINDER, (radius * 1.08,), own, (0, -radius * 1.02, 0), end=(0, radius * 1.02, 0))
        visual(body, CYLINDER, (radius * 0.7,), look.dark, (0, -radius * 1.06, 0), end=(0, radius * 1.06, 0))
        visual(body, CAPSULE, (radius * 0.9,), own, (0, 0, 0), end=(length - radius * 0.6, 0, 0))

    return draw


def _shoulder_pan(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    collision(body, CAPSULE, (0.065,), 0, (0, 0, 0.045), end=(0.117, 0, 0.06), friction=0.5)
    visual(body, CYLINDER, (0.078,), look.white, (0, 0, 0.0), end=(0, 0, 0.075))
    visual(body, ELLIPSOID, (0.078, 0.078, 0.025), look.white, (0, 0, 0.075))
    visual(body, CAPSULE, (0.055,), look.white, (0, 0, 0.045), end=(0.09, 0, 0.06))


def _wrist_roll(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    visual(body, CYLINDER, (0.036,), look.white, (-0.01, 0, 0), end=(0.03, 0, 0))


def _gripper(body: mujoco.MjsBody, look: FetchMaterials) -> None:
    collision(body, BOX, (0.045, 0.06, 0.035), 0, (-0.085, 0, 0), friction=0.5)
    visual(body, BOX, (0.035, 0.058, 0.030), look.dark, (-0.080, 0, 0))
    visual(body, ELLIPSOID, (0.055, 0.062, 0.036), look.grey, (-0.098, 0, 0))
    visual(body, CYLINDER, (0.030,), look.grey, (-0.140, 0, 0), end=(-0.11, 0, 0))
    visual(body, BOX, (0.006, 0.066, 0.012), look.blue, (-0.045, 0, 0))


def _finger(sign: float):
    def draw(body: mujoco.MjsBody, look: FetchMaterials) -> None:
        middle = -sign * FINGER_Y
        collision(body, BOX, FINGER_HALF, 0, (0, middle, 0), friction=FINGER_FRICTION)
        visual(body, BOX, FINGER_HALF, look.grey, (0, middle, 0))
        visual(body, BOX, (0.020, 0.003, 0.010), look.dark, (0.006, middle - sign * 0.0042, 0))
        visual(body, BOX, (0.010, 0.010, 0.010), look.dark, (-0.040, middle + sign * 0.004, 0))

    return draw


DRAWINGS = {
    "base_link": _base,
    "r_wheel_link": _wheel,
    "l_wheel_link": _wheel,
    "torso_lift_link": _torso,
    "head_pan_link": _head_pan,
    "head_tilt_link": _head_tilt,
    "shoulder_pan_link": _shoulder_pan,
    "shoulder_lift_link": _elbow(0.062, 0.219, "blue"),
    "upperarm_roll_link": _tube(0.056, 0.133, "white"),
    "elbow_flex_link": _elbow(0.058, 0.197, "blue"),
    "forearm_roll_link": _tube(0.050, 0.1245, "white"),
    "wrist_flex_link": _elbow(0.052, 0.1385, "blue"),
    "wrist_roll_link": _wrist_roll,
    "gripper_link": _gripper,
    "r_gripper_finger_link": _finger(1.0),
    "l_gripper_finger_link": _finger(-1.0),
}
"""Link -> what draws it."""
