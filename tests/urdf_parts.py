"""Pieces of robots' URDFs for tests: links that are boxes, joints, a gripper, wheels."""

from __future__ import annotations

import pathlib

from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_robot import convert_robot

INERTIA = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'


def link(name: str, size: str = "0.05 0.05 0.05", mass: float = 0.5) -> str:
    shape = f'<geometry><box size="{size}"/></geometry>'
    inertial = f'<inertial><mass value="{mass}"/>{INERTIA}</inertial>'
    return f'<link name="{name}">{inertial}<visual>{shape}</visual><collision>{shape}</collision></link>'


def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str, inside: str = "") -> str:
    limit = "" if kind == "continuous" else '<limit lower="0" upper="0.04" effort="20" velocity="0.2"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
        f'<axis xyz="{axis}"/>{inside or limit}</joint>'
    )


def follows(leader: str, multiplier: float = 1.0, offset: float = 0.0, lower: float = -1, upper: float = 1) -> str:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="20" velocity="0.2"/>'
    return f'{limit}<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def gripper(side: str, parent: str, at: str) -> list[str]:
    """A hand on a lift, with a finger and one that follows it."""
    hand, one, two = f"{side}hand", f"{side}left_finger", f"{side}right_finger"
    return [
        link(hand, "0.06 0.2 0.04"),
        link(one, "0.02 0.01 0.06", 0.05),
        link(two, "0.02 0.01 0.06", 0.05),
        joint(f"{side}lift", "prismatic", parent, hand, at, "0 0 1",
              '<limit lower="0" upper="0.3" effort="200" velocity="0.5"/>'),
        joint(f"{side}finger_1", "prismatic", hand, one, "0 0.005 0.05", "0 1 0"),
        joint(f"{side}finger_2", "prismatic", hand, two, "0 -0.005 0.05", "0 -1 0",
              follows(f"{side}finger_1", lower=0, upper=0.04)),
    ]  # fmt: skip


def converted(folder: pathlib.Path, *parts: str, name: str = "arm") -> pathlib.Path:
    """A robot of these parts on a base, converted."""
    file = folder / "robot.urdf"
    file.write_text(f'<robot name="{name}">{link("base", "0.2 0.2 0.2", 5)}{"".join(parts)}</robot>', encoding="utf-8")
    convert_robot(file, folder / "out", options=ConvertOptions(report=False))
    return folder / "out"


def wheel(name: str, xyz: str) -> list[str]:
    turned = '<origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.06" length="0.02"/></geometry>'
    body = f'<link name="{name}"><inertial><mass value="0.2"/><inertia ixx="0.001" iyy="0.001" izz="0.001"/></inertial>'
    body += f"<visual>{turned}</visual><collision>{turned}</collision></link>"
    return [body, joint(f"{name}_joint", "continuous", "base", name, xyz, "0 1 0")]
