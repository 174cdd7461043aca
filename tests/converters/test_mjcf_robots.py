"""Robots of MJCF keep their images and what ties their parts to each other; grippers are mounted on arms."""

from __future__ import annotations

import pathlib

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_robot import convert_robot
from ig2mj_converters.reading.mjcf_grippers import Mounting
from PIL import Image

from ig2mj.agents.urdf import UrdfRobot
from ig2mj.cli import call
from ig2mj.errors import InputError, UnknownNameError

EQ = mujoco.mjtEq

ARM = """<mujoco model="arm">
<compiler angle="radian"/>
<worldbody><body name="foot">
  <geom type="box" size="0.1 0.1 0.05" pos="0 0 0.05" mass="4"/>
  <body name="upper" pos="0 0 0.1"><joint name="pan" axis="0 0 1" range="-2 2"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" mass="1"/>
    <body name="fore" pos="0 0 0.3"><joint name="lift" axis="0 1 0" range="-1.5 1.5"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.025" mass="0.8"/>
      <site name="attachment_site" pos="0.3 0 0" euler="0 1.5707963 0"/>
      <body name="end" pos="0.3 0 0"/>
</body></body></body></worldbody>
<actuator><position joint="pan" kp="100"/><position joint="lift" kp="100"/></actuator>
<keyframe><key name="home" qpos="0.3 0.2"/></keyframe>
</mujoco>"""

GRIPPER = """<mujoco model="two fingers">
<compiler angle="degree"/><option timestep="0.001" cone="elliptic"/>
<worldbody><geom type="plane" size="1 1 0.1"/><body name="mount">{free}
  <geom type="box" size="0.02 0.05 0.01" mass="0.1"/>
  <body name="one" pos="0 0.01 0.04"><joint name="one" type="slide" axis="0 1 0" range="0 0.03"/>
    <geom type="box" size="0.01 0.004 0.03" mass="0.02"/></body>
  <body name="two" pos="0 -0.01 0.04"><joint name="two" type="slide" axis="0 -1 0" range="0 0.03"/>
    <geom type="box" size="0.01 0.004 0.03" mass="0.02"/></body>
</body></worldbody>
<equality><joint joint1="two" joint2="one"/></equality>
<actuator><position joint="one" kp="300" ctrlrange="0 0.03"/></actuator>
<keyframe><key name="open" qpos="0.03 0.03"/></keyframe>
</mujoco>"""

TIED = """<mujoco model="tied">
<compiler angle="radian"/>
<worldbody><body name="foot" pos="0 0 0.1">
  <geom type="box" size="0.1 0.1 0.05" mass="4"/>
  <body name="a" pos="0.2 0 0" euler="0.1 0.2 0.3"><joint name="a" axis="0 1 0" pos="0 0 0.02"/>
    <geom size="0.02" mass="0.1"/>
    <body name="fixed_to_a" pos="0.05 0.01 0" euler="0 0.4 0"><geom size="0.01" mass="0.1"/></body></body>
  <body name="b" pos="0.3 0 0"><joint name="b" axis="0 1 0"/><joint name="b2" type="slide" axis="1 0 0"/>
    <geom size="0.02" mass="0.1"/></body>
</body></worldbody>
<tendon><fixed name="t"><joint joint="a" coef="0.5"/><joint joint="b2" coef="-2"/></fixed>
<fixed name="u"><joint joint="b" coef="1"/></fixed></tendon>
<equality>
  <weld body1="fixed_to_a" body2="b" anchor="0.01 0.02 0.03" torquescale="0.7"/>
  <tendon tendon1="t" tendon2="u" polycoef="0.1 0.5 0 0 0"/>
  <connect body1="a" body2="b" anchor="0.05 0 0"/>
</equality>
</mujoco>"""


def converted(folder: pathlib.Path, text: str, **options) -> pathlib.Path:
    (folder / "robot.xml").write_text(text, encoding="utf-8")
    convert_robot(folder / "robot.xml", folder / "out", options=ConvertOptions(report=False), **options)
    return folder / "out"


