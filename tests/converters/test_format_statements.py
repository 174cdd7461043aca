"""Single facts of iGibson's format that other tests pass by, on one converted scene."""

from __future__ import annotations

import pathlib
import shutil

import mujoco
import numpy as np
import pytest
from tiny_dataset import joint_xml, link_xml, write_model
from tiny_geometry import box, groups, write_obj
from tiny_house import SCENE, instance_xml, scene_xml


@pytest.fixture(scope="module")
def scene(dataset, convert, tmp_path_factory):
    """The tiny house with odd objects in it: see `_write_models` and `_instances`."""
    root = pathlib.Path(shutil.copytree(dataset, tmp_path_factory.mktemp("statements") / "own"))
    _write_models(root)
    file = root / "scenes" / SCENE / "urdf" / "odd.urdf"
    file.write_text(scene_xml(*_instances()))
    return convert(urdf=file, root=root)


def _write_models(root: pathlib.Path) -> None:
    # metadata that says a little more than the mesh has, as the real dishwasher's does
    write_model(root, "desk", "d0", {"base_link": groups(box((0.96, 0.48, 0.72)))},
                low=(-0.5, -0.25, -0.375), high=(0.5, 0.25, 0.375))  # fmt: skip
    # a door whose frame stands in a wall hole, whose panel is a link and whose handle hangs on the panel
    write_model(
        root,
        "door",
        "do0",
        {
            "base_link": groups(box((0.12, 0.06, 2.0), (0, -0.47, 0)), box((0.12, 0.06, 2.0), (0, 0.47, 0))),
            "link_0": groups(box((0.04, 0.86, 1.96), (0, 0.43, 0))),
            "link_1": groups(box((0.05, 0.1, 0.02), (0.05, 0, 0))),
        },
        [
            joint_xml("joint_0", "revolute", "base_link", "link_0", (0, -0.43, 0), axis=(0, 0, 1), limits=(0.03, 3.1)),
            joint_xml("joint_1", "revolute", "link_0", "link_1", (0, 0.8, 0), axis=(1, 0, 0), limits=(-0.5, 0.5)),
        ],
        low=(-0.06, -0.5, -1.0),
        high=(0.06, 0.5, 1.0),
    )
    # a basket as `_simplified.urdf` has it: a box beside the mesh, a box visual, a visual on a link without collision
    folder = write_model(root, "basket", "ba0", {"base_link": groups(box((0.3, 0.3, 0.2)))},
                         low=(-0.15, -0.15, -0.1), high=(0.15, 0.15, 0.1),
                         visuals={"base_link": "shape/visual/b.obj"})  # fmt: skip
    write_obj(folder / "shape" / "visual" / "sign.obj", [("", box((0.1, 0.1, 0.1)))])
    plate = '<geometry><box size="0.28 0.28 0.01"/></geometry>'
    base = link_xml("base_link", visual="shape/visual/b.obj").replace(
        "</link>", f'<visual>{plate}</visual><collision><origin xyz="0 0 -0.095"/>{plate}</collision></link>'
    )
    sign = link_xml("sign", collision=False, visual="shape/visual/sign.obj")
    fixed = joint_xml("joint_0", "fixed", "base_link", "sign", (0, 0, 0.5))
    (folder / "ba0_simplified.urdf").write_text(f'<robot name="ba0">{base}{sign}{fixed}</robot>')
    # a knife whose blade box is turned
    blade = {"geometry": "box", "size": [0.2, 0.004, 0.01], "xyz": [0.1, 0, 0], "rpy": [0, 0, 0.5]}
    write_model(root, "carving_knife", "kn1", {"base_link": groups(box((0.2, 0.02, 0.02)))},
                low=(-0.1, -0.01, -0.01), high=(0.1, 0.01, 0.01), metadata={"links": {"slicer": blade}})  # fmt: skip


def _instances() -> list[str]:
    desk = instance_xml("desk_0", "desk", "d0", (1.0, 1.0, 0.76), bounding_box="1.0 0.5 1.5", rooms="bedroom_0")
    return [
        desk.replace("<link ", '<link xyz="9 9 9" rpy="1 1 1" '),
        instance_xml("door_0", "door", "do0", (0, 0, 1.0), bounding_box="0.12 1.0 2.0", rooms="kitchen_0,bedroom_0"),
        instance_xml("basket_0", "basket", "ba0", (1.0, -1.0, 0.21), fixed=False, scale="2 2 2"),
        instance_xml("carving_knife-kn1-0", "carving_knife", "kn1", (-1.0, -1.0, 0.03), fixed=False, scale="2 2 2"),
        instance_xml("bottom_cabinet_1", "bottom_cabinet", "cab0", (-1.6, 1.0, 0.41), bounding_box="0.61 0.5 0.8",
                     joint_states='{"bottom_cabinet_1_joint_0": [0.12, 0.5]}'),
        instance_xml("agent_0", "agent", "BehaviorRobot", (1.0, -0.4, 0.9), fixed=False,
                     robot_config='{"name": "agent_0"}'),
    ]  # fmt: skip


def box_of(scene, body: str) -> np.ndarray:
    """Size of the world box of a body's own collision geoms."""
    from ig2mj_converters.mjcf.model_index import geom_box

    m, d = scene.model, scene.data
    boxes = [geom_box(m, g, d.geom_xmat[g].reshape(3, 3), d.geom_xpos[g]) for g in scene.geoms(body, 3)]
    return np.max([b[1] for b in boxes], axis=0) - np.min([b[0] for b in boxes], axis=0)


