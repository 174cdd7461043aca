"""iGibson's rules of mass, centre of mass, inertia."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ig2mj_converters.base.description import Inertial, Joint, Link, Mesh, Metadata, ObjectModel, Shape
from ig2mj_converters.base.transforms import pose_from
from ig2mj_converters.bodies.inertia import MIN_MASS, is_possible, link_inertials
from ig2mj_converters.bodies.solids import shape_solids
from ig2mj_converters.reading.dataset import Dataset
from ig2mj_converters.reading.scaling import scale_model

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))])


def box_mesh(size=(1, 1, 1), centre=(0, 0, 0)) -> Mesh:
    return Mesh(CORNERS * size + centre, TRIANGLES)


def boxes(*items, grouped=True, pose=None) -> Shape:
    return Shape("mesh", np.eye(4) if pose is None else pose, meshes=[box_mesh(*i) for i in items], grouped=grouped)


def fixed_or(kind, parent, child, xyz=(0, 0, 0)) -> Joint:
    return Joint(f"to_{child}", kind, parent, child, pose_from(np.array(xyz), np.zeros(3)), np.array([0, 0, 1.0]))


def model_of(*links, joints=(), bbox=(1, 1, 1), category="cup") -> ObjectModel:
    size = None if bbox is None else np.array(bbox, dtype=float)
    return ObjectModel(
        category,
        "m",
        "m.urdf",
        {x.name: x for x in links},
        {j.name: j for j in joints},
        links[0].name,
        Metadata(bbox_size=size, base_link_offset=np.zeros(3)),
    )


def inertials(model, density=100.0, s=1.0, bullet=False, rule="object"):
    scaled = scale_model(model, s)
    return link_inertials(scaled, density, bullet, rule), scaled.warnings


def test_mass_is_density_times_scaled_bounding_box():
    found, _ = inertials(model_of(Link("a", [boxes(((0.5, 0.5, 0.5), (0, 0, 0)))]), bbox=(1, 2, 3)), 10.0, (1, 2, 0.5))
    assert found["a"].mass == pytest.approx(10 * (1 * 2 * 3) * (1 * 2 * 0.5))


def test_density_of_a_category_without_spec_is_67(root):
    data = Dataset(root.root)
    assert data.density("cup") == 100
    assert data.density("unheard_of") == 67


def test_mass_is_split_by_collision_volume_overlaps_counted_twice():
    base = Link("a", [boxes(((1, 1, 1), (0, 0, 0)), ((1, 1, 1), (0.5, 0, 0)))])
    door = Link("b", [boxes(((1, 1, 0.5), (0, 0, 0)))])
    found, _ = inertials(model_of(base, door, joints=[fixed_or("revolute", "a", "b")]))
    assert found["a"].mass == pytest.approx(80)
    assert found["b"].mass == pytest.approx(20)


def test_links_with_boxes_only_get_no_mass_and_moving_ones_a_little():
    base = Link("a", [boxes(((1, 1, 1), (0, 0, 0)))])
    shelf, flap = Link("s", [Shape("box", size=(1.0, 1.0, 0.01))]), Link("f", [Shape("box", size=(1.0, 1.0, 0.01))])
    found, warnings = inertials(
        model_of(base, shelf, flap, joints=[fixed_or("fixed", "a", "s"), fixed_or("revolute", "a", "f")])
    )
    assert found["s"].mass == 0
    assert found["a"].mass == pytest.approx(100)
    assert found["f"].mass == MIN_MASS
    assert is_possible(found["f"].inertia)
    assert any("'f' has no mass" in w for w in warnings)


def test_an_object_of_primitives_only_is_split_by_their_volume():
    """iGibson would divide by zero here."""
    found, _ = inertials(
        model_of(
            Link("a", [Shape("box", size=(1.0, 1.0, 3.0))]),
            Link("b", [Shape("box", size=(1.0, 1.0, 1.0))]),
            joints=[fixed_or("revolute", "a", "b")],
        )
    )
    assert (found["a"].mass, found["b"].mass) == (pytest.approx(75), pytest.approx(25))


def test_a_base_without_collision_is_flagged():
    """Bullet would make a free object static."""
    door = Link("b", [boxes(((1, 1, 1), (0, 0, 0)))])
    found, warnings = inertials(model_of(Link("a"), door, joints=[fixed_or("revolute", "a", "b")]))
    assert found["a"].mass == MIN_MASS
    assert any("base has no mass" in w and "static" in w for w in warnings)


def test_com_of_a_watertight_mesh_is_the_volumes():
    wedge = Mesh(
        np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0], [0, 0, 4.0]]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    )
    found, _ = inertials(model_of(Link("a", [Shape("mesh", meshes=[wedge])])), s=(1, 2, 3))
    assert found["a"].pose[:3, 3] == pytest.approx([1, 2, 3])


def test_com_of_an_open_mesh_is_the_surfaces_taken_before_scaling():
    """An open box has five faces; the surface's centre of the unscaled mesh, then times s."""
    cube = box_mesh((2, 2, 2))
    open_box = Mesh(cube.vertices, cube.faces[(cube.vertices[cube.faces][:, :, 2] < 0.9).any(axis=1)])
    found, _ = inertials(model_of(Link("a", [Shape("mesh", meshes=[open_box])])), s=(1, 1, 10))
    assert found["a"].pose[:3, 3] == pytest.approx([0, 0, -0.2 * 10])