def written(folder: pathlib.Path, text: str, name: str = "gripper.xml") -> pathlib.Path:
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_welds_and_connections_hold_as_in_the_file(tmp_path):
    """What each is off by is the same in the file and in what is written, at random positions."""
    source = mujoco.MjModel.from_xml_string(TIED)
    model = mujoco.MjModel.from_xml_path(str(converted(tmp_path, TIED) / "object.xml"))
    rng, off = np.random.default_rng(0), ([], [])
    for _ in range(4):
        q = rng.uniform(-0.3, 0.3, 3)
        for one, prefix, found in ((source, "", off[0]), (model, "tied_", off[1])):
            data = mujoco.MjData(one)
            for name, value in zip(("a", "b", "b2"), q, strict=True):
                data.joint(prefix + name).qpos[0] = value
            mujoco.mj_forward(one, data)
            of_site_ties = [k for k in range(one.neq) if one.eq_type[k] in (int(EQ.mjEQ_CONNECT), int(EQ.mjEQ_WELD))]
            for eq in of_site_ties:
                rows = (data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & (data.efc_id == eq)
                found += [(one.eq_type[eq], np.linalg.norm(part)) for part in np.split(data.efc_pos[rows], (3,))]
    np.testing.assert_allclose(sorted(off[0]), sorted(off[1]), atol=1e-6)


def test_tied_tendons_become_joints_that_follow(tmp_path):
    """Of two joints on one tendon, and of two tendons of one joint each; others are left out with a warning."""
    ties = '<tendon tendon1="sum" polycoef="0.1 0 0 0 0"/><tendon tendon1="c" tendon2="d" polycoef="0.2 0.5 0.3 0 0"/>'
    tendons = '<fixed name="sum"><joint joint="a" coef="0.5"/><joint joint="b2" coef="-2"/></fixed>'
    tendons += "".join(f'<fixed name="{n}"><joint joint="{n}" coef="{c}"/></fixed>' for n, c in (("c", 4), ("d", 3)))
    more = "".join(f'<body name="{n}"><joint name="{n}" ref="0.1"/><geom size="0.02" mass="1"/></body>' for n in "cd")
    text = TIED.replace('<fixed name="t">', tendons + '<fixed name="t">').replace("<equality>", "<equality>" + ties)
    out = converted(tmp_path, text.replace("</body>\n</body>", f"</body>{more}</body>"))
    robot, model = UrdfRobot.load(out), mujoco.MjModel.from_xml_path(str(out / "object.xml"))
    assert (robot.description.leader("b2"), robot.description.leader("c")) == ("a", "d")
    source = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(source)
    for name, value in {"a": 0.3, "d": -0.2}.items():
        data.joint(name).qpos[0] = value
    at = robot.body.posed({"a": 0.3, "d": -0.2})
    for name in ("b2", "c"):
        data.joint(name).qpos[0] = at.joint(f"tied_{name}").qpos[0]
    mujoco.mj_forward(source, data)
    kept = (data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)) & np.isin(data.efc_id, (0, 1))
    assert kept.sum() == 2
    np.testing.assert_allclose(data.efc_pos[kept], 0, atol=1e-6)
    assert not np.any(model.eq_type == int(EQ.mjEQ_TENDON))


def test_an_image_on_a_mesh_is_kept(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 255, (8, 16, 3), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "skin.png")
    (tmp_path / "plate.obj").write_text(
        "v 0 0 0\nv 0.1 0 0\nv 0.1 0.2 0\nv 0 0.2 0.1\nvt 0 0\nvt 1 0\nvt 0.9 0.7\nvt 0.1 0.8\n"
        "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 1/2 4/4 2/1\nf 2/1 4/3 3/2\n"
    )
    look = '<asset><texture name="skin" type="2d" file="skin.png"/><material name="m" texture="skin"/>'
    look += '<mesh name="plate" file="plate.obj"/></asset><worldbody>'
    shown = '<geom type="mesh" mesh="plate" material="m" contype="0" conaffinity="0"/><site name="attachment_site"'
    text = ARM.replace("<worldbody>", look).replace('<site name="attachment_site"', shown)
    model = mujoco.MjModel.from_xml_path(str(converted(tmp_path, text) / "object.xml"))
    assert model.ntex == 1
    np.testing.assert_array_equal(np.array(model.tex_data).reshape(8, 16, 3), _tex(tmp_path))
    source, geom = (
        mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml")),
        int(np.flatnonzero(model.geom_matid >= 0)[0]),
    )
    own = int(np.flatnonzero(source.geom_matid >= 0)[0])
    np.testing.assert_allclose(_corners(model, geom), _corners(source, own), atol=1e-6)


