"""A link's collision shapes become convex pieces that fill what the source fills, and nothing else."""

import pickle

import numpy as np
import pytest
import trimesh
from ig2mj_converters.base.description import Mesh, Shape
from ig2mj_converters.hulls import convex
from ig2mj_converters.hulls.coacd_process import DecompositionError
from ig2mj_converters.hulls.link_hulls import HullOptions, decompose_link

NO_CACHE = HullOptions(cache=False)


@pytest.fixture
def no_coacd(monkeypatch):
    """Fails the test's link, visibly, if a general decomposition is started."""

    def refuse(*_, **__):
        raise DecompositionError("was not to be started")

    monkeypatch.setattr("ig2mj_converters.hulls.coacd_process.run_coacd", refuse)


def shape(*meshes, grouped=False, **more):
    return Shape(
        "mesh",
        meshes=[Mesh(np.asarray(m.vertices), np.asarray(m.faces), f"group_{i}") for i, m in enumerate(meshes)],
        grouped=grouped,
        **more,
    )


def box(size, at=(0, 0, 0)):
    return trimesh.creation.box(size).apply_translation(at)


def soup(*meshes):
    return trimesh.util.concatenate(meshes)


def table():
    legs = [box((0.05, 0.05, 0.7), (x, y, 0.35)) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    return soup(box((1.2, 0.8, 0.04), (0, 0, 0.72)), *legs)


def filled(result, points):
    """Which points are inside any piece."""
    hulls = [convex.hull_of(p.vertices) for p in result.pieces]
    return np.any([h.contains(np.atleast_2d(points), 1e-9) for h in hulls], axis=0)


def outline(result):
    corners = np.concatenate([p.vertices for p in result.pieces])
    return np.ptp(corners, axis=0)


def test_each_group_is_one_hull_fact_4(no_coacd):
    wedge = trimesh.convex.convex_hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1.0]])
    result = decompose_link([shape(box((1, 1, 0.1)), wedge, box((0.1, 0.1, 1)), grouped=True)], NO_CACHE)
    assert result.before == result.after == 3
    assert result.kinds() == {"box": 2, "hull": 1}
    assert {p.source for p in result.pieces} == {"group"}
    assert result.volume_error == pytest.approx(0, abs=1e-6)


def test_a_table_without_groups_is_not_filled(no_coacd):
    result = decompose_link([shape(table())], NO_CACHE)
    assert result.kinds() == {"box": 5}
    assert not filled(result, [0, 0, 0.35]).any()
    assert filled(result, [[0, 0, 0.72], [0.5, 0.3, 0.1]]).all()
    assert result.volume == pytest.approx(result.source_volume, rel=0.02)


def test_a_wall_with_a_door_in_one_mesh_stays_open(no_coacd):
    wall = box((8, 0.2, 2.5), (0, 0, 1.25)).difference(box((0.9, 1, 2.0), (1, 0, 0.95)))
    result = decompose_link([shape(wall)], NO_CACHE)
    assert result.kinds() == {"box": 3}
    assert not filled(result, [1, 0, 1.0]).any()
    assert filled(result, [[1, 0, 2.2], [0, 0, 1.0], [3, 0, 1]]).all()
    assert result.volume == pytest.approx(8 * 0.2 * 2.5 - 0.9 * 0.2 * 1.95, rel=1e-6)


def test_real_house_walls_keep_their_doors(shared_data, no_coacd):
    files = sorted((shared_data / "small_house").rglob("wall_cm_original.obj"))
    if not files:
        pytest.skip("the unsplit walls are not in this copy of the test data")
    mesh = trimesh.load(files[0], force="mesh", process=False)
    assert isinstance(mesh, trimesh.Trimesh)
    largest = max(mesh.split(only_watertight=False), key=lambda part: part.area)
    result = decompose_link([shape(largest)], HullOptions(cache=False, max_hulls=None))
    assert {p.kind for p in result.pieces} == {"box"} and 10 < len(result.pieces) < 40
    assert result.volume == pytest.approx(result.source_volume, rel=1e-3)
    hull = convex.hull_of(largest.vertices)
    assert result.volume < 0.1 * hull.volume
    np.testing.assert_allclose(outline(result), np.ptp(largest.vertices, axis=0), rtol=1e-6)