def test_touching_hulls_are_not_watertight_so_their_surface_counts():
    """Merged vertices of touching hulls give edges with four faces."""
    parts = boxes(((1, 1, 1), (0, 0, 0)), ((1, 1, 1), (1, 0, 0)), ((1, 1, 1), (2, 0, 0)))
    tall = boxes(((1, 1, 1), (0, 0, 0)), ((1, 1, 1), (1, 0, 0)))
    assert inertials(model_of(Link("a", [parts])))[0]["a"].pose[0, 3] == pytest.approx(1)
    assert inertials(model_of(Link("a", [tall])))[0]["a"].pose[0, 3] == pytest.approx(0.5)


def test_com_includes_the_collision_origin():
    found, _ = inertials(
        model_of(Link("a", [boxes(((1, 1, 1), (0, 0, 0)), pose=pose_from(np.array([1, 2, 3.0]), np.zeros(3)))])), s=2
    )
    assert found["a"].pose[:3, 3] == pytest.approx([2, 4, 6])
    assert found["a"].pose[:3, :3] == pytest.approx(np.eye(3))


def test_bullets_inertia_is_that_of_the_box_with_margin():
    """I = m/12 (ly^2 + lz^2, ...), l with 0.001 m margin on each side."""
    found, _ = inertials(model_of(Link("a", [boxes(((1, 2, 3), (0, 0, 0)))])), bullet=True)
    x, y, z = 1.002, 2.002, 3.002
    assert found["a"].inertia == pytest.approx(100 / 12 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y]))


def test_true_inertia_is_that_of_the_hulls():
    found, _ = inertials(model_of(Link("a", [boxes(((1, 2, 3), (5, 0, 0)))])))
    assert found["a"].inertia == pytest.approx(100 / 12 * np.diag([13, 10, 5]))
    dumbbell, _ = inertials(model_of(Link("a", [boxes(((1, 1, 1), (-5, 0, 0)), ((1, 1, 1), (5, 0, 0)))])))
    assert dumbbell["a"].inertia == pytest.approx(100 * np.diag([1 / 6, 1 / 6 + 25, 1 / 6 + 25]))


def test_inside_out_and_double_sided_meshes_use_hull_volumes():
    """PartNet originals enclose a signed volume of about 0."""
    cube = box_mesh()
    inside_out = Mesh(cube.vertices, cube.faces[:, ::-1])
    double = Mesh(np.concatenate([cube.vertices] * 2), np.concatenate([cube.faces, cube.faces[:, ::-1] + 8]))
    base, door = Link("a", [Shape("mesh", meshes=[inside_out])]), Link("b", [Shape("mesh", meshes=[double])])
    found, warnings = inertials(model_of(base, door, joints=[fixed_or("revolute", "a", "b")]))
    assert found["a"].mass == pytest.approx(50)
    assert found["b"].mass == pytest.approx(50)
    assert any("encloses no volume" in w for w in warnings)


