"""URDFs made at random, with everything that real ones hold: all are converted, and their links are where MuJoCo's own
importer has them."""

from __future__ import annotations

import json
import pathlib
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_robot import convert_robot
from urdf_generator import write_random_urdf

from ig2mj.agents.urdf import UrdfRobot

VECTORS = 20
"""Joint positions at which links are compared."""


def elements(file: pathlib.Path) -> ElementTree.Element:
    """The URDF's, without its namespace."""
    text = file.read_text(encoding="utf-8-sig")
    return ElementTree.fromstring(text.replace(' xmlns="http://www.ros.org/urdf"', ""))


def skeleton(file: pathlib.Path) -> mujoco.MjModel:
    """The tree of a URDF alone, read by MuJoCo's importer: it takes no `package://`, byte-order mark or namespace."""
    root = elements(file)
    made = ElementTree.Element("robot", name="r")
    ElementTree.SubElement(ElementTree.SubElement(made, "mujoco"), "compiler", fusestatic="false")
    for link in root.iterfind("link"):
        inertial = ElementTree.SubElement(ElementTree.SubElement(made, "link", name=link.get("name", "")), "inertial")
        ElementTree.SubElement(inertial, "mass", value="1")
        ElementTree.SubElement(inertial, "inertia", ixx="1", iyy="1", izz="1", ixy="0", ixz="0", iyz="0")
    for joint in root.iterfind("joint"):
        for unused in [e for e in joint if e.tag in ("mimic", "limit", "dynamics")]:
            joint.remove(unused)
        made.append(joint)
    return mujoco.MjModel.from_xml_string(ElementTree.tostring(made, encoding="unicode"))


def locked(file: pathlib.Path) -> dict[str, float]:
    """Joints without room to move, and where they are."""
    root = elements(file)
    found = {}
    for joint in root.iterfind("joint"):
        limit = joint.find("limit")
        if limit is not None and joint.get("type") in ("revolute", "prismatic"):
            low, high = (float(limit.get(name, 0.0)) for name in ("lower", "upper"))
            if low == high:
                found[joint.get("name", "")] = low
    return found


def check_generated(folder: pathlib.Path, seed: int) -> None:
    file = write_random_urdf(folder, seed)
    out = folder / "out"
    options = ConvertOptions(report=False, cache=False, package_path=(file.parent.parent.parent,))
    convert_robot(file, out, options=options)
    robot = UrdfRobot.load(out)
    model, own = skeleton(file), mujoco.MjModel.from_xml_path(str(out / "object.xml"))
    frames = json.loads((out / "robot.json").read_text(encoding="utf-8"))["frames"]
    data, mine, rng = mujoco.MjData(model), mujoco.MjData(own), np.random.default_rng(seed)
    assert robot.name == f"robot_{seed}"
    root = elements(file)
    assert set(frames) == {link.get("name") for link in root.iterfind("link")}
    stated = sum(float(mass.get("value", 0)) for mass in root.iterfind("link/inertial/mass"))
    if stated > 0:  # nothing is invented for a robot, but what MuJoCo needs to move a body
        assert stated - 1e-4 <= own.body_mass[1:].sum() <= stated + 1.1e-3 * own.nbody
    for name, position in locked(file).items():
        data.joint(name).qpos[0] = position
    moving = [model.joint(j).name for j in range(model.njnt) if model.joint(j).name not in locked(file)]
    for _ in range(VECTORS):
        for name in moving:
            data.joint(name).qpos[0] = mine.joint(f"{robot.name}_{name}").qpos[0] = rng.uniform(-2, 2)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_kinematics(own, mine)
        for link, frame in frames.items():
            theirs = relative(data, "l0", link)
            ours = relative(mine, robot.name, f"{robot.name}_{frame['on']}" if frame["on"] != "l0" else robot.name)
            place = ours[0] + ours[1] @ np.array(frame["pos"])
            np.testing.assert_allclose(place, theirs[0], atol=1e-6, err_msg=f"seed {seed}, {link}")
            np.testing.assert_allclose(ours[1] @ np.array(frame["axes"]), theirs[1], atol=1e-5)


def relative(data: mujoco.MjData, base: str, body: str) -> tuple[np.ndarray, np.ndarray]:
    turn = data.body(base).xmat.reshape(3, 3).T
    return turn @ (data.body(body).xpos - data.body(base).xpos), turn @ data.body(body).xmat.reshape(3, 3)


@pytest.mark.parametrize("seed", range(20))
def test_a_generated_urdf_is_converted_and_its_links_are_where_mujoco_has_them(tmp_path, seed):
    check_generated(tmp_path, seed)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(20, 400, 20))
def test_many_generated_urdfs_are_converted_and_their_links_are_where_mujoco_has_them(tmp_path, first):
    for seed in range(first, first + 20):
        check_generated(tmp_path / str(seed), seed)
