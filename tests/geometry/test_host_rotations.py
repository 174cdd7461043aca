"""Rotations of the host are those of `ig2mj.geometry.poses`."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ig2mj.geometry import host_rotations, poses


@settings(max_examples=10)
@given(st.integers(0, 2**31))
def test_every_function_agrees_with_the_one_of_batches(seed):
    rng = np.random.default_rng(seed)
    a, b = (q / np.linalg.norm(q, axis=-1, keepdims=True) for q in rng.normal(size=(2, 5, 4)).astype(np.float32))
    v = rng.normal(size=(5, 3)).astype(np.float32)
    cases = {
        "quat_multiply": (a, b),
        "quat_conjugate": (a,),
        "quat_rotate": (a, v),
        "quat_rotate_inverse": (a, v),
        "quat_to_rotation_vector": (a,),
        "rotation_angle": (a, b),
        "length": (v,),
    }
    for name, arguments in cases.items():
        own = getattr(host_rotations, name)(*arguments)
        assert isinstance(own, np.ndarray) and own.dtype == np.float32, name
        np.testing.assert_allclose(own, getattr(poses, name)(*arguments), atol=2e-5, err_msg=name)
    matrix = poses.matrices_on_host(a.astype(float))[0]
    np.testing.assert_allclose(host_rotations.matrix_to_quat(matrix), poses.matrix_to_quat(matrix), atol=1e-5)


def test_no_turn_is_a_rotation_vector_of_zero():
    assert (host_rotations.quat_to_rotation_vector(np.array([[1.0, 0.0, 0.0, 0.0]])) == 0.0).all()


@given(angle=st.floats(-3.0, 3.0))
def test_a_turn_about_an_axis_keeps_it_and_is_that_about_the_vertical(angle):
    axis = np.array([1.0, -2.0, 2.0]) / 3.0
    turn = host_rotations.turn_about(axis, angle)
    np.testing.assert_allclose(turn @ axis, axis, atol=1e-12)
    np.testing.assert_allclose(host_rotations.turn_about(4.0 * axis, angle), turn, atol=1e-12)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.trace(turn), 1.0 + 2.0 * np.cos(angle), atol=1e-12)
    upright = host_rotations.turn_about(np.array([0.0, 0.0, 1.0]), angle)
    np.testing.assert_allclose(upright, host_rotations.about_vertical(angle), atol=1e-12)