def test_a_flat_mesh_has_a_possible_inertia():
    sheet = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    found, _ = inertials(model_of(Link("a", [Shape("mesh", meshes=[sheet])])))
    assert found["a"].mass == pytest.approx(100)
    assert is_possible(found["a"].inertia)
    assert found["a"].inertia == pytest.approx(100 / 12 * np.diag([1, 1, 2]), rel=1e-3, abs=1e-3)


def test_category_lamp_has_a_base_ten_times_as_heavy():
    links = [Link("a", [boxes(((1, 1, 1), (0, 0, 0)))]), Link("b", [boxes(((1, 1, 1), (0, 0, 0)))])]
    found, _ = inertials(model_of(*links, joints=[fixed_or("revolute", "a", "b")], category="lamp"))
    assert found["a"].mass == pytest.approx(100 * 10 / 11)


def test_building_parts_and_objects_without_box_keep_the_urdfs_inertial():
    given = Inertial(10000.0, np.eye(3))
    link = Link("a", [boxes(((1, 1, 1), (0, 0, 0)))], inertial=given)
    assert inertials(model_of(link), density=None)[0]["a"].mass == 10000
    assert inertials(model_of(link, bbox=None), density=100.0)[0]["a"].mass == 10000


def test_an_objects_inertial_is_thrown_away_within_a_dataset():
    """A basket in four sizes that weighs 1.056 kg by its URDF weighs density x box in each."""
    link = Link("a", [boxes(((1, 1, 1), (0, 0, 0)))], inertial=Inertial(1.056, np.eye(3)))
    for s in (0.5, 1.0, 1.5, 2.0):
        found, warnings = inertials(model_of(link), s=s, rule="dataset")
        assert found["a"].mass == pytest.approx(100 * s**3)
        assert any("mass of 1.06 kg is replaced" in w for w in warnings)
        assert inertials(model_of(link), s=s)[0]["a"].mass == 1.056, "a single object keeps it"
    assert inertials(model_of(link, bbox=None), rule="dataset")[0]["a"].mass == 1.056, "without a box it counts"
    meant = model_of(link)
    meant.metadata.keep_inertials = True
    assert inertials(meant, rule="dataset")[0]["a"].mass == 1.056


def test_a_link_without_inertial_weighs_nothing_where_its_body_has_one():
    """The inertia of a base on a fixed child, since KDL takes none on a root."""
    base = Link("a", [boxes(((0.6, 0.4, 0.3), (0, 0, 0)))])
    dummy = Link("i", inertial=Inertial(16.0, np.diag([0.3, 0.6, 0.7])))
    for rule in ("object", "robot"):
        found, warnings = inertials(model_of(base, dummy, joints=[fixed_or("fixed", "a", "i")], bbox=None), rule=rule)
        assert (found["a"].mass, found["i"].mass) == (0, 16)
        assert found["i"].inertia == pytest.approx(np.diag([0.3, 0.6, 0.7]))
        assert not warnings


def test_a_body_without_mass_has_none_in_a_robot_and_its_share_in_an_object():
    base = Link("a", [boxes(((1, 1, 1), (0, 0, 0)))], inertial=Inertial(5.0, np.eye(3) * 0.5))
    for massless in (None, Inertial(0.0, np.zeros((3, 3)))):
        door = Link("b", [boxes(((1, 1, 1), (0, 0, 0)))], inertial=massless)
        model = model_of(base, door, joints=[fixed_or("revolute", "a", "b")])
        robot, warnings = inertials(model, rule="robot")
        assert (robot["a"].mass, robot["b"].mass) == (5, MIN_MASS)
        assert any("'b' has no mass; " in w for w in warnings)
        found, warnings = inertials(model)
        assert (found["a"].mass, found["b"].mass) == (5, pytest.approx(50))
        assert any("'b' has no mass; 50 kg" in w for w in warnings)


@pytest.mark.parametrize("rule", ["object", "robot"])
def test_a_mass_of_zero_is_no_mass(rule):
    """A table of mass 0 gets the density rule, with a warning, and not a gram."""
    table = Link("a", [boxes(((1, 1, 1), (0, 0, 0)))], inertial=Inertial(0.0, np.zeros((3, 3))))
    found, warnings = inertials(model_of(table, bbox=None), density=None, rule=rule)
    assert found["a"].mass == pytest.approx(67)
    assert any("the URDF's inertials have no mass; 67 kg" in w for w in warnings)


