"""From links to bodies: merging, splitting, inertials, on hand-made descriptions."""

from __future__ import annotations

import pathlib

import mujoco
import numpy as np
import pytest
import trimesh
from ig2mj_converters.base.description import Inertial, Joint, Link, Metadata, Mimic, ObjectModel
from ig2mj_converters.base.naming import NamePool, file_slug
from ig2mj_converters.bodies.assembly import MIN_MASS, assemble, extent, merge_inertials
from ig2mj_converters.bodies.joint_limits import joint_range
from ig2mj_converters.hulls.pieces import HullPiece
from ig2mj_converters.mjcf.model_builder import ModelBuilder
from ig2mj_converters.mjcf.object import add_object
from scipy.spatial.transform import Rotation


def at(x, y, z) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def hull(size=(0.1, 0.1, 0.1), centre=(0.0, 0.0, 0.0)) -> HullPiece:
    mesh = trimesh.creation.box(size, transform=at(*centre))
    return HullPiece("box", np.asarray(mesh.vertices), np.asarray(mesh.faces), pose=at(*centre), size=tuple(size))


def joint(name, kind, parent, child, xyz=(0, 0, 0), axis=(0, 0, 1), lower=0.0, upper=1.0, **more) -> Joint:
    return Joint(name, kind, parent, child, at(*xyz), np.array(axis, float), lower, upper, **more)


def thing(links, joints, inertials=None, pieces=None, base="base_link"):
    model = ObjectModel(
        "box", "m", pathlib.Path("m.urdf"), {n: Link(n) for n in links}, {j.name: j for j in joints}, base
    )
    model.metadata = Metadata()
    given = {n: Inertial(1.0, np.eye(3) * 1e-3) for n in links} | (inertials or {})
    return assemble(model, np.ones(3), pieces or {n: [hull()] for n in links}, given)


def compiled(assembly, tmp_path, fixed=True):
    builder = ModelBuilder("m", tmp_path)
    elements = add_object(
        builder, assembly, "thing", [b.pose for b in assembly.bodies if b.parent is None], fixed=fixed
    )
    return builder.spec.compile(), elements, builder


def test_links_behind_fixed_joints_are_geoms_of_the_parent_body():
    plan = thing(
        ["base_link", "a", "b"],
        [joint("j", "fixed", "base_link", "a", (0.2, 0, 0)), joint("k", "fixed", "a", "b", (0, 0.3, 0))],
    )
    (body,) = plan.bodies
    assert body.links == ["base_link", "a", "b"]
    np.testing.assert_allclose(plan.link_poses["b"][1], at(0.2, 0.3, 0))
    np.testing.assert_allclose([p.pose[:3, 3] for p in body.collisions], [[0, 0, 0], [0.2, 0, 0], [0.2, 0.3, 0]])
    np.testing.assert_allclose(extent(plan, np.eye(4))[1], [0.25, 0.35, 0.05])


def test_masses_of_merged_links_add_and_their_centre_is_the_weighted_mean():
    merged = merge_inertials(
        [(Inertial(1.0, np.zeros((3, 3))), at(0, 0, 0)), (Inertial(3.0, np.zeros((3, 3))), at(0.4, 0, 0))]
    )
    assert merged.mass == 4.0
    np.testing.assert_allclose(merged.pose, at(0.3, 0, 0))
    np.testing.assert_allclose(merged.inertia, np.diag([0, 0.12, 0.12]), atol=1e-12)


def test_a_merged_body_has_the_inertia_of_one_solid():
    long = trimesh.creation.box((2.0, 0.4, 0.6))
    half = trimesh.creation.box((1.0, 0.4, 0.6))
    parts = [(Inertial(half.mass, half.moment_inertia), at(x, 0, 0)) for x in (-0.5, 0.5)]
    np.testing.assert_allclose(merge_inertials(parts).inertia, long.moment_inertia, rtol=1e-9)


def test_a_moving_link_starts_its_own_body_at_the_joint(tmp_path):
    plan = thing(
        ["base_link", "mid", "lid"],
        [joint("j", "fixed", "base_link", "mid", (0, 0, 0.5)), joint("k", "revolute", "mid", "lid", (0.1, 0, 0))],
    )
    assert [body.name for body in plan.bodies] == ["base_link", "lid"]
    np.testing.assert_allclose(plan.bodies[1].pose, at(0.1, 0, 0.5))
    model, elements, _ = compiled(plan, tmp_path)
    assert elements.joints == {"k": "thing_k"}
    np.testing.assert_allclose(model.jnt_range[0], [0, 1])