def test_walls_are_never_merged_without_a_budget():
    segments = [shape(box((1, 0.2, 2.5), (2.0 * i, 0, 1.25))) for i in range(30)]
    assert decompose_link(segments, HullOptions(cache=False, max_hulls=None)).after == 30
    assert decompose_link(segments, HullOptions(cache=False, max_hulls=16)).after == 16


def test_an_l_shape_without_groups_is_cut_up():
    angle = soup(
        trimesh.creation.extrude_polygon(_polygon([(0, 0), (1, 0), (1, 0.1), (0.3, 0.25), (0.1, 1), (0, 1)]), 0.2)
    )
    result = decompose_link([shape(angle)], NO_CACHE)
    assert "coacd" in result.method
    assert not filled(result, [0.6, 0.6, 0.1]).any()
    assert result.volume == pytest.approx(angle.volume, rel=0.1)
    np.testing.assert_allclose(outline(result), np.ptp(angle.vertices, axis=0), rtol=0.015)


def _polygon(points):
    import shapely

    return shapely.Polygon(points)


def test_a_mesh_turned_inside_out_counts_as_what_it_encloses(no_coacd):
    mesh = table()
    mesh.invert()
    result = decompose_link([shape(mesh)], NO_CACHE)
    assert result.kinds() == {"box": 5} and result.source_volume == pytest.approx(table().volume, rel=0.03)


def test_a_box_without_its_bottom_is_a_box(no_coacd):
    mesh = box((1, 1, 1))
    mesh.update_faces(mesh.face_normals[:, 2] > -0.5)
    result = decompose_link([shape(mesh)], NO_CACHE)
    assert result.kinds() == {"box": 1} and not result.warnings


def test_a_box_without_its_lid_is_hollow():
    mesh = box((1, 1, 1))
    mesh.update_faces(mesh.face_normals[:, 2] < 0.5)
    result = decompose_link([shape(mesh)], NO_CACHE)
    assert any("hollow" in w for w in result.warnings)
    assert not filled(result, [0, 0, 0.2]).any()


@pytest.mark.slow
def test_a_bowl_of_a_single_sheet_stays_open_within_the_budget(no_coacd):
    bowl = trimesh.creation.icosphere(3, 0.2)
    bowl.update_faces(bowl.triangles_center[:, 2] < 0)
    result = decompose_link([shape(bowl)], NO_CACHE)
    assert 16 <= result.after <= 24 and result.before > 100
    assert not filled(result, [[0, 0, -0.02], [0, 0, -0.1], [0.1, 0, -0.05]]).any()
    np.testing.assert_allclose(outline(result), [0.4, 0.4, 0.2], rtol=0.015)


def test_doubled_faces_do_not_spoil_the_volume(no_coacd):
    """PartNet-Mobility's double-sided meshes enclose a signed volume of about 0."""
    mesh = table()
    double = trimesh.Trimesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]), process=False)
    result = decompose_link([shape(double)], NO_CACHE)
    assert result.kinds() == {"box": 5} and result.source_volume == pytest.approx(mesh.volume, rel=0.03)


def test_small_groups_go_and_flat_ones_are_thickened():
    triangle = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    plate = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    result = decompose_link([shape(triangle, plate, grouped=True)], NO_CACHE)
    assert [p.kind for p in result.pieces] == ["box"]
    assert sorted(result.pieces[0].size) == pytest.approx([1e-3, 1, 1])
    assert len(result.warnings) == 2
    assert "3 distinct points" in result.warnings[0] and "thickened" in result.warnings[1]


def test_identical_and_contained_groups_are_kept_once():
    same = [box((1, 1, 1)), box((1, 1, 1)), box((0.2, 0.2, 0.2))]
    assert decompose_link([shape(*same, grouped=True)], NO_CACHE).after == 1


