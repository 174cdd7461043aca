"""Distances and containment against MuJoCo and trimesh, in all combinations of kinds."""

from __future__ import annotations

import itertools

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from ig2mj.geometry import gjk, hulls, poses
from ig2mj.geometry.gjk import Nearest, PosedPieces
from ig2mj.scene.tables import PieceKind

SEEDS = st.integers(0, 2**31)
PAIRS = np.array(list(itertools.combinations(range(10), 2)))
IDENTITY = np.array([1, 0, 0, 0], np.float32)
pair_distance = jax.jit(gjk.pair_distance)
signed_depth = jax.jit(hulls.signed_depth)


def piece_distance(a: PosedPieces, b: PosedPieces) -> Nearest:
    """Of each pair; leading axes of `a` and `b` broadcast. Vertices are padded by repetition to the larger number."""
    most = max(a.vertices.shape[-2], b.vertices.shape[-2])
    vertices = [p.vertices[..., np.minimum(np.arange(most), p.vertices.shape[-2] - 1), :] for p in (a, b)]

    def joined(x: np.ndarray, y: np.ndarray, own: int) -> np.ndarray:
        """The two side by side; `own`: the axes of one piece's value."""
        lead = np.broadcast_shapes(x.shape[: x.ndim - own], y.shape[: y.ndim - own])
        return jnp.stack([jnp.broadcast_to(v, (*lead, *v.shape[v.ndim - own :])) for v in (x, y)], axis=len(lead))

    return pair_distance(
        PosedPieces(
            kind=joined(a.kind, b.kind, 0),
            size=joined(a.size, b.size, 1),
            vertices=joined(*vertices, 2),
            pos=joined(a.pos, b.pos, 1),
            quat=joined(a.quat, b.quat, 1),
        )
    )


def chosen(shapes, pos, quat, index) -> PosedPieces:
    return PosedPieces(shapes.kind[index], shapes.size[index], shapes.vertices[index], pos[index], quat[index])


def point_distance(point: np.ndarray, piece: PosedPieces) -> Nearest:
    """Distance of points from pieces, 0 inside: points are spheres without size."""
    shape = point.shape[:-1]
    kind, size = np.full(shape, PieceKind.SPHERE), np.zeros((*shape, 3), np.float32)
    still = np.broadcast_to(IDENTITY, (*shape, 4))
    return piece_distance(PosedPieces(kind, size, np.zeros((*shape, 1, 3), np.float32), point, still), piece)


def ball(radius: float, x: float) -> PosedPieces:
    size, pos = np.array([radius, 0, 0], np.float32), np.array([x, 0, 0], np.float32)
    return PosedPieces(np.array(PieceKind.SPHERE), size, np.zeros((1, 3), np.float32), pos, IDENTITY)


@given(SEEDS, st.sampled_from([0.15, 0.5, 3.0]))
def test_distances_are_mujocos_within_a_tenth_of_a_millimetre(shapes, seed, spread):
    pos, quat = shapes.scatter(np.random.default_rng(seed), spread)
    near = piece_distance(chosen(shapes, pos, quat, PAIRS[:, 0]), chosen(shapes, pos, quat, PAIRS[:, 1]))
    ends = np.zeros(6)
    expected = np.array(
        [mujoco.mj_geomDistance(shapes.model, shapes.data, int(a), int(b), 100.0, ends) for a, b in PAIRS]
    )
    np.testing.assert_allclose(near.distance, np.maximum(expected, 0.0), atol=1e-4)
    clear = np.abs(expected) > 1e-4
    np.testing.assert_array_equal(np.asarray(near.overlap)[clear], expected[clear] < 0)


@given(SEEDS)
def test_nearest_points_lie_on_the_surfaces_and_span_the_distance(shapes, seed):
    pos, quat = shapes.scatter(np.random.default_rng(seed), 0.5)
    near = piece_distance(chosen(shapes, pos, quat, PAIRS[:, 0]), chosen(shapes, pos, quat, PAIRS[:, 1]))
    apart = ~np.asarray(near.overlap)
    assert apart.any()
    span = np.linalg.norm(np.asarray(near.point_a) - near.point_b, axis=-1)
    np.testing.assert_allclose(span[apart], np.asarray(near.distance)[apart], atol=1e-5)
    for point, index in ((near.point_a, PAIRS[:, 0]), (near.point_b, PAIRS[:, 1])):
        local = poses.quat_rotate_inverse(quat[index], point - pos[index])
        depth = np.asarray(signed_depth(shapes.kind[index], shapes.size[index], shapes.planes[index], local))
        np.testing.assert_allclose(depth[apart], 0.0, atol=1e-4)
        assert np.all(depth[~apart] > -1e-4), "in an overlap the points are in the pieces"


@given(SEEDS)
def test_symmetric_and_unchanged_by_rigid_motion(shapes, seed):
    rng = np.random.default_rng(seed)
    pos, quat = shapes.scatter(rng, 0.5)
    a, b = (chosen(shapes, pos, quat, PAIRS[:, i]) for i in (0, 1))
    there, back = piece_distance(a, b), piece_distance(b, a)
    np.testing.assert_allclose(there.distance, back.distance, atol=2e-5)
    turn = poses.quat_normalize(rng.normal(size=4).astype(np.float32))
    shift = (5 * rng.normal(size=3)).astype(np.float32)
    moved = [
        p.replace(pos=poses.quat_rotate(turn, p.pos) + shift, quat=poses.quat_multiply(turn, p.quat)) for p in (a, b)
    ]
    np.testing.assert_allclose(piece_distance(*moved).distance, there.distance, atol=2e-5)


