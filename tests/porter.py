"""A mobile manipulator's URDF for tests: a differential drive, a lift, an arm of seven joints, and a gripper that opens
12 cm. It is of primitives."""

from __future__ import annotations

import pathlib

from rover import _joint, _link

WHEEL = '<sphere radius="0.08"/>'
MOTOR = 'effort="20" velocity="12"'
LIFT = 'lower="0" upper="0.5" effort="800" velocity="0.3"'
STRONG, WEAK = 'effort="120" velocity="1.5"', 'effort="40" velocity="2"'
BEND, TURN = 'lower="-2.6" upper="2.6"', 'lower="-3.1" upper="3.1"'
FINGER = 'lower="0" upper="0.06" effort="60" velocity="0.1"'
START = {"carriage_joint": 0.2, "shoulder_joint": -1.7, "elbow_joint": 2.5, "wrist_joint": -0.8}
"""rad and m of a folded arm."""


def _arm() -> list[str]:
    """Pan, and pairs of a bend and a turn, as arms of seven joints have them."""
    parts, below = [], "carriage"
    joints = [
        ("pan", "0.2 0 0.1", "0 0 1", TURN, STRONG, 0.1),
        ("shoulder", "0.08 0 0.06", "0 1 0", BEND, STRONG, 0.2),
        ("upper_roll", "0.2 0 0", "1 0 0", TURN, STRONG, 0.14),
        ("elbow", "0.14 0 0", "0 1 0", BEND, STRONG, 0.18),
        ("fore_roll", "0.18 0 0", "1 0 0", TURN, WEAK, 0.14),
        ("wrist", "0.14 0 0", "0 1 0", BEND, WEAK, 0.1),
        ("hand_roll", "0.1 0 0", "1 0 0", TURN, WEAK, 0.08),
    ]
    for name, at, axis, limits, motor, length in joints:
        parts += [
            _link(name, 1.2, 0.002, f'<box size="{length} 0.07 0.07"/>', f"{length / 2} 0 0"),
            _joint(f"{name}_joint", "revolute", below, name, at, axis, f"{limits} {motor}"),
        ]
        below = name
    return parts


PARTS = (
    _link("base_link", 30, 1.0, '<cylinder radius="0.24" length="0.25"/>', "0 0 0.17"),
    _link("left_wheel", 1, 0.003, WHEEL),
    _link("right_wheel", 1, 0.003, WHEEL),
    _joint("left_wheel_joint", "continuous", "base_link", "left_wheel", "0 0.2 0.08", "0 1 0", MOTOR),
    _joint("right_wheel_joint", "continuous", "base_link", "right_wheel", "0 -0.2 0.08", "0 1 0", MOTOR),
    *(_link(f"{n}_caster", 0.3, 0.0002, '<sphere radius="0.03"/>') for n in ("front", "rear")),
    _joint("front_caster_joint", "fixed", "base_link", "front_caster", "0.18 0 0.03"),
    _joint("rear_caster_joint", "fixed", "base_link", "rear_caster", "-0.18 0 0.03"),
    _link("column", 8, 0.3, '<box size="0.12 0.16 0.6"/>', "0 0 0.3"),
    _joint("column_joint", "fixed", "base_link", "column", "-0.1 0 0.3"),
    _link("carriage", 4, 0.03, '<box size="0.12 0.16 0.1"/>', "0.12 0 0"),
    _joint("carriage_joint", "prismatic", "column", "carriage", "0 0 0.25", "0 0 1", LIFT),
    *_arm(),
    _link("hand", 0.4, 0.001, '<box size="0.05 0.16 0.05"/>', "0.025 0 0"),
    _joint("hand_joint", "fixed", "hand_roll", "hand", "0.08 0 0"),
    _link("left_finger", 0.08, 0.0001, '<box size="0.07 0.014 0.024"/>', "0.035 0.007 0"),
    _link("right_finger", 0.08, 0.0001, '<box size="0.07 0.014 0.024"/>', "0.035 -0.007 0"),
    _joint("left_finger_joint", "prismatic", "hand", "left_finger", "0.05 0 0", "0 1 0", FINGER),
    _joint("right_finger_joint", "prismatic", "hand", "right_finger", "0.05 0 0", "0 -1 0", FINGER),
    '<link name="camera_link"/>',
    _joint("camera_joint", "fixed", "column", "camera_link", "0.08 0 0.62"),
)


def write_porter(folder: pathlib.Path) -> pathlib.Path:
    """Its URDF in a folder, with a layout file that starts it with a folded arm."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "porter.urdf"
    file.write_text(f'<robot name="porter">{"".join(PARTS)}</robot>', encoding="utf-8")
    lines = [f"{name} = {value}" for name, value in START.items()]
    (folder / "layout.toml").write_text("\n".join(["[start]", *lines, ""]), encoding="utf-8")
    return file