def _tex(folder: pathlib.Path) -> np.ndarray:
    source = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    return np.array(source.tex_data).reshape(8, 16, 3)


def _corners(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Texture coordinates and distances to the first vertex of all corners of a mesh, in an order of their own."""
    mesh = int(model.geom_dataid[geom])
    faces = model.mesh_faceadr[mesh] + np.arange(model.mesh_facenum[mesh])
    at = model.mesh_vert[model.mesh_vertadr[mesh] + model.mesh_face[faces].ravel()]
    uv = model.mesh_texcoord[model.mesh_texcoordadr[mesh] + model.mesh_facetexcoord[faces].ravel()]
    rows = np.concatenate([uv, np.linalg.norm(at - at.mean(0), axis=1, keepdims=True)], 1)
    return rows[np.lexsort(rows.round(5).T)]


@pytest.mark.parametrize("on", [None, "attachment_site", "fore"])
def test_a_gripper_of_another_file_is_mounted_on_an_arm(tmp_path, on):
    gripper = written(tmp_path, GRIPPER.format(free="<freejoint/>"))
    robot = UrdfRobot.load(converted(tmp_path, ARM, grippers=[Mounting(gripper, on)]))
    assert robot.layout.arm == ("pan", "lift") and robot.layout.gripper == ("gripper_one",)
    assert robot.description.leader("gripper_two") == "gripper_one"
    assert robot.layout.start == {"pan": 0.3, "lift": 0.2, "gripper_one": 0.0}
    (rays,) = robot.hand_rays()
    along = (0.355, 0, 0) if on != "fore" else (0, 0, 0.055)
    np.testing.assert_allclose(rays.grasp_point, along, atol=1e-6)


def test_two_grippers_are_named_after_what_carries_them(tmp_path):
    gripper = written(tmp_path, GRIPPER.format(free=""))
    robot = UrdfRobot.load(converted(tmp_path, ARM, grippers=[Mounting(gripper, "end"), Mounting(gripper, "foot")]))
    assert {one.joints for one in robot.layout.grippers} == {("foot_gripper_one",), ("end_gripper_one",)}


def test_a_gripper_that_cannot_be_mounted_is_one_line(tmp_path, capsys):
    gripper = written(tmp_path, GRIPPER.format(free=""))
    with pytest.raises(UnknownNameError, match=r"no site or body of .* is named 'hnd'"):
        converted(tmp_path, ARM, grippers=[Mounting(gripper, "hnd")])
    with pytest.raises(InputError, match="is not a file"):
        converted(tmp_path, ARM, grippers=[Mounting(tmp_path / "none.xml")])
    urdf = written(tmp_path, '<robot name="r"><link name="l"/></robot>', "r.urdf")
    with pytest.raises(InputError, match="takes no gripper of another file"):
        convert_robot(urdf, tmp_path / "r", grippers=[Mounting(gripper)])
    assert (
        call(
            [
                "convert",
                "robot",
                "--mjcf",
                str(tmp_path / "robot.xml"),
                "--out",
                str(tmp_path / "o"),
                "--gripper",
                f"{gripper}@hnd",
            ]
        )
        == 2
    )
    assert "hnd" in capsys.readouterr().err


def test_words_name_a_file_and_a_place(tmp_path):
    assert Mounting.of_words("g.xml@wrist") == Mounting(pathlib.Path("g.xml"), "wrist")
    odd = written(tmp_path, GRIPPER, "a@b.xml")
    assert Mounting.of_words(str(odd)) == Mounting(odd)