def test_spheres_by_hand_apart_touching_and_overlapping():
    for gap, overlap in ((0.5, False), (0.0, True), (-0.05, True)):
        near = piece_distance(ball(0.1, 0.0), ball(0.2, 0.3 + gap))
        np.testing.assert_allclose(near.distance, max(gap, 0.0), atol=1e-6)
        assert gap == 0.0 or bool(near.overlap) == overlap
    np.testing.assert_allclose(near.point_a, near.point_b, atol=1e-6)
    same = piece_distance(ball(0.1, 0.0), ball(0.1, 0.0))
    assert same.distance == 0 and same.overlap and np.all(np.isfinite(same.point_a))


@given(SEEDS)
def test_points_inside_are_at_distance_zero_and_others_at_trimeshs(shapes, seed):
    rng = np.random.default_rng(seed)
    hull = 4
    pos, quat = np.zeros((1, 3), np.float32), IDENTITY[None]
    piece = PosedPieces(shapes.kind[[hull]], shapes.size[[hull]], shapes.vertices[[hull]], pos, quat)
    points = (rng.normal(size=(30, 3)) * 0.2).astype(np.float32)
    near = point_distance(points, piece)
    mesh = trimesh.convex.convex_hull(shapes.vertices[hull])
    expected = -trimesh.proximity.signed_distance(mesh, points)
    np.testing.assert_allclose(near.distance, np.maximum(expected, 0.0), atol=1e-4)
    inside = expected < -1e-4
    kind, size, planes = shapes.kind[[hull]], shapes.size[[hull]], shapes.planes[[hull]]
    depth = np.asarray(signed_depth(kind, size, planes, points))
    np.testing.assert_allclose(depth[inside], -expected[inside], atol=1e-4)
    # Outside it never says more than the truth.
    assert np.all(-depth[expected > 0] <= expected[expected > 0] + 1e-5)


@pytest.mark.slow
@given(SEEDS)
def test_depth_of_round_pieces_is_the_exact_signed_distance(shapes, seed):
    rng = np.random.default_rng(seed)
    pos, quat = np.zeros((3, 3), np.float32), np.tile(IDENTITY, (3, 1))
    points = (rng.normal(size=(20, 1, 3)) * 0.25).astype(np.float32)
    depth = np.asarray(signed_depth(shapes.kind[:3], shapes.size[:3], shapes.planes[:3], points))
    pieces = PosedPieces(shapes.kind[:3], shapes.size[:3], shapes.vertices[:3], pos, quat)
    near = point_distance(points, pieces)
    np.testing.assert_allclose(np.maximum(-depth, 0.0), near.distance, atol=1e-4)
    clear = np.abs(depth) > 1e-4
    np.testing.assert_array_equal(np.asarray(near.overlap)[clear], depth[clear] > 0)


@given(SEEDS)
def test_support_points_are_farthest(shapes, seed):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(shapes.count, 3)).astype(np.float32)
    core = np.asarray(hulls.core_support(shapes.kind, shapes.size, shapes.vertices, direction))
    point = core + np.asarray(hulls.core_radius(shapes.kind, shapes.size))[:, None] * poses.normalize(direction)
    depth = signed_depth(shapes.kind, shapes.size, shapes.planes, point)
    np.testing.assert_allclose(depth, 0.0, atol=1e-4)
    unit = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
    beyond = point + 1e-2 * unit
    tangent = np.cross(unit, rng.normal(size=3))
    assert np.all(
        np.asarray(signed_depth(shapes.kind, shapes.size, shapes.planes, (beyond + tangent).astype(np.float32))) < 0
    )


def test_nan_is_no_overlap_and_shows_in_the_distance():
    near = piece_distance(ball(0.1, np.nan), ball(0.1, 0.0))
    assert np.isnan(near.distance) and not near.overlap
    depth = hulls.signed_depth(np.array(0), np.ones(3, np.float32), np.zeros((1, 4), np.float32), np.full(3, np.nan))
    assert not depth >= 0.0


def test_gradients_are_finite_everywhere_and_unit_where_apart(shapes):
    """d distance / d position is the unit vector between the nearest points; 0 in an overlap, never NaN."""
    pos, quat = shapes.scatter(np.random.default_rng(1), 0.3)
    b = chosen(shapes, pos, quat, PAIRS[:, 1])

    def total(pos, quat):
        near = piece_distance(chosen(shapes, pos, quat, PAIRS[:, 0]), b)
        return jnp.sum(near.distance), near

    (by_pos, by_quat), near = jax.jit(jax.grad(total, argnums=(0, 1), has_aux=True))(
        jnp.asarray(pos), jnp.asarray(quat)
    )
    assert np.all(np.isfinite(by_pos)) and np.all(np.isfinite(by_quat))
    apart = ~np.asarray(near.overlap)
    assert apart.any() and (~apart).any()
    unit = poses.normalize(near.point_a - near.point_b) * apart[:, None]
    expected = np.zeros_like(pos)
    np.add.at(expected, PAIRS[:, 0], np.asarray(unit))
    np.testing.assert_allclose(by_pos, expected, atol=1e-2)


@pytest.mark.parametrize("offset", [0.0, 1e-4, 3e-3])
def test_parallel_faces_and_far_from_the_origin(offset):
    """A box 50 m away on top of another: nearest points are not unique, coordinates are large."""
    corners = np.array(list(itertools.product([-0.1, 0.1], repeat=3)), np.float32)
    kind, size = np.array(PieceKind.POLYHEDRON), np.zeros(3, np.float32)
    base = np.array([50, -30, 0], np.float32)
    lower = PosedPieces(kind, size, corners, base, IDENTITY)
    upper = PosedPieces(kind, size, corners, base + np.array([0.02, 0.03, 0.2 + offset], np.float32), IDENTITY)
    np.testing.assert_allclose(piece_distance(lower, upper).distance, offset, atol=1e-5)
