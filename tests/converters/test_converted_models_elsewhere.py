"""What other software must accept of a converted model."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from PIL import Image


def test_mjx_warp_takes_a_converted_scene(task_house):
    mjx = pytest.importorskip("mujoco.mjx", reason="needs mujoco-mjx")
    assert mjx.put_model(task_house.model, impl="warp").nq == task_house.model.nq


def test_a_converted_object_can_be_attached_to_another_model(dataset, tmp_path):
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.convert_object import convert_object

    urdf = dataset / "objects" / "bottom_cabinet" / "cab0" / "cab0.urdf"
    convert_object(urdf, "bottom_cabinet", tmp_path / "out", options=ConvertOptions(report=False))
    child = mujoco.MjSpec.from_file(str(tmp_path / "out" / "object.xml"))
    parent = mujoco.MjSpec.from_file(str(tmp_path / "out" / "object.xml"))  # the same options: no conflict to settle
    parent.worldbody.add_frame(pos=(1, 2, 0)).attach_body(child.body("cab0"), "a/", "")
    model = parent.compile()
    assert model.joint("a/cab0_joint_0").type[0] == mujoco.mjtJoint.mjJNT_SLIDE
    assert model.joint("cab0_joint_0").type[0] == mujoco.mjtJoint.mjJNT_SLIDE


def test_textured_visuals_keep_their_texture(tmp_path):
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.convert_object import convert_object

    Image.fromarray(np.full((2000, 8, 3), (200, 30, 40), np.uint8)).save(tmp_path / "skin.jpg", quality=95)
    (tmp_path / "q.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd skin.jpg\n")
    (tmp_path / "q.obj").write_text(
        "mtllib q.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    (tmp_path / "q.urdf").write_text(
        '<robot name="q"><link name="b"><visual><geometry><mesh filename="q.obj"/></geometry></visual>'
        '<collision><geometry><box size="1 1 0.02"/></geometry></collision></link></robot>'
    )
    convert_object(tmp_path / "q.urdf", "toy", tmp_path / "out", options=ConvertOptions(report=False))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "object.xml"))
    geom = model.geom("q/visual_0")
    texture = model.mat_texid[geom.matid[0], mujoco.mjtTextureRole.mjTEXROLE_RGB]
    assert texture >= 0 and model.tex_height[texture] == 1024  # scaled down from 2000
    start = model.tex_adr[texture]
    np.testing.assert_allclose(model.tex_data[start : start + 3], (200, 30, 40), atol=4)
    assert model.mesh_texcoordnum[geom.dataid[0]] == 4
