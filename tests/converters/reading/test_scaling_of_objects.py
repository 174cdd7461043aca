"""Scaling an articulated object per axis."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ig2mj_converters.base.description import Instance, Joint, Link, Mesh, Mimic, ObjectModel, Shape
from ig2mj_converters.base.transforms import apply, pose_from
from ig2mj_converters.bodies.kinematics import link_poses, model_bounds
from ig2mj_converters.bodies.solids import joined
from ig2mj_converters.reading.metadata import read_metadata
from ig2mj_converters.reading.scaling import instance_scale, scale_model

from ig2mj.errors import InputError

FINITE = st.floats(-1, 1, allow_nan=False)
VECTOR = st.tuples(FINITE, FINITE, FINITE)
SCALE = st.tuples(*[st.floats(0.3, 3)] * 3)
ANGLES = st.tuples(*[st.floats(-3, 3)] * 3)
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def mesh_shape(xyz=(0, 0, 0), rpy=(0, 0, 0), scale=(1.0, 1.0, 1.0), points=TETRAHEDRON) -> Shape:
    return Shape("mesh", pose_from(np.array(xyz), np.array(rpy)), meshes=[Mesh(points, FACES)], scale=scale)


def make_joint(kind, axis=(0, 0, 1), xyz=(0, 0, 0), rpy=(0, 0, 0), lower=None, upper=None, parent="a", child="b"):
    vector = np.array(axis, dtype=float)
    frame = pose_from(np.array(xyz), np.array(rpy))
    return Joint(f"to_{child}", kind, parent, child, frame, vector / np.linalg.norm(vector), lower, upper)


def model_of(links, *joints) -> ObjectModel:
    return ObjectModel("cup", "m", "m.urdf", {x.name: x for x in links}, {j.name: j for j in joints}, links[0].name)


def points_in_base(model: ObjectModel) -> np.ndarray:
    """All collision vertices of a baked or unbaked model with joints at 0."""
    poses = link_poses(model)
    return np.concatenate(
        [
            apply(poses[name] @ shape.pose, mesh.vertices * np.array(shape.scale))
            for name, link in model.links.items()
            for shape in link.collisions
            for mesh in shape.meshes
        ]
    )


@given(s=SCALE, origins=st.lists(VECTOR, min_size=3, max_size=3), places=st.lists(VECTOR, min_size=4, max_size=4))
def test_the_box_of_a_tree_without_rotations_is_scaled_exactly(s, origins, places):
    links = [Link(n, [mesh_shape(p)]) for n, p in zip("abcd", places, strict=True)]
    joints = [
        make_joint("revolute", (0, 1, 0), origins[0]),
        make_joint("prismatic", (1, 0, 0), origins[1], parent="b", child="c"),
        make_joint("floating", xyz=origins[2], child="d"),
    ]
    model = model_of(links, *joints)
    np.testing.assert_allclose(model_bounds(scale_model(model, s)), model_bounds(model) * s, atol=1e-12)


@given(s=SCALE, angles=st.lists(ANGLES, min_size=3, max_size=3), xyz=VECTOR)
def test_turned_frames_get_the_shape_of_the_whole_stretched_in_base_axes(s, angles, xyz):
    links = [Link("a", [mesh_shape(xyz, angles[0])]), Link("b", [mesh_shape(rpy=angles[1], scale=(2.0, 1.0, -0.5))])]
    model = model_of(links, make_joint("prismatic", (1, 2, 3), xyz, angles[2], 0.0, 1.0))
    scaled = scale_model(model, s)
    np.testing.assert_allclose(points_in_base(scaled), points_in_base(model) * s, atol=1e-9)


@given(s=SCALE, angles=ANGLES, axis=st.tuples(*[st.floats(0.1, 1)] * 3), q=st.floats(-1, 1))
def test_a_slide_moves_as_the_stretched_whole_does(s, angles, axis, q):
    angles = (angles[0] + 4.0, angles[1], angles[2])  # never the identity, for which iGibson's rule holds
    model = model_of(
        [Link("a"), Link("b", [mesh_shape()])], make_joint("prismatic", axis, rpy=angles, lower=q, upper=q)
    )
    scaled = scale_model(model, s)

    def moved(m):
        shifted = copy.deepcopy(m)
        joint = shifted.joints["to_b"]
        joint.origin[:3, 3] += joint.origin[:3, :3] @ joint.axis * joint.lower
        return points_in_base(shifted)

    np.testing.assert_allclose(moved(scaled), moved(model) * s, atol=1e-9)


def test_joint_origins_axes_and_limits_follow_igibsons_rule():
    """origin.xyz * S(parent); axis * S(child), normalised; prismatic limits * S[argmax |axis|]; hinge limits stay."""
    s = np.array([2.0, 3.0, 0.5])
    hinge = make_joint("revolute", (1, 1, 0), (1, 1, 1), lower=-1.0, upper=2.0)
    slide = make_joint("prismatic", (0.1, 0.9, 0), (0, 0, 1), lower=-0.1, upper=0.4, parent="b", child="c")
    scaled = scale_model(model_of([Link("a"), Link("b"), Link("c")], hinge, slide), s).joints
    np.testing.assert_allclose(scaled["to_b"].origin[:3, 3], [2, 3, 0.5])
    np.testing.assert_allclose(scaled["to_b"].axis, np.array([2, 3, 0]) / np.sqrt(13))
    assert (scaled["to_b"].lower, scaled["to_b"].upper) == (-1.0, 2.0)
    np.testing.assert_allclose(scaled["to_c"].origin[:3, 3], [0, 0, 0.5])
    np.testing.assert_allclose((scaled["to_c"].lower, scaled["to_c"].upper), (-0.3, 1.2))
    np.testing.assert_allclose(scaled["to_c"].axis, np.array([0.2, 2.7, 0]) / np.hypot(0.2, 2.7))


def test_scale_acts_on_the_mesh_before_its_origin():
    """v' = (scale * s) * v + s * xyz where nothing is turned."""
    shape = mesh_shape((1, 2, 3), scale=(2.0, 1.0, 1.0))
    baked = scale_model(model_of([Link("a", [shape], [shape])]), (1, 2, 3)).links["a"]
    for found in (*baked.collisions, *baked.visuals):
        assert found.scale == (1.0, 1.0, 1.0)
        np.testing.assert_allclose(apply(found.pose, found.meshes[0].vertices), TETRAHEDRON * [2, 2, 3] + [1, 4, 9])


