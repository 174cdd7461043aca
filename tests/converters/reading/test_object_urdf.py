"""iGibson's object folders, their URDF and metadata; plain URDFs of other sources."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ig2mj_converters.base.description import Mimic
from ig2mj_converters.bodies.kinematics import link_poses, model_bounds
from ig2mj_converters.reading.dataset import Dataset
from ig2mj_converters.reading.urdf import read_urdf

from ig2mj.errors import InputError


def read(root, *inside, make, **meshes):
    """The model of a URDF in a plain folder."""
    for name, content in meshes.items():
        root.write(f"plain/{name.replace('_obj', '.obj')}", content)
    return read_urdf(root.write("plain/x.urdf", make.robot(*inside)), "thing", "x")


def test_the_base_is_the_first_link_that_is_no_child(root, make):
    model = read(
        root, make.link("door"), make.link("base_link"), make.joint("j", "revolute", "base_link", "door"), make=make
    )
    assert model.base == "base_link"
    assert list(model.links) == ["door", "base_link"]


def test_links_that_hang_on_nothing_are_left_out_with_a_warning(root, make):
    model = read(root, make.link("a"), make.link("b"), make.link("c"), make.joint("j", "fixed", "b", "c"), make=make)
    assert list(model.links) == ["a"]
    assert not model.joints
    assert any("b, c" in w for w in model.warnings)


def test_a_cycle_beside_a_proper_root_is_still_a_cycle(root, make):
    links = [make.link(n) for n in "abc"]
    joints = [make.joint("j", "fixed", "b", "c"), make.joint("k", "fixed", "c", "b")]
    with pytest.raises(InputError, match="cycle"):
        read(root, *links, *joints, make=make)


def test_a_chain_of_thousands_of_links_is_read_in_linear_time(root, make):
    count = 3000
    chain = [make.link(f"l{i}") for i in range(count)]
    chain += [make.joint(f"j{i}", "fixed", f"l{i}", f"l{i + 1}", xyz=(0, 0, 0.001)) for i in range(count - 1)]
    assert link_poses(read(root, *chain, make=make))[f"l{count - 1}"][2, 3] == pytest.approx(0.001 * (count - 1))


def test_joints(root, make):
    """Numeric noise, -0.0, a closed pose that is not 0; axes are normalised; effort and velocity may be missing."""
    model = read(
        root,
        *(make.link(n) for n in "abcde"),
        make.joint("r", "revolute", "a", "b", make.axis(0, 0, -2), make.limit("0.03", "1.1e+0"), xyz=("0.", "-0.0", 1)),
        make.joint("p", "prismatic", "a", "c", make.axis(1, 0, 0), make.limit("1.1e-16", ".5")),
        make.joint(
            "k", "continuous", "a", "d", '<dynamics damping="0.1" friction="0.2"/><mimic joint="r" multiplier="2"/>'
        ),
        make.joint("f", "floating", "a", "e", rpy=(0, 0, 3.141592653589793)),
        make=make,
    )
    r, p, k, f = (model.joints[n] for n in "rpkf")
    assert (r.lower, r.upper, r.effort) == (0.03, 1.1, None)
    assert r.axis == pytest.approx([0, 0, -1])
    assert r.origin[:3, 3] == pytest.approx([0, 0, 1])
    assert (p.lower, p.upper) == (1.1e-16, 0.5)
    assert (k.lower, k.upper, k.damping, k.friction) == (None, None, 0.1, 0.2)
    assert k.axis == pytest.approx([1, 0, 0]), "URDF's default axis"
    assert k.mimic == Mimic("r", 2.0, 0.0)
    assert f.origin[:3, :3] == pytest.approx(np.diag([-1, -1, 1]), abs=1e-12)


@pytest.mark.parametrize(
    ("inside", "limits", "warning"),
    [
        ('<limit lower="0.5" upper="-0.5"/>', (None, None), "lower 0.5 > upper -0.5"),
        ("", (None, None), "without limits"),
        ('<limit effort="inf" velocity="0"/>', (None, None), "without limits"),
        ('<limit lower="0" upper="0"/>', (0, 0), None),
    ],
)
def test_limits_as_bullet_takes_them(root, make, inside, limits, warning):
    model = read(root, make.link("a"), make.link("b"), make.joint("j", "revolute", "a", "b", inside), make=make)
    assert (model.joints["j"].lower, model.joints["j"].upper) == limits
    assert not model.warnings if warning is None else warning in model.warnings[0]


@pytest.mark.parametrize("target", ["x", "j", "k", "f"])
def test_a_broken_mimic_is_left_out_with_a_warning(root, make, target):
    """Bullet ignores mimic: of nothing, of itself, in a ring, of a fixed joint."""
    model = read(
        root,
        *(make.link(n) for n in "abcd"),
        make.joint("j", "continuous", "a", "b", f'<mimic joint="{target}"/>'),
        make.joint("k", "continuous", "a", "c", '<mimic joint="j"/>'),
        make.joint("f", "fixed", "a", "d"),
        make=make,
    )
    assert model.joints["j"].mimic is None
    assert any("joint 'j'" in w for w in model.warnings)


def test_inertial_in_its_own_axes(root, make):
    inertial = (
        f'<inertial>{make.origin((1, 2, 3), (0, 0, 1.5707963267948966))}<mass value="2"/>'
        '<inertia ixx="1" ixy="0.1" ixz="0.2" iyy="3" iyz="0.3" izz="4"/></inertial>'
    )
    found = read(root, make.link("a", inertial), make.link("b"), make.joint("j", "fixed", "a", "b"), make=make).links
    assert found["a"].inertial.mass == 2
    assert found["a"].inertial.inertia == pytest.approx(np.array([[1, 0.1, 0.2], [0.1, 3, 0.3], [0.2, 0.3, 4]]))
    assert found["a"].inertial.pose[:3, 3] == pytest.approx([1, 2, 3])
    assert found["b"].inertial is None


def test_primitives_and_colours(root, make):
    def visual(geometry, material=""):
        return f"<visual><geometry>{geometry}</geometry>{material}</visual>"

    model = read(
        root,
        '<material name="red"><color rgba="1 0 0 0.5"/></material>',
        make.link(
            "a",
            visual('<box size="1 2 3"/>', '<material name="red"/>'),
            visual('<cylinder radius="1" length="2"/>', '<material name="x"><color rgba="0 2 0 0"/></material>'),
            visual('<sphere radius="1"/>', '<material name="unknown"/>'),
            visual('<capsule radius="1" length="2"/>'),
        ),
        make=make,
    )
    shapes = model.links["a"].visuals
    assert [(s.kind, s.size) for s in shapes] == [
        ("box", (1, 2, 3)),
        ("cylinder", (1, 2)),
        ("sphere", (1,)),
        ("capsule", (1, 2)),
    ]
    assert [s.rgba for s in shapes] == [(1, 0, 0, 0.5), (0, 1, 0, 1), None, None]
    assert model_bounds(model, visuals=True).tolist() == [[-1, -1, -2], [1, 1, 2]]


def test_simplified_replaces_the_urdf_and_keeps_its_boxes(root, make):
    box = '<collision><geometry><box size="0.2 0.2 0.01"/></geometry></collision>'
    root.write(
        "objects/cup/m/m_simplified.urdf",
        make.robot(make.link("base_link", make.shape("collision", "shape/c.obj"), box)),
    )
    model = Dataset(root.root).model("cup", "m")
    assert model.file.name == "m_simplified.urdf"
    assert [s.kind for s in model.links["base_link"].collisions] == ["mesh", "box"]


def test_encrypted_visuals_are_known_by_name_and_never_parsed(root, make):
    """4.5: named so in the URDF, or standing where the named file is missing."""
    root.object(
        make.robot(
            make.link("a", make.shape("visual", "shape/v.encrypted.obj"), make.shape("visual", "shape/w.obj")),
        ),
        meshes={"shape/v.encrypted.obj": "\0binary", "shape/w.encrypted.obj": "\0binary"},
    )
    model = Dataset(root.root).model("cup", "m")
    assert [(s.encrypted, s.meshes, s.file.name) for s in model.links["a"].visuals] == [
        (True, [], "v.encrypted.obj"),
        (True, [], "w.encrypted.obj"),
    ]
    assert not model.warnings


def test_a_visual_that_cannot_be_read_is_a_warning(root, make):
    root.object(
        make.robot(make.link("a", *(make.shape("visual", f"shape/{n}.obj") for n in ("gone", "empty", "v")))),
        meshes={"shape/empty.obj": "# nothing\n", "shape/v.obj": make.box_obj()},
    )
    model = Dataset(root.root).model("cup", "m")
    assert len(model.links["a"].visuals) == 1
    assert ["gone.obj" in model.warnings[0], "empty.obj" in model.warnings[1]] == [True, True]


@pytest.mark.parametrize(
    "geometry", ["<sphere radius='0'/>", "<plane/>", "", "<sphere radius='1'/><sphere radius='1'/>"]
)
def test_a_visual_primitive_that_makes_no_sense_is_a_warning(root, make, geometry):
    """Real robot files have spheres of radius 0 and visuals with two geometries."""
    model = read(root, make.link("a", f"<visual><geometry>{geometry}</geometry></visual>"), make=make)
    assert not model.links["a"].visuals
    assert "left out" in model.warnings[0]


def test_a_visual_outside_the_root_is_an_error_all_the_same(root, make):
    root.object(make.robot(make.link("a", make.shape("visual", "../../../../x.obj"))))
    with pytest.raises(InputError, match=r"m.urdf.*link 'a'.*outside the dataset root"):
        Dataset(root.root).model("cup", "m")


def test_metadata_of_a_model_is_read(root):
    root.write(
        "objects/cup/m/misc/metadata.json",
        json.dumps(
            {
                "bbox_size": [0.1, 0.2, 0.4],
                "base_link_offset": [0, 0, 0.2],
                "orientations": [{"rotation": [0, 0, 1, 0], "prob": 0.5, "variation": 0, "size": [0.1, 0.2, 0.4]}],
                "links": {
                    "toggle_button": [1, 2, 3],
                    "slicer": {"geometry": "box", "size": [1, 1, 1], "xyz": [0, 0, 0]},
                },
                "openable_joint_ids": [[0, "joint_0"], [3, "joint_1", -1]],
                "openable_both_sides": True,
                "object_parts": [{"category": "half_cup", "model": "h", "pos": [1, 0, 0], "orn": [1, 0, 0, 0]}],
                "link_bounding_boxes": {"base_link": {"collision": None}},
            }
        ),
    )
    model = Dataset(root.root).model("cup", "m")
    data = model.metadata
    assert data.orientations[0].quat == pytest.approx([0, 0, 0, 1])
    assert data.links["toggle_button"].xyz == pytest.approx([1, 2, 3]), "the oldest form is a bare point"
    assert data.links["toggle_button"].geometry is None
    assert data.links["slicer"].geometry == "box"
    assert data.openable_joints == [("joint_0", 1), ("joint_1", -1)]
    assert data.openable_both_sides
    assert data.object_parts[0].quat == pytest.approx([0, 1, 0, 0])
    assert data.raw["link_bounding_boxes"] == {"base_link": {"collision": None}}
    assert any("joint_0" in w for w in model.warnings), "the URDF has no such joint"


def test_without_metadata_bbox_json_then_nothing(root):
    (root.root / "objects/cup/m/misc/metadata.json").unlink()
    root.write("objects/cup/m/misc/bbox.json", '{"max": [1, 2, 3], "min": [0, 0, -1]}')
    data = Dataset(root.root).model("cup", "m").metadata
    assert data.bbox_size == pytest.approx([1, 2, 4])
    assert data.base_link_offset == pytest.approx([0.5, 1, 1])
    (root.root / "objects/cup/m/misc/bbox.json").unlink()
    model = Dataset(root.root).model("cup", "m")
    assert model.metadata.bbox_size is None
    assert any("no misc/metadata.json" in w for w in model.warnings)


# ---- plain URDFs


@pytest.mark.parametrize(
    ("urdf", "name", "manifest"),
    [
        ("ws/bot_description/urdf/x.urdf", "package://bot_description/meshes/a.obj", None),
        ("ws/bot_description/urdf/x.urdf", "model://bot_description/meshes/a.obj", None),
        ("ws/checkout/urdf/deep/x.urdf", "package://bot_description/meshes/a.obj", "ws/checkout/package.xml"),
        ("ws/other/x.urdf", "package://bot_description/meshes/a.obj", "ws/bot_description/package.xml"),
        ("ws/bot_description/urdf/x.urdf", "../meshes/a.obj", None),
        ("ws/bot_description/a/b/x.urdf", "../../meshes/a.obj", "ws/bot_description/package.xml"),
        ("ws/bot_description/x.urdf", "meshes\\a.obj", None),
        ("ws/bot_description/x.urdf", "package://meshes/a.obj", None),
        ("ws/x.urdf", "package://bot_description/meshes/a.obj", None),
    ],
)
def test_ros_packages_are_found_by_walking_up(root, make, urdf, name, manifest):
    home = "ws/checkout" if manifest and "checkout" in manifest else "ws/bot_description"
    root.write(f"{home}/meshes/a.obj", make.box_obj())
    if manifest:
        root.write(manifest, "<?xml version='1.0'?><package><name>bot_description</name></package>")
    file = root.write(urdf, make.robot(make.link("a", make.shape("collision", name))))
    assert model_bounds(read_urdf(file, "bot", "x")) is not None


def test_groups_of_a_plain_obj_are_pieces_only_if_they_are_convex(root, make):
    """Blender writes `o` for any object; in the dataset a group is one hull by convention."""
    corner = make.boxes_obj(((1, 1, 1), (0, 0, 0)), ((1, 1, 1), (3, 0, 0)))
    table = corner.replace("o convex_1\n", "")
    assert len(corner) > len(table)
    link = make.link("a", make.shape("collision", "c.obj"))
    assert read(root, link, make=make, c_obj=corner).links["a"].collisions[0].grouped
    assert not read(root, link, make=make, c_obj=table).links["a"].collisions[0].grouped
    root.write("objects/cup/m/shape/c.obj", table)
    assert Dataset(root.root).model("cup", "m").links["base_link"].collisions[0].grouped


def test_a_negative_mesh_scale_is_a_mirror(root, make):
    link = make.link("a", make.shape("collision", "c.obj", scale="1 -2 1"))
    shape = read(root, link, make=make, c_obj=make.box_obj(centre=(0, 1, 0))).links["a"].collisions[0]
    assert shape.scale == (1, -2, 1)
    assert read(root, link.replace("1 -2 1", "2"), make=make).links["a"].collisions[0].scale == (2, 2, 2)


@given(st.binary(max_size=200), st.integers(0, 400))
def test_damaged_files_never_crash_the_reader(tmp_path_factory, make, damage, at):
    """Any bytes anywhere in URDF, mesh or metadata: read, or an InputError."""
    folder = tmp_path_factory.mktemp("damaged")
    urdf = make.robot(make.link("a", make.shape("collision", "c.obj"), make.shape("visual", "c.stl"))).encode()
    files = {"x.urdf": urdf, "c.obj": make.box_obj().encode(), "c.stl": b"solid\n"}
    for victim in files:
        for name, content in files.items():
            at_most = min(at, len(content))
            broken = content[:at_most] + damage + content[at_most + len(damage) :]
            (folder / name).write_bytes(broken if name == victim else content)
        try:
            read_urdf(folder / "x.urdf", "thing", "x")
        except InputError as e:
            assert str(folder) in str(e)


def test_an_origin_may_have_a_quaternion(root, make):
    """`quat_xyzw` of URDF 1.2: x, y, z, w."""
    quarter = '<origin xyz="1 2 3" quat_xyzw="0 0 2 2"/>'
    box = f'<collision>{quarter}<geometry><box size="1 1 1"/></geometry></collision>'
    (shape,) = read(root, make.link("a", box), make=make).links["a"].collisions
    np.testing.assert_allclose(shape.pose, [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize(
    ("origin", "problem"),
    [('rpy="0 0 1" quat_xyzw="0 0 0 1"', "both rpy and quat_xyzw"), ('quat_xyzw="0 0 0 0"', "length zero")],
)
def test_an_origin_with_no_or_two_rotations_is_refused(root, make, origin, problem):
    with pytest.raises(InputError, match=problem):
        read(root, make.link("a"), make.link("b"), make.joint("j", "fixed", "a", "b").replace(
            '<origin xyz="0 0 0" rpy="0 0 0"/>', f"<origin {origin}/>"), make=make)  # fmt: skip


@pytest.mark.parametrize(
    ("rpy", "kind", "limits", "warned"),
    [
        ("0 0 90", "revolute", ("-1.5", "1.5"), 1),
        ("0 0 1.57", "revolute", ("-90", "90"), 2),
        ("6.28 0 -6.28", "revolute", ("-12.56", "12.56"), 0),
        ("0 0 1.57", "prismatic", ("-90", "90"), 0),
        ("0 0 1.57", "revolute", ("-10000", "10000"), 0),
    ],
)
def test_angles_that_are_hardly_radians_are_read_with_a_warning(root, make, rpy, kind, limits, warned):
    joint = make.joint("j", kind, "a", "b", make.limit(*limits), rpy=rpy.split())
    model = read(root, make.link("a"), make.link("b"), joint, make=make)
    assert sum("in degrees?" in warning for warning in model.warnings) == warned
    assert model.joints["j"].upper == float(limits[1])


def test_a_mesh_whose_name_has_other_capitals_is_named(root, make):
    with pytest.raises(InputError, match=r"'C\.obj' does not exist \(the file is called 'c\.obj'\)"):
        read(root, make.link("a", make.shape("collision", "C.obj")), make=make, c_obj=make.box_obj())
