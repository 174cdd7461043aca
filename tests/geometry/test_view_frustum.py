"""View frusta: points against projection by hand, boxes and pieces against a linear programme, sight against rays."""

from __future__ import annotations

import jax
import numpy as np
import scipy.optimize
from hypothesis import given
from hypothesis import strategies as st

from ig2mj.geometry import frustum, poses
from ig2mj.geometry.boxes import box_corners
from ig2mj.geometry.frustum import Camera
from ig2mj.geometry.gjk import PosedPieces
from ig2mj.scene.tables import PieceKind

SEEDS = st.integers(0, 2**31)
IDENTITY = np.array([1, 0, 0, 0], np.float32)
ORIGIN = np.zeros(3, np.float32)
FOVY, ASPECT, NEAR, FAR = float(np.deg2rad(60)), 1.5, 0.1, 6.0
points_in_frustum, boxes_in_frustum = jax.jit(frustum.points_in_frustum), jax.jit(frustum.boxes_in_frustum)
pieces_in_frustum = jax.jit(frustum.pieces_in_frustum)


def looking(pos=ORIGIN, quat=IDENTITY) -> Camera:
    return Camera(np.asarray(pos, np.float32), np.asarray(quat, np.float32), FOVY, ASPECT, NEAR, FAR)


def half_spaces(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """The view as A x <= b in the world frame."""
    up = np.tan(FOVY / 2)
    across = up * ASPECT
    a = np.array([[1, 0, across], [-1, 0, across], [0, 1, up], [0, -1, up], [0, 0, 1], [0, 0, -1]])
    b = np.array([0, 0, 0, 0, -NEAR, FAR])
    turn = np.asarray(poses.quat_to_matrix(camera.quat), float)
    world = a @ turn.T
    return world, b + world @ np.asarray(camera.pos, float)


def clearance(camera: Camera, corners: np.ndarray) -> float:
    """By how much the view must grow (negative: may shrink) before it just touches the hull of `corners`."""
    a, b = half_spaces(camera)
    a_hull = a @ corners.T.astype(float)
    scale = np.linalg.norm(a, axis=1)
    n = len(corners)
    found = scipy.optimize.linprog(
        [*np.zeros(n), 1.0],
        A_ub=np.c_[a_hull, -scale],
        b_ub=b,
        A_eq=[[*np.ones(n), 0.0]],
        b_eq=[1.0],
        bounds=[(0, None)] * n + [(None, None)],
    )
    assert found.success
    return found.fun


def test_cameras_look_along_minus_z_with_y_up():
    camera = looking()
    points = np.array(
        [[0, 0, -1], [0, 0, 1], [0, 0, -0.05], [0, 0, -7], [0.8, 0, -1], [0.9, 0, -1], [0, 0.57, -1], [0, 0.59, -1]],
        np.float32,
    )
    expected = [True, False, False, False, True, False, True, False]  # tan 30 = 0.577, times 1.5 = 0.866
    np.testing.assert_array_equal(points_in_frustum(camera, points), expected)
    assert not points_in_frustum(camera, np.full((1, 3), np.nan, np.float32))[0]


@given(SEEDS)
def test_points_are_in_view_if_all_half_spaces_hold(seed):
    rng = np.random.default_rng(seed)
    camera = looking(rng.normal(size=3), poses.quat_normalize(rng.normal(size=4)))
    points = (3 * rng.normal(size=(50, 3))).astype(np.float32)
    a, b = half_spaces(camera)
    room = np.min(b - points @ a.T, axis=1)
    clear = np.abs(room) > 1e-4
    np.testing.assert_array_equal(np.asarray(points_in_frustum(camera, points))[clear], room[clear] > 0)


@given(SEEDS)
def test_boxes_and_pieces_in_view_are_those_of_a_linear_programme(shapes, seed):
    rng = np.random.default_rng(seed)
    camera = looking(rng.normal(size=3), poses.quat_normalize(rng.normal(size=4)))
    forward = -np.asarray(poses.quat_to_matrix(camera.quat))[:, 2]
    # Around the rim of the view, where the answer is not plain.
    rim = np.asarray(camera.pos) + rng.uniform(0, 6.5, (8, 1)) * (forward + 0.6 * rng.normal(size=(8, 3)))
    half = rng.uniform(0.05, 0.8, (8, 3))
    low, high = (rim - half).astype(np.float32), (rim + half).astype(np.float32)
    found = np.asarray(boxes_in_frustum(camera, low, high))
    hull = 9
    quat = np.asarray(poses.quat_normalize(rng.normal(size=(8, 4)).astype(np.float32)))
    vertices = 3 * shapes.vertices[hull]
    pieces = PosedPieces(
        np.array(PieceKind.POLYHEDRON), np.zeros(3, np.float32), vertices, rim.astype(np.float32), quat
    )
    found_pieces = np.asarray(pieces_in_frustum(camera, pieces))
    for i in range(8):
        away = clearance(camera, np.asarray(box_corners(low[i], high[i])))
        assert abs(away) < 1e-4 or found[i] == (away < 0)
        away = clearance(camera, np.asarray(poses.transform_points(rim[i].astype(np.float32), quat[i], vertices)))
        assert abs(away) < 1e-4 or found_pieces[i] == (away < 0)


def test_a_far_plane_of_a_hundred_metres_costs_no_accuracy():
    camera = looking().replace(far=100.0, near=0.01)
    radius = np.array([0.05, 0, 0], np.float32)
    edge = np.deg2rad(30.0)
    for away, seen in ((-1e-3, True), (1e-3, False)):
        # A ball at 3 m whose surface is a millimetre inside or outside the upper plane.
        centre = 3 * np.array([0, np.tan(edge), -1]) + (0.05 + away) * np.array([0, np.cos(edge), np.sin(edge)])
        ball = PosedPieces(
            np.array([PieceKind.SPHERE]),
            radius[None],
            np.zeros((1, 1, 3), np.float32),
            centre[None].astype(np.float32),
            IDENTITY[None],
        )
        assert bool(pieces_in_frustum(camera, ball)[0]) == seen


def test_batches_of_cameras_see_their_own_boxes():
    """Two worlds, one camera each, looking opposite ways at the same two boxes."""
    half_turn = np.array([0, 0, 1, 0], np.float32)
    cameras = Camera(np.zeros((2, 3), np.float32), np.stack([IDENTITY, half_turn]), FOVY)
    low = np.array([[-0.1, -0.1, -2], [-0.1, -0.1, 1.9]], np.float32)
    seen = boxes_in_frustum(cameras, low, low + 0.1)
    np.testing.assert_array_equal(seen, [[True, False], [False, True]])
    empty = np.full((2, 1, 3), np.inf, np.float32)
    assert not np.any(boxes_in_frustum(cameras, empty, -empty)), "an object without pieces is never seen"
    assert not np.any(boxes_in_frustum(cameras, empty * np.nan, empty * np.nan))


def test_a_wall_hides_what_is_behind_it_and_its_own_back():
    camera = looking()
    cube = np.concatenate([np.concatenate([np.eye(3), -np.eye(3)]), np.full((6, 1), 0.5)], axis=1).astype(np.float32)
    pieces = (np.array([[0, 0, -2]], np.float32), IDENTITY[None], np.array([PieceKind.POLYHEDRON]))
    shape = (np.zeros((1, 3), np.float32), cube[None])
    points = np.array([[0, 0, -1], [0, 0, -1.5], [0, 0, -2.5], [0, 0, -3], [1.5, 0, -3]], np.float32)
    sight = jax.jit(lambda see_through: frustum.points_in_sight(camera, points, *pieces, *shape, see_through))
    np.testing.assert_array_equal(sight(np.array([False])), [True, True, False, False, True])
    np.testing.assert_array_equal(sight(np.array([True])), [True] * 5)
    within = frustum.points_in_sight(looking(pos=(0, 0, -2)), points[3:4], *pieces, *shape)
    assert bool(within[0]), "a piece the eye is inside of hides nothing"