def test_turned_origins_are_sheared_not_scaled_in_mesh_axes():
    """A visual turned by 90 degrees about z and scaled along the base's x grows along its own y."""
    shape = mesh_shape(rpy=(0, 0, np.pi / 2))
    found = scale_model(model_of([Link("a", [shape])]), (5, 1, 1)).links["a"].collisions[0]
    np.testing.assert_allclose(found.meshes[0].vertices, TETRAHEDRON * [1, 5, 1], atol=1e-9)


def test_raw_partnet_rotations_scale_in_base_axes():
    """rpy = (pi/2, 0, -pi/2) on a joint permutes the axes."""
    joint = make_joint("revolute", (0, 1, 0), rpy=(np.pi / 2, 0, -np.pi / 2))
    model = model_of([Link("a"), Link("b", [mesh_shape()])], joint)
    scaled = scale_model(model, (2, 3, 4))
    np.testing.assert_allclose(points_in_base(scaled), points_in_base(model) * [2, 3, 4], atol=1e-9)
    np.testing.assert_allclose(scaled.joints["to_b"].axis, [0, 1, 0], atol=1e-9)
    assert not any("shear" in w for w in scaled.warnings)


def test_a_hinge_that_would_bend_is_refused():
    joint = make_joint("revolute", (1, 0, 0), rpy=(0, 0, np.pi / 4))
    model = model_of([Link("a"), Link("b", [mesh_shape()])], joint)
    with pytest.raises(InputError, match=r"joint 'to_b'.*bend this hinge.*evenly"):
        scale_model(model, (1, 2, 1))
    assert scale_model(model, 2).joints["to_b"].axis == pytest.approx([1, 0, 0])
    assert scale_model(model, (2, 2, 1)).joints["to_b"].axis == pytest.approx([1, 0, 0])


def test_mirroring_scale_keeps_the_outside_outside():
    shape = mesh_shape(scale=(1.0, -1.0, 1.0))
    found = scale_model(model_of([Link("a", [shape])]), 1).links["a"].collisions[0]
    assert joined(found.meshes).volume == pytest.approx(1 / 6)


@pytest.mark.parametrize(
    ("kind", "size", "s", "expected"),
    [
        ("box", (1.0, 2.0, 3.0), (2, 3, 4), (2, 6, 12)),
        ("sphere", (1.0,), (2, 2, 2), (2,)),
        ("cylinder", (1.0, 3.0), (2, 2, 5), (2, 15)),
        ("capsule", (1.0, 3.0), (2, 2, 2), (2, 6)),
    ],
)
def test_primitives_stay_where_they_can(kind, size, s, expected):
    found = scale_model(model_of([Link("a", [Shape(kind, size=size)])]), s).links["a"].collisions[0]
    assert found.kind == kind
    assert found.size == pytest.approx(expected)


@pytest.mark.parametrize(
    ("kind", "size", "half"),
    [
        ("sphere", (1.0,), (1, 1, 1)),
        ("cylinder", (1.0, 3.0), (1, 1, 1.5)),
        ("capsule", (1.0, 3.0), (1, 1, 2.5)),
    ],
)
def test_primitives_become_meshes_where_they_cannot(kind, size, half):
    model = model_of([Link("a", [Shape(kind, size=size)])])
    scaled = scale_model(model, (1, 2, 3))
    assert scaled.links["a"].collisions[0].kind == "mesh"
    np.testing.assert_allclose(model_bounds(scaled)[1], np.array(half) * [1, 2, 3], rtol=0.02)
    assert any("into a mesh" in w for w in scaled.warnings)


