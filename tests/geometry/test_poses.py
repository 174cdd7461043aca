"""Rotations and poses against scipy."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ig2mj.geometry import poses

SEEDS = st.integers(0, 2**31)


def random_pose(rng: np.random.Generator, *shape: int) -> tuple[np.ndarray, np.ndarray]:
    quat = rng.normal(size=(*shape, 4))
    return rng.normal(size=(*shape, 3)).astype(np.float32), (
        quat / np.linalg.norm(quat, axis=-1, keepdims=True)
    ).astype(np.float32)


def rotation(quat: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.asarray(quat, np.float64), scalar_first=True)


@given(SEEDS)
def test_products_turns_and_matrices_agree_with_scipy(seed):
    rng = np.random.default_rng(seed)
    v, a = random_pose(rng, 6)
    _, b = random_pose(rng, 6)
    ra, rb = rotation(a), rotation(b)
    np.testing.assert_allclose(poses.quat_rotate(a, v), ra.apply(v), atol=1e-5)
    np.testing.assert_allclose(poses.quat_rotate_inverse(a, v), ra.inv().apply(v), atol=1e-5)
    np.testing.assert_allclose(poses.quat_to_matrix(a), ra.as_matrix(), atol=1e-5)
    np.testing.assert_allclose(poses.quat_to_matrix(poses.quat_multiply(a, b)), (ra * rb).as_matrix(), atol=1e-5)
    np.testing.assert_allclose(poses.rotation_angle(a, b), (ra.inv() * rb).magnitude(), atol=2e-3)


@given(SEEDS)
def test_conversions_return_to_where_they_started(seed):
    rng = np.random.default_rng(seed)
    _, quat = random_pose(rng, 6)
    quat = np.where(quat[:, :1] < 0, -quat, quat)
    np.testing.assert_allclose(poses.matrix_to_quat(poses.quat_to_matrix(quat)), quat, atol=1e-5)
    vector = poses.quat_to_rotation_vector(quat)
    np.testing.assert_allclose(vector, rotation(quat).as_rotvec(), atol=1e-5)
    np.testing.assert_allclose(poses.rotation_vector_to_quat(vector), quat, atol=1e-5)
    angles = rng.uniform(-1.5, 1.5, (6, 3)).astype(np.float32)
    np.testing.assert_allclose(poses.quat_to_rpy(poses.rpy_to_quat(angles)), angles, atol=1e-4)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, 0, 0.8)])
def test_half_turns_survive_the_matrix_form(axis):
    """w = 0 is where the naive formula divides by zero."""
    quat = poses.axis_angle_to_quat(np.array(axis, np.float32), np.array(np.pi, np.float32))
    back = poses.matrix_to_quat(poses.quat_to_matrix(quat))
    np.testing.assert_allclose(np.abs(np.dot(back, quat)), 1.0, atol=1e-5)


def test_rpy_turns_about_fixed_axes_as_urdf_says():
    angles = np.array([0.3, -0.7, 1.9], np.float32)
    expected = Rotation.from_euler("xyz", angles).as_matrix()
    np.testing.assert_allclose(poses.quat_to_matrix(poses.rpy_to_quat(angles)), expected, atol=1e-6)


@given(SEEDS)
def test_composing_inverting_and_relating_poses(seed):
    rng = np.random.default_rng(seed)
    (pa, qa), (pb, qb) = random_pose(rng, 4), random_pose(rng, 4)
    points = rng.normal(size=(4, 5, 3)).astype(np.float32)
    pc, qc = poses.compose(pa, qa, pb, qb)
    direct = poses.transform_points(pc, qc, points)
    stepwise = poses.transform_points(pa, qa, poses.transform_points(pb, qb, points))
    np.testing.assert_allclose(direct, stepwise, atol=1e-5)
    np.testing.assert_allclose(poses.inverse_transform_points(pc, qc, direct), points, atol=1e-5)
    np.testing.assert_allclose(poses.transform_points(*poses.invert(pc, qc), direct), points, atol=1e-5)
    back_pos, back_quat = poses.relative_pose(pa, qa, pc, qc)
    np.testing.assert_allclose(back_pos, pb, atol=1e-5)
    np.testing.assert_allclose(poses.rotation_angle(back_quat, qb), 0.0, atol=2e-3)


def test_zero_vectors_and_quaternions_give_no_nan_and_no_nan_gradient():
    zero3, zero4 = jnp.zeros(3), jnp.zeros(4)
    np.testing.assert_array_equal(poses.normalize(zero3), zero3)
    np.testing.assert_array_equal(poses.quat_normalize(zero4), [1, 0, 0, 0])
    np.testing.assert_array_equal(poses.quat_to_rotation_vector(np.array([1, 0, 0, 0], np.float32)), zero3)
    for function in (poses.length, lambda v: poses.normalize(v).sum(), lambda v: poses.rotation_vector_to_quat(v)[1]):
        assert np.all(np.isfinite(jax.grad(function)(zero3)))


def test_nan_is_not_hidden_by_normalising():
    bad = np.array([np.nan, 0, 0], np.float32)
    assert np.isnan(poses.length(bad)) and np.all(np.isnan(poses.normalize(bad)))
    assert np.any(np.isnan(poses.quat_normalize(np.array([np.nan, 0, 0, 0], np.float32))))


def test_shapes_are_checked_at_run_time_in_tests():
    """The import hook of tests/conftest.py is at work: a wrong trailing axis is refused."""
    with pytest.raises(jaxtyping.TypeCheckError, match="quat_rotate"):
        poses.quat_rotate(np.zeros(3, np.float32), np.zeros(3, np.float32))