def test_a_group_that_is_not_convex_is_cut_up_and_reported(no_coacd):
    """Blender names a whole table one object; one hull of it would be a solid block."""
    result = decompose_link([shape(table(), grouped=True)], NO_CACHE)
    assert result.after == 5 and any("not convex" in w for w in result.warnings)


def test_primitives_of_the_source_stay_exact_and_scale():
    pose = trimesh.transformations.translation_matrix([1, 2, 3])
    given = [
        Shape("box", pose, (1, 2, 3), scale=(2, 1, 0.5)),
        Shape("sphere", np.eye(4), (0.5,), scale=(2, 2, 2)),
        Shape("cylinder", np.eye(4), (0.2, 1.0), scale=(1, 1, 3)),
    ]
    result = decompose_link(given, NO_CACHE)
    assert [(p.kind, p.size) for p in result.pieces] == [
        ("box", (2, 2, 1.5)), ("sphere", (1.0,)), ("cylinder", (0.2, 1.0)),
    ]  # fmt: skip
    np.testing.assert_array_equal(result.pieces[0].pose, pose)
    assert len(result.warnings) == 1 and "unevenly" in result.warnings[0]


def test_scale_is_in_mesh_axes_before_the_pose():
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1])
    result = decompose_link([shape(box((1, 1, 1)), scale=(3, 2, 1), pose=turn)], NO_CACHE)
    np.testing.assert_allclose(outline(result), [2, 3, 1], atol=1e-9)


def test_a_mirroring_scale_does_not_turn_things_inside_out(no_coacd):
    result = decompose_link([shape(table(), scale=(-1, 1, 1))], NO_CACHE)
    assert result.kinds() == {"box": 5} and not result.warnings


@pytest.mark.parametrize(
    "mesh",
    [
        Mesh(np.zeros((0, 3)), np.zeros((0, 3), int)),
        Mesh(np.full((8, 3), np.nan), np.arange(6).reshape(2, 3)),
        Mesh(np.random.default_rng(0).random((5, 3)), np.array([[0, 1, 99]])),
        Mesh(np.zeros((9, 3)), np.arange(9).reshape(3, 3)),
    ],
    ids=["empty", "not a number", "index out of range", "one point"],
)
@pytest.mark.parametrize("grouped", [True, False])
def test_useless_geometry_leaves_no_pieces_and_no_crash(mesh, grouped):
    result = decompose_link([Shape("mesh", meshes=[mesh], grouped=grouped)], NO_CACHE)
    assert result.pieces == [] and result.volume == 0


def test_a_shape_of_size_zero_is_left_out_with_a_warning():
    result = decompose_link([Shape("box", size=(1, 0, 1)), Shape("sphere", size=(float("nan"),))], NO_CACHE)
    assert result.pieces == [] and len(result.warnings) == 2


def test_hulls_have_at_most_the_asked_vertices_and_say_what_that_cost():
    result = decompose_link([shape(trimesh.creation.capsule(0.5, 0.2))], NO_CACHE)
    (piece,) = result.pieces
    assert piece.kind == "hull" and len(piece.vertices) <= 32
    assert 0 < piece.fit_error < 0.05 and abs(result.volume_error) < 0.03
    assert (
        len(
            decompose_link([shape(trimesh.creation.capsule(0.5, 0.2))], HullOptions(cache=False, max_hull_vertices=64))
            .pieces[0]
            .vertices
        )
        > 32
    )


@pytest.mark.parametrize("wrong", [{"max_hulls": 0}, {"max_hull_vertices": 4}])
def test_a_budget_that_cannot_be_met_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        HullOptions(**wrong)


def test_input_and_result_travel_to_worker_processes():
    given = pickle.loads(pickle.dumps(([shape(table())], NO_CACHE)))
    result = pickle.loads(pickle.dumps(decompose_link(*given)))
    assert result.after == 5
