"""One object in MJCF, from iGibson's format."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np
import pytest
from ig2mj_converters.mjcf.model_builder import write_model

from ig2mj.errors import InputError


def test_no_self_collision_inside_an_object(house):
    m, d = house.model, mujoco.MjData(house.model)
    drawer, door = m.joint("bottom_cabinet_0_joint_0"), m.joint("bottom_cabinet_0_joint_1")
    bodies = {m.body(b).id for b in ("bottom_cabinet_0", "bottom_cabinet_0_link_0", "bottom_cabinet_0_link_1")}
    for pull, swing in itertools.product((0.0, 0.15, 0.3), (0.0, 0.7, 1.5)):
        d.qpos[drawer.qposadr], d.qpos[door.qposadr] = pull, swing
        mujoco.mj_forward(m, d)
        pairs = [{m.geom_bodyid[c.geom1], m.geom_bodyid[c.geom2]} for c in d.contact]
        assert not any(pair <= bodies for pair in pairs)


def test_every_pair_of_bodies_of_one_object_is_excluded(house):
    m = house.model
    names = ("bottom_cabinet_0", "bottom_cabinet_0_link_0", "bottom_cabinet_0_link_1")
    expected = {frozenset(m.body(b).id for b in pair) for pair in itertools.combinations(names, 2)}
    assert expected <= {frozenset((s >> 16, s & 0xFFFF)) for s in m.exclude_signature.tolist()}


def test_links_and_joints_carry_the_objects_name(house):
    names = [house.model.body(b).name for b in range(house.model.nbody)]
    assert {"bottom_cabinet_0", "bottom_cabinet_0_link_0", "bottom_cabinet_0_link_1"} <= set(names)
    assert "bottom_cabinet_0_base_link" not in names
    joints = [joint.name for joint in house.entries["bottom_cabinet_0"].joints]
    assert joints == ["bottom_cabinet_0_joint_0", "bottom_cabinet_0_joint_1"]


def test_floating_joints_split_the_object_into_independent_bodies(house):
    entry = house.entries["bed_0"]
    assert entry.fixed and entry.bodies == ["bed_0", "bed_0_link_0", "bed_0_link_1"]
    for pillow in entry.bodies[1:]:
        assert house.model.joint(f"{pillow}/free").type[0] == mujoco.mjtJoint.mjJNT_FREE
        assert house.model.body(pillow).parentid[0] == 0
    bed = house.data.body("bed_0").xpos
    np.testing.assert_allclose(house.data.body("bed_0_link_0").xpos, bed + np.array([-0.8, -0.35, 0.2]), atol=1e-5)


def test_only_bodies_of_one_tree_are_excluded_so_that_pillows_lie_on_beds(house, task_house):
    for scene in (house, task_house):
        m = scene.model
        pairs = [(signature >> 16, signature & 0xFFFF) for signature in m.exclude_signature.tolist()]
        assert pairs and all(m.body_rootid[a] == m.body_rootid[b] for a, b in pairs)


def test_a_pillow_rests_on_its_bed_although_both_are_one_object(house):
    m, d = house.model, mujoco.MjData(house.model)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    for _ in range(120):
        mujoco.mj_step(m, d)
    assert d.body("bed_0_link_0").xpos[2] == pytest.approx(0.451, abs=5e-3)


def test_fixed_objects_have_no_joint_and_loose_ones_a_free_joint(house):
    assert house.entries["stove_0"].fixed and house.model.body("stove_0").jntnum[0] == 0
    assert not house.entries["apple_0"].fixed
    assert house.model.joint("apple_0/free").type[0] == mujoco.mjtJoint.mjJNT_FREE


def test_frictionloss_stands_for_the_velocity_motor_that_igibson_puts_on_joints(house):
    m = house.model
    assert m.dof_frictionloss[m.joint("bottom_cabinet_0_joint_0").dofadr[0]] == 10.0
    assert m.dof_frictionloss[m.joint("fridge_0_joint_0").dofadr[0]] == 10.0


@pytest.mark.parametrize(
    ("category", "force"), [("oven", 30.0), ("dishwasher", 30.0), ("toilet", 3.0), ("fridge", 10.0)]
)
def test_friction_of_ovens_dishwashers_and_toilets(category, force):
    from ig2mj_converters.base.description import Joint
    from ig2mj_converters.bodies.joint_rules import friction

    slide = Joint("j", "prismatic", "a", "b", np.eye(4), np.array([1.0, 0, 0]), 0.0, 0.3)
    hinge = Joint("j", "revolute", "a", "b", np.eye(4), np.array([1.0, 0, 0]), 0.0, 1.0)
    assert friction(slide, category, 0.0) == force
    assert friction(hinge, category, 0.5) == force


def test_a_knob_is_not_held_by_a_furniture_hinges_torque():
    from ig2mj_converters.base.description import Joint
    from ig2mj_converters.bodies.joint_rules import friction

    hinge = Joint("j", "revolute", "a", "b", np.eye(4), np.array([1.0, 0, 0]), 0.0, 1.0)
    assert friction(hinge, "stove", 0.02) == pytest.approx(2.0)


def test_friction_and_margin_are_igibsons_and_the_gap_lists_three_millimetres(house):
    m = house.model
    collision = m.geom_group == 3
    assert np.allclose(m.geom_friction[collision, 0], 0.25)
    assert np.allclose(m.geom_gap[collision], 0.003) and not m.geom_margin[collision].any()
    visual = np.isin(m.geom_group, (0, 4))
    assert collision.sum() + visual.sum() == m.ngeom
    assert not m.geom_contype[visual].any() and not m.geom_conaffinity[visual].any()


def test_gravity_and_timestep_are_igibsons(house):
    option = house.model.opt
    assert option.timestep == pytest.approx(1 / 120, rel=1e-5)
    assert tuple(option.gravity) == (0.0, 0.0, -9.8)
    assert option.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP


def test_point_links_are_sites_on_the_base_body(house):
    site = house.model.site("stove_0/heat_source")
    assert house.model.body(site.bodyid[0]).name == "stove_0"
    np.testing.assert_allclose(site.pos, [0.1, 0.0, 0.45], atol=1e-6)
    links = house.entries["stove_0"].links
    assert links["heat_source"].site == "stove_0/heat_source" and links["heat_source"].geom is None
    assert links["toggle_button"].site == "stove_0/toggle_button"
    assert house.entries["sink_0"].links["water_source"].site == "sink_0/water_source"


def test_box_links_are_colliding_geoms_of_their_own_name(house):
    geom = house.model.geom("knife-kn0-0/slicer")
    assert geom.type[0] == mujoco.mjtGeom.mjGEOM_BOX and geom.group[0] == 3 and geom.contype[0] == 1
    np.testing.assert_allclose(geom.size, [0.09, 0.002, 0.002], atol=1e-6)
    np.testing.assert_allclose(geom.pos, [0.06, 0.0, -0.02], atol=1e-6)
    assert house.entries["knife-kn0-0"].links["slicer"].geom == "knife-kn0-0/slicer"


def test_the_masses_of_a_moving_object_are_the_category_density_times_its_box(house):
    cabinet = house.entries["bottom_cabinet_0"]
    assert cabinet.mass == pytest.approx(30.0 / (0.6 * 0.5 * 0.8) * (0.61 * 0.5 * 0.8), rel=1e-3)
    bodies = ("bottom_cabinet_0", "bottom_cabinet_0_link_0", "bottom_cabinet_0_link_1")
    assert sum(house.model.body(b).mass[0] for b in bodies) == pytest.approx(cabinet.mass, rel=1e-4)


def test_encrypted_visuals_are_replaced_by_the_hulls(house):
    visuals, collisions = (house.geoms("breakfast_table_0", group) for group in (0, 3))
    assert len(visuals) == len(collisions) == 5
    np.testing.assert_allclose(house.model.geom_size[visuals], house.model.geom_size[collisions])


def test_the_closed_end_is_the_upper_limit_where_direction_is_minus_one(house):
    (fridge,) = house.entries["fridge_0"].openable
    assert (fridge.joint, fridge.closed, fridge.open) == ("fridge_0_joint_0", 0.0, -1.5)
    drawer, door = house.entries["bottom_cabinet_0"].openable
    assert (drawer.closed, drawer.open) == (0.0, pytest.approx(0.3 * 0.61 / 0.61))
    assert (door.closed, door.open) == (0.0, 1.5)


def test_abilities_and_synset_come_from_the_taxonomy(house):
    assert house.entries["stove_0"].synset == "stove.n.01"
    assert house.entries["stove_0"].abilities["heatSource"]["temperature"] == 500
    assert "sliceable" in house.entries["apple_0"].abilities
    assert "slicer" in house.entries["knife-kn0-0"].abilities


def test_assisted_grasp_is_enable_ag_of_the_category(house):
    assert house.entries["apple_0"].assisted_grasp
    assert not house.entries["fridge_0"].assisted_grasp


def test_equal_models_share_their_meshes(task_house):
    m = task_house.model
    meshes = [m.geom_dataid[g] for part in ("apple_7_part_0", "apple_7_part_1") for g in task_house.geoms(part)]
    assert len(set(meshes)) == 1


def test_an_error_of_a_written_model_names_the_element_and_no_line_of_the_generated_file(tmp_path):
    spec = mujoco.MjSpec.from_string('<mujoco model="cup">\n<worldbody/>\n</mujoco>')
    spec.worldbody.add_geom(name="cup/collision_0", type=mujoco.mjtGeom.mjGEOM_BOX, size=[0, 0, 0])
    with pytest.raises(InputError, match=r"cup: does not compile: .*cup/collision_0") as error:
        write_model(spec, tmp_path / "scene.xml")
    assert "line" not in str(error.value)