def test_the_size_is_metadatas_even_where_the_mesh_is_smaller(scene):
    assert scene.entries["desk_0"].scale == pytest.approx((1.0, 1.0, 2.0))
    np.testing.assert_allclose(box_of(scene, "desk_0"), (0.96, 0.48, 1.44), atol=1e-4)


def test_mass_is_of_the_asked_box_not_of_the_mesh(scene):
    assert scene.entries["desk_0"].mass == pytest.approx(67.0 * 1.0 * 0.5 * 1.5, rel=1e-4)


def test_the_copies_of_the_pose_that_save_wrote_are_ignored(scene):
    np.testing.assert_allclose(scene.data.body("desk_0").xpos, (1.0, 1.0, 0.76), atol=1e-5)
    np.testing.assert_allclose(scene.data.body("desk_0").xquat, (1, 0, 0, 0), atol=1e-6)


def test_fixed_or_free_is_the_scene_joints_type(scene):
    assert scene.entries["desk_0"].fixed and not scene.entries["basket_0"].fixed


def test_an_agent_becomes_no_body_but_a_start_pose_of_the_task(scene):
    assert "agent_0" not in scene.entries
    assert "agent_0" not in [scene.model.body(b).name for b in range(scene.model.nbody)]
    (agent,) = scene.manifest.task["agents"]
    assert (agent["name"], agent["model"], agent["pos"]) == ("agent_0", "BehaviorRobot", [1.0, -0.4, 0.9])


def test_a_door_belongs_to_both_rooms_and_its_frame_does_not_touch_the_wall(scene):
    assert scene.entries["door_0"].rooms == ["kitchen_0", "bedroom_0"]
    m, d = scene.model, scene.data
    frame, walls = m.body("door_0").id, m.body("walls").id
    np.testing.assert_allclose(d.body("door_0").xpos, (0, 0, 1.0), atol=1e-6)
    assert not [c for c in d.contact if {m.geom_bodyid[c.geom1], m.geom_bodyid[c.geom2]} == {frame, walls}]


def test_a_moving_door_panel_still_touches_the_wall(scene):
    m, d = scene.model, mujoco.MjData(scene.model)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    d.qpos[m.joint("door_0_joint_0").qposadr[0]] = 3.1  # swung back against the wall beside the hole
    mujoco.mj_forward(m, d)
    panel, walls = m.body("door_0_link_0").id, m.body("walls").id
    assert any({m.geom_bodyid[c.geom1], m.geom_bodyid[c.geom2]} == {panel, walls} for c in d.contact)


def test_a_handle_chained_on_the_panel_moves_with_it(scene):
    m = scene.model
    assert m.body("door_0_link_1").parentid[0] == m.body("door_0_link_0").id


def test_a_closed_pose_that_is_not_zero_is_clamped_to_its_limit(scene):
    assert scene.data.joint("door_0_joint_0").qpos[0] == pytest.approx(0.03, abs=1e-6)


def test_joint_states_have_prefixed_names_and_may_name_some_joints_only(scene):
    assert scene.data.joint("bottom_cabinet_1_joint_0").qpos[0] == pytest.approx(0.12, abs=1e-6)
    assert scene.data.joint("bottom_cabinet_1_joint_1").qpos[0] == 0.0


def test_box_collisions_of_simplified_urdfs_stay_and_scale(scene):
    m = scene.model
    sizes = sorted((2 * m.geom_size[g]).tolist() for g in scene.geoms("basket_0", 3))
    np.testing.assert_allclose(sizes, [(0.56, 0.56, 0.02), (0.6, 0.6, 0.4)], atol=1e-5)


def test_box_visuals_and_visuals_of_links_without_collision_are_dropped(scene):
    (visual,) = scene.geoms("basket_0", 0)
    assert scene.model.geom_type[visual] == mujoco.mjtGeom.mjGEOM_MESH


def test_a_blade_box_is_scaled_and_turned_with_its_own_rpy(scene):
    blade = scene.model.geom("carving_knife-kn1-0/slicer")
    np.testing.assert_allclose(2 * blade.size, (0.4, 0.008, 0.02), atol=1e-6)
    np.testing.assert_allclose(blade.pos, (0.2, 0, 0), atol=1e-6)
    np.testing.assert_allclose(blade.quat, (np.cos(0.25), 0, 0, np.sin(0.25)), atol=1e-6)


def test_names_of_clutter_keep_their_dashes(scene):
    assert scene.model.body("carving_knife-kn1-0").jntnum[0] == 1


def test_no_speed_or_force_limits_and_no_springs(scene):
    m = scene.model
    assert not m.jnt_stiffness.any() and not m.jnt_actfrclimited.any()


def test_bullets_contact_tags_are_read_over(tmp_path, folder_of_a_ycb_like_urdf):
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_object

    convert_object(folder_of_a_ycb_like_urdf, "can", tmp_path / "out", options=ConvertOptions(report=False))
    m = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "object.xml"))
    assert m.geom_friction[m.geom("can/collision_0").id][0] == 0.25
    assert m.body("can").mass[0] == pytest.approx(0.3)


@pytest.fixture
def folder_of_a_ycb_like_urdf(tmp_path) -> pathlib.Path:
    write_obj(tmp_path / "can.obj", groups(box((0.1, 0.1, 0.1))))
    (tmp_path / "can.urdf").write_text(
        '<robot name="can"><link name="baseLink"><contact><lateral_friction value="1.0"/>'
        '<rolling_friction value="0.0"/><inertia_scaling value="3.0"/><contact_cfm value="0.0"/>'
        '<contact_erp value="1.0"/></contact>'
        '<inertial><mass value="0.3"/><inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial>'
        '<collision><geometry><mesh filename="can.obj"/></geometry></collision></link></robot>'
    )
    return tmp_path / "can.urdf"