@pytest.mark.parametrize(
    ("kind", "lower", "upper"), [("continuous", None, None), ("revolute", None, None), ("revolute", 1.0, -1.0)]
)
def test_joints_without_usable_limits_are_unlimited(kind, lower, upper, tmp_path):
    plan = thing(["base_link", "a"], [joint("j", kind, "base_link", "a", lower=lower, upper=upper)])
    assert joint_range(plan.joints()[0]) is None
    model, _, _ = compiled(plan, tmp_path)
    assert not model.jnt_limited[0]


def test_a_joint_without_room_between_its_limits_is_rigid():
    plan = thing(["base_link", "a"], [joint("j", "prismatic", "base_link", "a", axis=(1, 0, 0), lower=0.2, upper=0.2)])
    assert len(plan.bodies) == 1 and "j" in plan.warnings[0]
    np.testing.assert_allclose(plan.link_poses["a"][1], at(0.2, 0, 0))


def test_mimic_becomes_a_joint_equality(tmp_path):
    joints = [
        joint("lead", "revolute", "base_link", "a"),
        joint("follow", "revolute", "base_link", "b", lower=-9.0, upper=9.0, mimic=Mimic("lead", -2.0, 0.1)),
    ]
    model, _, _ = compiled(thing(["base_link", "a", "b"], joints), tmp_path)
    assert model.neq == 1 and model.eq_type[0] == mujoco.mjtEq.mjEQ_JOINT
    assert (model.eq_obj1id[0], model.eq_obj2id[0]) == (model.joint("thing_follow").id, model.joint("thing_lead").id)
    np.testing.assert_allclose(model.eq_data[0, :3], [0.1, -2.0, 0.0])
    data = mujoco.MjData(model)
    model.dof_frictionloss[:] = 0
    for _ in range(600):
        data.qpos[model.joint("thing_lead").qposadr] = 0.5
        data.qvel[model.joint("thing_lead").dofadr] = 0
        mujoco.mj_step(model, data)
    assert data.qpos[model.joint("thing_follow").qposadr[0]] == pytest.approx(0.1 - 2.0 * 0.5, abs=0.05)


def test_a_mimic_of_a_joint_that_does_not_move_is_a_warning(tmp_path):
    follow = joint("follow", "revolute", "base_link", "a", mimic=Mimic("nothing"))
    model, _, builder = compiled(thing(["base_link", "a"], [follow]), tmp_path)
    assert model.neq == 0 and "nothing" in builder.warnings["thing"][0]


def test_zero_mass_moving_links_get_a_small_floor(tmp_path):
    nothing = Inertial(0.0, np.zeros((3, 3)))
    plan = thing(
        ["base_link", "a"], [joint("j", "revolute", "base_link", "a")], {"a": nothing}, {"base_link": [hull()]}
    )
    model, _, _ = compiled(plan, tmp_path)
    assert model.body("thing_a").mass[0] == pytest.approx(MIN_MASS)


def test_a_free_base_without_mass_is_flagged():
    plan = thing(["base_link"], [], {"base_link": Inertial(0.0, np.zeros((3, 3)))})
    assert "static" in plan.warnings[0]


@pytest.mark.parametrize(
    "moments",
    [(1e-9, 1e-9, 5.0), (4.2e-7, 0.075, 0.07496), (1.0, 1.0, 2.0), (0.3333333, 0.1234567, 0.45679), (0, 0, 0)],
)
def test_flat_slender_and_impossible_inertias_survive_mjcfs_six_digits(moments, tmp_path):
    turn = Rotation.from_euler("xyz", (0.3, 1.1, -0.7)).as_matrix()
    for axes in (np.eye(3), turn):
        plan = thing(["base_link"], [], {"base_link": Inertial(1.0, axes @ np.diag(moments) @ axes.T)})
        _, _, builder = compiled(plan, tmp_path, fixed=False)
        mujoco.MjModel.from_xml_string(builder.spec.to_xml())


def test_clashing_names_get_a_suffix(tmp_path):
    builder = ModelBuilder("m", tmp_path)
    hinged = thing(["base_link", "0"], [joint("j", "revolute", "base_link", "0")])
    assert add_object(builder, hinged, "table_1", [np.eye(4)], fixed=True).bodies == ["table_1", "table_1_0"]
    other = add_object(builder, thing(["base_link"], []), "table_1_0", [at(3, 0, 0)], fixed=True)
    assert other.bodies == ["table_1_0__2"]
    builder.spec.compile()


@pytest.mark.parametrize("name", ["a b/c", "Größe.7", "..", "椅子", "x" * 300, "con:?*"])
def test_file_names_are_safe_whatever_the_object_is_called(name):
    slug = file_slug(name)
    assert slug and len(slug) <= 60 and slug.isascii() and not set(slug) & set("/\\ .:*?")


def test_a_name_is_given_once():
    pool = NamePool()
    assert [pool.take("a") for _ in range(3)] == ["a", "a__2", "a__3"]
