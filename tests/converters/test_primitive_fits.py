"""A convex hull that is a box, a cylinder or a sphere is recognised with its exact size; what is not, is not."""

import numpy as np
import pytest
import scipy.spatial.transform
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from ig2mj_converters.hulls import convex, fitting

length = st.floats(0.005, 3.0)
pose = st.builds(
    lambda a, b, c, x, y, z: (scipy.spatial.transform.Rotation.from_euler("xyz", [a, b, c]).as_matrix(), (x, y, z)),
    *[st.floats(-3.1, 3.1)] * 3,
    *[st.floats(-10.0, 10.0)] * 3,
)


def moved(vertices, where):
    rotation, position = where
    hull = convex.hull_of(np.asarray(vertices) @ rotation.T + np.array(position))
    assert hull is not None
    return hull


def same_points(fit, hull, tolerance):
    """The primitive's own hull and the given one are within `tolerance` of each other."""
    own = fitting.primitive_hull(fit.kind, fit.size, fit.pose)
    away = max(convex.distance_outside(own.vertices, hull), convex.distance_outside(hull.vertices, own))
    assert away <= tolerance


@settings(max_examples=20, deadline=None)
@given(st.tuples(length, length, length), pose)
def test_a_box_in_any_pose_is_a_box_of_its_size(size, where):
    hull = moved(trimesh.creation.box(size).vertices, where)
    fit = fitting.fit_primitive(hull)
    assert fit is not None and fit.kind == "box"
    np.testing.assert_allclose(sorted(fit.size), sorted(size), rtol=1e-6)
    assert np.linalg.det(fit.pose[:3, :3]) == pytest.approx(1.0)
    same_points(fit, hull, 1e-6 * hull.diagonal)
    assert abs(fit.volume_error) < 1e-6 and fit.distance < 1e-6 * hull.diagonal


@settings(max_examples=12, deadline=None)
@given(st.floats(0.01, 1.0), st.floats(0.02, 3.0), st.sampled_from([16, 24, 32]), pose)
def test_a_cylinder_in_any_pose_is_a_cylinder_of_its_size(radius, height, sections, where):
    hull = moved(trimesh.creation.cylinder(radius, height, sections=sections).vertices, where)
    fit = fitting.fit_primitive(hull)
    assert fit is not None and fit.kind == "cylinder"
    np.testing.assert_allclose(fit.size, (radius, height), rtol=1e-5)
    flats = 1 - np.cos(np.pi / sections)
    assert fit.distance == pytest.approx(flats * radius, rel=1e-3)
    assert fit.volume_error == pytest.approx(np.pi / (sections * np.sin(2 * np.pi / sections) / 2) - 1, rel=1e-3)


@settings(max_examples=8, deadline=None)
@given(st.floats(0.01, 2.0), st.integers(1, 3), pose)
def test_a_sphere_anywhere_is_a_sphere_of_its_size(radius, subdivisions, where):
    hull = moved(trimesh.creation.icosphere(subdivisions, radius).vertices, where)
    fit = fitting.fit_primitive(hull)
    assert fit is not None and fit.kind == "sphere"
    np.testing.assert_allclose(fit.size, (radius,), rtol=1e-6)
    np.testing.assert_allclose(fit.pose[:3, 3], where[1], atol=1e-6 * max(1.0, radius))


NOT_PRIMITIVE = {
    "cone": trimesh.creation.cone(0.3, 1.0).vertices,
    "capsule": trimesh.creation.capsule(0.5, 0.2).vertices,
    "tetrahedron": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]),
    "wedge": np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1.0]]),
    "hexagonal prism": trimesh.creation.cylinder(0.3, 1.0, sections=6).vertices,
    "octagonal prism": trimesh.creation.cylinder(0.3, 1.0, sections=8).vertices,
    "egg": trimesh.creation.icosphere(2).vertices * [1.0, 1.0, 1.1],
    "oval cylinder": trimesh.creation.cylinder(0.3, 1.0, sections=32).vertices * [1.0, 1.1, 1.0],
    "tapered box": np.concatenate(
        [trimesh.creation.box((1, 1, 1)).vertices[:4], 0.9 * trimesh.creation.box((1, 1, 1)).vertices[4:]]
    ),
    "dome": trimesh.creation.icosphere(3).slice_plane([0, 0, 0], [0, 0, 1], cap=False).vertices,
}


@pytest.mark.parametrize("name", NOT_PRIMITIVE)
def test_what_only_resembles_a_primitive_is_rejected(name):
    hull = convex.hull_of(NOT_PRIMITIVE[name])
    assert fitting.fit_primitive(hull) is None


def test_a_cube_is_no_sphere_although_its_corners_lie_on_one():
    assert fitting.fit_sphere(convex.hull_of(trimesh.creation.box((1, 1, 1)).vertices)) is None


def test_an_upright_box_keeps_the_axes_of_its_link():
    fit = fitting.fit_box(convex.hull_of(trimesh.creation.box((0.1, 2.0, 0.5)).vertices + np.array([1, 2, 3])))
    np.testing.assert_array_equal(fit.pose[:3, :3], np.eye(3))
    np.testing.assert_allclose(fit.size, (0.1, 2.0, 0.5))


@pytest.mark.parametrize(
    ("kind", "size"), [("box", (1, 2, 3)), ("cylinder", (0.4, 1.5)), ("sphere", (0.7,)), ("capsule", (0.3, 1.0))]
)
def test_volume_of_a_primitive_is_that_of_its_polyhedron_within_the_facets(kind, size):
    hull = fitting.primitive_hull(kind, size, np.eye(4))
    exact = fitting.primitive_volume(kind, size)
    assert 0.93 * exact <= hull.volume <= exact * (1 + 1e-9)