def test_a_box_turned_by_a_rounded_quarter_turn_stays_a_box():
    """Files write pi/2 as 1.5708 or 1.57."""
    for turn in (1.5708, 1.57):
        shape = Shape("box", pose_from(np.zeros(3), np.array([0, 0, turn])), size=(1.0, 2.0, 3.0))
        found = scale_model(model_of([Link("a", [shape])]), (2, 1, 1)).links["a"].collisions[0]
        assert found.kind == "box"
        assert found.size == pytest.approx((1, 4, 3), rel=1e-5)


def test_a_box_at_45_degrees_becomes_the_sheared_mesh():
    shape = Shape("box", pose_from(np.zeros(3), np.array([0, 0, np.pi / 4])), size=(1.0, 1.0, 1.0))
    scaled = scale_model(model_of([Link("a", [shape])]), (2, 1, 1))
    assert scaled.links["a"].collisions[0].kind == "mesh"
    np.testing.assert_allclose(model_bounds(scaled)[1], [np.sqrt(2), np.sqrt(0.5), 0.5])
    assert joined(scaled.links["a"].collisions[0].meshes).volume == pytest.approx(2)


def test_mimic_ratios_follow_the_slides():
    leader = make_joint("revolute", lower=0.0, upper=1.0)
    follower = make_joint("prismatic", (1, 0, 0), lower=0.0, upper=1.0, child="c")
    follower.mimic = Mimic("to_b", 0.1, 0.2)
    scaled = scale_model(model_of([Link("a"), Link("b"), Link("c")], leader, follower), (3, 1, 1))
    assert scaled.joints["to_c"].mimic == Mimic("to_b", pytest.approx(0.3), pytest.approx(0.6))


def test_metadata_is_scaled_in_base_axes(folder):
    """4.1, 4.2: points and boxes at s * xyz, s * size; parts' positions scale; box sizes follow their orientation."""
    folder.write(
        "misc/metadata.json",
        """{"bbox_size": [1, 2, 4], "base_link_offset": [0.1, 0.2, 0.3],
        "orientations": [{"rotation": [0, 0, 0.7071068, 0.7071068], "prob": 1, "size": [2, 1, 4]}],
        "links": {"slicer": {"geometry": "box", "size": [1, 1, 1], "xyz": [1, 1, 1], "rpy": [0, 0, 0]},
                  "heat_source": {"geometry": null, "size": null, "xyz": [1, 2, 3], "rpy": [0, 0, 0]}},
        "object_parts": [{"category": "half", "model": "h", "pos": [1, 1, 1], "orn": [0, 0, 0, 1]}]}""",
    )
    model = model_of([Link("a")])
    model.metadata = read_metadata(folder.root, [])
    data = scale_model(model, (2, 3, 4)).metadata
    assert data.bbox_size == pytest.approx([2, 6, 16])
    assert data.base_link_offset == pytest.approx([0.2, 0.6, 1.2])
    assert data.orientations[0].size == pytest.approx([6, 2, 16])
    assert data.links["slicer"].size == pytest.approx([2, 3, 4])
    assert data.links["heat_source"].xyz == pytest.approx([2, 6, 12])
    assert data.object_parts[0].pos == pytest.approx([2, 3, 4])
    assert model.metadata.bbox_size == pytest.approx([1, 2, 4]), "the original must not change"


def test_scale_is_bounding_box_over_bbox_size(folder):
    """Without bbox_size a bounding box says nothing."""
    folder.write("misc/metadata.json", '{"bbox_size": [1, 2, 4]}')
    model = model_of([Link("a")])
    instance = Instance("o", "cup", "m", np.eye(4), True, bounding_box=np.array([2.0, 2.0, 2.0]))
    assert instance_scale(instance, model) == pytest.approx([1, 1, 1])
    model.metadata = read_metadata(folder.root, [])
    assert instance_scale(instance, model) == pytest.approx([2, 1, 0.5])
    assert instance_scale(
        Instance("o", "cup", "m", np.eye(4), True, scale=np.array([1, 2, 3.0])), model
    ) == pytest.approx([1, 2, 3])
    assert instance_scale(Instance("o", "cup", "m", np.eye(4), True), model) == pytest.approx([1, 1, 1])


@pytest.mark.parametrize("s", [(0, 1, 1), (1, -1, 1), (np.nan, 1, 1), (np.inf, 1, 1)])
def test_impossible_scales_are_refused(s):
    with pytest.raises(InputError, match=r"m.urdf.*model 'm'.*not positive"):
        scale_model(model_of([Link("a")]), s)


def test_very_uneven_scales_are_warned_of():
    assert any("unevenly" in w for w in scale_model(model_of([Link("a")]), (4, 1, 1)).warnings)
    assert not scale_model(model_of([Link("a")]), (3, 1, 1)).warnings
