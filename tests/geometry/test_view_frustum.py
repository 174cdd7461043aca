"""View frusta: points against projection by hand and against half-spaces."""

from __future__ import annotations

import jax
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ig2mj.geometry import frustum, poses
from ig2mj.geometry.frustum import Camera

SEEDS = st.integers(0, 2**31)
IDENTITY = np.array([1, 0, 0, 0], np.float32)
ORIGIN = np.zeros(3, np.float32)
FOVY, ASPECT, NEAR, FAR = float(np.deg2rad(60)), 1.5, 0.1, 6.0
points_in_frustum = jax.jit(frustum.points_in_frustum)


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


def test_batches_of_cameras_see_their_own_points():
    """Two worlds, one camera each, looking opposite ways at the same two points."""
    half_turn = np.array([0, 0, 1, 0], np.float32)
    cameras = Camera(np.zeros((2, 3), np.float32), np.stack([IDENTITY, half_turn]), FOVY)
    points = np.array([[0, 0, -2], [0, 0, 2]], np.float32)
    np.testing.assert_array_equal(points_in_frustum(cameras, points), [[True, False], [False, True]])