@pytest.mark.parametrize("scale", [(0.001, 0.001, 0.001), (-0.001, 0.001, 0.001)])
def test_a_placeholder_inertia_is_found_with_a_mesh_scale(scale):
    shape = boxes(((100, 200, 300), (0, 0, 0)))
    shape.scale = scale
    found, warnings = inertials(model_of(Link("a", [shape], inertial=Inertial(1.0, np.eye(3))), bbox=None))
    assert found["a"].inertia == pytest.approx(np.diag([0.13, 0.10, 0.05]) / 12)
    assert any("radius of gyration 1 m" in w for w in warnings)


def test_an_inertia_of_a_whole_robot_on_a_small_link_is_kept():
    whole = Inertial(20.0, np.diag([2.0, 2.0, 2.0]))
    small, large = (
        Link("a", [boxes(((0.02,) * 3, (0, 0, 0)))], inertial=whole),
        Link("b", [boxes(((1,) * 3, (0, 0, 0)))]),
    )
    found, warnings = inertials(model_of(small, large, joints=[fixed_or("fixed", "a", "b")], bbox=None), rule="robot")
    assert found["a"].inertia == pytest.approx(whole.inertia) and not warnings


def test_a_missing_inertial_is_computed_and_an_impossible_one_mended():
    found, warnings = inertials(model_of(Link("a", [boxes(((1, 2, 3), (0, 0, 0)))]), bbox=None), density=None)
    assert found["a"].mass == pytest.approx(67 * 6)
    assert any("no inertial" in w for w in warnings)
    for tensor in (np.diag([1.0, 1.0, 5.0]), np.diag([-1.0, 1, 1]), np.zeros((3, 3))):
        link = Link("a", [boxes(((1, 2, 3), (0, 0, 0)))], inertial=Inertial(12.0, tensor))
        mended = inertials(model_of(link, bbox=None), density=None)[0]["a"]
        assert mended.mass == 12
        assert mended.inertia == pytest.approx(np.diag([13, 10, 5]))


def test_kept_inertials_follow_the_scale():
    """Origins times s; the mass stays, the inertia is that of the stretched body."""
    link = Link(
        "a",
        [boxes(((1, 2, 3), (0, 0, 0)))],
        inertial=Inertial(12.0, np.diag([13.0, 10, 5]), pose_from(np.array([1, 1, 1.0]), np.zeros(3))),
    )
    found = inertials(model_of(link, bbox=None), density=None, s=(1, 1, 2))[0]["a"]
    assert found.mass == 12
    assert found.pose[:3, 3] == pytest.approx([1, 1, 2])
    assert found.inertia == pytest.approx(np.diag([4 + 36, 1 + 36, 5]))


@given(
    kind=st.sampled_from(["box", "cylinder", "sphere", "capsule"]),
    size=st.tuples(*[st.floats(0.05, 2)] * 3),
    rpy=st.tuples(*[st.floats(-3, 3)] * 3),
    bullet=st.booleans(),
)
def test_every_solid_has_a_possible_inertia(kind, size, rpy, bullet):
    shape = Shape(
        kind, pose_from(np.array([0.1, 0, 0]), np.array(rpy)), size=size[: {"box": 3, "sphere": 1}.get(kind, 2)]
    )
    found, _ = inertials(model_of(Link("a", [shape])), bullet=bullet)
    assert found["a"].mass == pytest.approx(100)
    assert is_possible(found["a"].inertia)


@pytest.mark.parametrize(("kind", "size"), [("sphere", (0.5,)), ("cylinder", (0.5, 2.0)), ("capsule", (0.5, 1.0))])
def test_primitives_agree_with_their_meshes(kind, size):
    exact = shape_solids(Shape(kind, size=size))[0]
    meshed = scale_model(model_of(Link("a", [Shape(kind, size=size)])), (1, 1.0001, 1.0002)).links["a"].collisions[0]
    assert meshed.kind == "mesh"
    rough = shape_solids(meshed)[0]
    assert rough.volume == pytest.approx(exact.volume, rel=0.06)
    assert rough.covariance == pytest.approx(exact.covariance, rel=0.06, abs=1e-3)
