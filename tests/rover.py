"""A small robot's URDF for tests: a differential drive with a caster, an arm of three joints, a gripper, a camera.

It is of primitives; the right wheel's axis points the other way than the left one's, as in many descriptions.
"""

from __future__ import annotations

import pathlib


def _link(name: str, mass: float, moment: float, shape: str = "", origin: str = "0 0 0") -> str:
    geometry = f'<origin xyz="{origin}"/><geometry>{shape}</geometry>'
    drawn = f"<visual>{geometry}</visual><collision>{geometry}</collision>" if shape else ""
    inertia = f'<inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/>'
    inertial = f'<inertial><origin xyz="{origin}"/><mass value="{mass}"/>{inertia}</inertial>'
    return f'<link name="{name}">{inertial}{drawn}</link>'


def _joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str = "0 0 1", limit: str = "") -> str:
    limits = f"<limit {limit}/>" if limit else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/>{limits}</joint>'
    )


WHEEL = '<sphere radius="0.06"/>'
MOTOR = 'effort="4" velocity="12"'
ARM = 'effort="30" velocity="2"'
FINGER = 'lower="0" upper="0.04" effort="40" velocity="0.1"'

PARTS = (
    _link("base_link", 8, 0.12, '<box size="0.4 0.28 0.12"/>', "0 0 0.12"),
    _link("left_wheel", 0.5, 0.001, WHEEL),
    _link("right_wheel", 0.5, 0.001, WHEEL),
    _joint("left_wheel_joint", "continuous", "base_link", "left_wheel", "0.1 0.16 0.06", "0 1 0", MOTOR),
    _joint("right_wheel_joint", "continuous", "base_link", "right_wheel", "0.1 -0.16 0.06", "0 -1 0", MOTOR),
    _link("caster", 0.2, 0.0001, '<sphere radius="0.03"/>'),
    _joint("caster_joint", "fixed", "base_link", "caster", "-0.15 0 0.03"),
    _link("shoulder", 1, 0.004, '<box size="0.05 0.05 0.2"/>', "0 0 0.1"),
    _joint("shoulder_pan", "revolute", "base_link", "shoulder", "0.1 0 0.18", "0 0 1", f'lower="-2" upper="2" {ARM}'),
    _link("upper", 0.8, 0.006, '<box size="0.3 0.05 0.05"/>', "0.15 0 0"),
    _joint("lift", "revolute", "shoulder", "upper", "0 0 0.22", "0 -1 0", f'lower="-1.5" upper="1.5" {ARM}'),
    _link("hand", 0.3, 0.001, '<box size="0.04 0.12 0.04"/>'),
    _joint("wrist", "revolute", "upper", "hand", "0.34 0 0", "1 0 0", f'lower="-3" upper="3" {ARM}'),
    _link("left_finger", 0.05, 0.0001, '<box size="0.08 0.012 0.02"/>', "0.04 0.006 0"),
    _link("right_finger", 0.05, 0.0001, '<box size="0.08 0.012 0.02"/>', "0.04 -0.006 0"),
    _joint("left_finger_joint", "prismatic", "hand", "left_finger", "0.02 0 0", "0 1 0", FINGER),
    _joint("right_finger_joint", "prismatic", "hand", "right_finger", "0.02 0 0", "0 -1 0", FINGER),
    '<link name="camera_link"/>',
    _joint("camera_joint", "fixed", "base_link", "camera_link", "0.18 0 0.3"),
    '<link name="laser_link"/>',
    _joint("laser_joint", "fixed", "base_link", "laser_link", "0.21 0 0.1"),
)

URDF = f'<robot name="rover">{"".join(PARTS)}</robot>'


def write_rover(folder: pathlib.Path) -> pathlib.Path:
    """Its URDF in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "rover.urdf"
    file.write_text(URDF, encoding="utf-8")
    return file
