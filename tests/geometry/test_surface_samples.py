"""Surface samples: on the surface, even by area, normals outward, on the host and in JAX."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.geometry import surface
from ig2mj.geometry.hulls import signed_depth
from ig2mj.scene.tables import PieceKind

IDENTITY = np.array([1, 0, 0, 0], np.float32)


def table_of(shapes, index) -> surface.SurfaceTable:
    index = np.asarray(index)
    pos, quat = np.zeros((len(index), 3), np.float32), np.tile(IDENTITY, (len(index), 1))
    return surface.surface_table(shapes.kind[index], shapes.size[index], shapes.vertices[index], pos, quat)


@pytest.mark.parametrize("k", range(5), ids=["sphere", "capsule", "cylinder", "box", "hull"])
def test_points_lie_on_the_surface_with_outward_normals(shapes, k):
    sample = surface.sample_surface(table_of(shapes, [k]), 500, np.random.default_rng(0))
    tolerance = 0.02 * shapes.size[k, 0] if shapes.kind[k] != PieceKind.POLYHEDRON else 1e-5

    def depth(points):
        one = slice(k, k + 1)
        args = (shapes.kind[one], shapes.size[one], shapes.planes[one])
        return np.asarray(signed_depth(*args, points.astype(np.float32)))

    assert np.all(np.abs(depth(sample.points)) <= tolerance)
    assert np.all(depth(sample.points + 0.01 * sample.normals) < 0)
    np.testing.assert_allclose(np.linalg.norm(sample.normals, axis=-1), 1.0, atol=1e-9)


def test_areas_are_those_of_the_formulas(shapes):
    r, h = (float(x) for x in shapes.size[0, :2])
    assert table_of(shapes, [0]).area == pytest.approx(4 * np.pi * r**2, rel=0.01)
    r, h = (float(x) for x in shapes.size[1, :2])
    assert table_of(shapes, [1]).area == pytest.approx(4 * np.pi * r**2 + 4 * np.pi * r * h, rel=0.01)
    r, h = (float(x) for x in shapes.size[2, :2])
    assert table_of(shapes, [2]).area == pytest.approx(2 * np.pi * r**2 + 4 * np.pi * r * h, rel=0.01)
    a, b, c = (float(x) for x in shapes.size[3])
    assert table_of(shapes, [3]).area == pytest.approx(8 * (a * b + b * c + c * a), rel=1e-5)


def test_pieces_get_points_by_their_area(shapes):
    index = [0, 3, 4]
    table = table_of(shapes, index)
    areas = np.array([table_of(shapes, [k]).area for k in index])
    assert table.area == pytest.approx(areas.sum())
    sample = surface.sample_surface(table, 20_000, np.random.default_rng(1))
    share = np.bincount(sample.piece, minlength=3) / 20_000
    np.testing.assert_allclose(share, areas / areas.sum(), atol=0.015)


def test_points_are_even_within_a_face(shapes):
    """The centre of a box's samples is the box's centre, the spread on a face that of an even distribution."""
    sample = surface.sample_surface(table_of(shapes, [3]), 20_000, np.random.default_rng(2))
    half = shapes.size[3]
    top = sample.points[sample.normals[:, 2] > 0.99]
    np.testing.assert_allclose(top[:, :2].mean(axis=0), 0.0, atol=0.03 * half.max())
    np.testing.assert_allclose(top[:, :2].std(axis=0), half[:2] / np.sqrt(3), rtol=0.05)


def test_faces_inside_other_pieces_can_be_left_out():
    """Two cubes that share half of their volume: no sample stays in the shared part."""
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T.astype(np.float32)
    planes = np.concatenate([np.concatenate([np.eye(3), -np.eye(3)]), np.ones((6, 1))], axis=1).astype(np.float32)
    kind, size = np.full(2, PieceKind.POLYHEDRON), np.zeros((2, 3), np.float32)
    pos, quat = np.array([[0, 0, 0], [1, 0.3, 0.3]], np.float32), np.tile(IDENTITY, (2, 1))
    table = surface.surface_table(kind, size, np.stack([corners] * 2), pos, quat)
    sample = surface.sample_surface(table, 4000, np.random.default_rng(0))
    kept = surface.uncovered(sample, kind, size, np.stack([planes] * 2), pos, quat)
    shared = np.all((kept.points > [0, -0.7, -0.7]) & (kept.points < 1.0), axis=-1)
    assert not shared[np.min(1.0 - np.abs(kept.points - 0.0), axis=-1) > 1e-3].any()
    # The shared part is 1 x 1.7 x 1.7; its surface 2 * 1.7^2 + 4 * 1.7 belongs to the covered faces.
    covered = (2 * 1.7**2 + 4 * 1.7) / 48
    assert 1 - len(kept.points) / 4000 == pytest.approx(covered, abs=0.02)


def test_nearly_flat_pieces_have_a_surface():
    flat = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1e-9]], np.float32)[None]
    table = surface.surface_table(
        np.array([PieceKind.POLYHEDRON]),
        np.zeros((1, 3), np.float32),
        flat,
        np.zeros((1, 3), np.float32),
        IDENTITY[None],
    )
    assert table.area == pytest.approx(2.0, rel=1e-3)
