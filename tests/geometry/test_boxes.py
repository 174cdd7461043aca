"""Axis-aligned boxes: tight ones against trimesh, iGibson's against Bullet's measured ones."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ig2mj.geometry import boxes
from ig2mj.geometry.poses import quat_to_matrix, quats_to_matrices
from ig2mj.scene.tables import PieceKind

SEEDS = st.integers(0, 2**31)
IDENTITY = np.array([1, 0, 0, 0], np.float32)
ORIGIN = np.zeros(3, np.float32)
box_gap = jax.jit(boxes.box_gap)


def box_corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    return np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, 8).T


def cores(shapes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of pieces that stand in frames of their own."""
    unposed = np.zeros((shapes.count, 3)), np.tile(IDENTITY, (shapes.count, 1))
    return boxes.piece_cores(shapes.kind, shapes.size, shapes.vertices, *unposed)


def tight_boxes(shapes, pos: np.ndarray, quat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = boxes.core_boxes(Rotation.from_quat(quat, scalar_first=True).as_matrix(), *cores(shapes))
    return pos + low, pos + high


def random_boxes(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    low = rng.normal(size=(count, 3)).astype(np.float32)
    return low, low + rng.uniform(0.1, 1, (count, 3)).astype(np.float32)


@given(SEEDS)
def test_tight_boxes_are_those_of_trimeshs_bodies(shapes, seed):
    pos, quat = shapes.scatter(np.random.default_rng(seed), 1.0)
    low, high = tight_boxes(shapes, pos, quat)
    for k in range(shapes.count):
        radius, half = (float(x) for x in shapes.size[k, :2])
        body = {
            PieceKind.SPHERE: lambda r=radius: trimesh.creation.icosphere(4, r),
            PieceKind.CAPSULE: lambda r=radius, h=half: trimesh.creation.capsule(
                2 * h, r, count=[128, 128], transform=trimesh.transformations.translation_matrix([0, 0, -h])
            ),
            PieceKind.CYLINDER: lambda r=radius, h=half: trimesh.creation.cylinder(r, 2 * h, sections=720),
            PieceKind.POLYHEDRON: lambda k=k: trimesh.convex.convex_hull(shapes.vertices[k]),
        }[PieceKind(shapes.kind[k])]()
        if shapes.kind[k] == PieceKind.CAPSULE:
            body.apply_translation(-body.bounds.mean(axis=0))
        turned = Rotation.from_quat(quat[k], scalar_first=True).apply(body.vertices) + pos[k]
        np.testing.assert_allclose([low[k], high[k]], [turned.min(0), turned.max(0)], atol=5e-4)


@given(SEEDS)
def test_a_piece_may_stand_anywhere_in_its_frame(shapes, seed):
    pos, quat = shapes.scatter(np.random.default_rng(seed), 1.0)
    posed = boxes.piece_cores(shapes.kind, shapes.size, shapes.vertices, pos, quat)
    unturned = np.broadcast_to(np.eye(3), (shapes.count, 3, 3))
    np.testing.assert_allclose(boxes.core_boxes(unturned, *posed), tight_boxes(shapes, pos, quat), atol=1e-6)


@given(SEEDS)
def test_turned_boxes_are_the_same_with_numpy_and_with_jax(shapes, seed):
    _, quat = shapes.scatter(np.random.default_rng(seed), 1.0)
    _, center, half = boxes.link_boxes(np.arange(shapes.count), *cores(shapes))
    in_jax = boxes.turned_boxes(quat_to_matrix(quat), center, half)
    in_numpy = boxes.turned_boxes(Rotation.from_quat(quat, scalar_first=True).as_matrix(), center, half)
    assert all(isinstance(a, jax.Array) for a in in_jax) and all(isinstance(a, np.ndarray) for a in in_numpy)
    np.testing.assert_allclose(in_jax, in_numpy, atol=2e-6)


@given(SEEDS)
def test_reaches_with_worlds_last_are_the_boxes(shapes, seed):
    rng = np.random.default_rng(seed)
    rotation = np.stack([quat_to_matrix(shapes.scatter(rng, 1.0)[1]) for _ in range(3)])  # W K 3 3
    points, radius, axis = cores(shapes)
    center, half = points.mean(-1), np.ptp(points, axis=-1) / 2
    worlds_last = jnp.asarray(rotation.transpose(2, 3, 1, 0), jnp.float32)
    for reach, (low, high) in (
        (boxes.core_reaches(worlds_last, points, radius, axis), boxes.core_boxes(rotation, points, radius, axis)),
        (boxes.core_reaches(worlds_last, points, None, axis), boxes.core_boxes(rotation, points, None, axis)),
        (boxes.turned_reaches(worlds_last, center, half), boxes.turned_boxes(rotation, center, half)),
    ):
        np.testing.assert_allclose(reach.transpose(0, 3, 2, 1), (-low, high), atol=2e-6)


def test_igibsons_box_is_that_of_the_turned_local_box():
    """A ball's hull of radius 0.1 has its box at 0.1015 unturned and up to 0.173 turned."""
    turned = Rotation.from_rotvec([0.6, 0.6, 0.6]).as_matrix()
    center, half = np.zeros((2, 3)), np.full((2, 3), 0.1)
    low, high = boxes.turned_boxes(np.stack([np.eye(3), turned]), center, half)
    np.testing.assert_allclose([-low[0], high[0]], 0.1)
    np.testing.assert_allclose(high[1], (box_corners(-half[1], half[1]) @ turned.T).max(axis=0))
    assert np.max(high) > 0.15


def test_margins_are_bullets_3_mm_for_one_hull_and_4_mm_for_a_compound():
    body = np.array([5, 5, 9])
    pos = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], np.float32)
    cube = np.tile(box_corners(-np.ones(3), np.ones(3))[None], (3, 1, 1))
    kind = np.full(3, PieceKind.POLYHEDRON)
    cores = boxes.piece_cores(kind, np.zeros((3, 3)), cube, pos, np.tile(IDENTITY, (3, 1)))
    found, center, half = boxes.link_boxes(body, *cores)
    np.testing.assert_array_equal(found, [5, 9])
    np.testing.assert_allclose(center, [[0.5, 0, 0], [0, 2, 0]])
    np.testing.assert_allclose(half, [[1.504, 1.004, 1.004], [1.003, 1.003, 1.003]])


@given(SEEDS)
def test_the_rotated_box_holds_the_tight_one(shapes, seed):
    pos, quat = shapes.scatter(np.random.default_rng(seed), 1.0)
    low, high = tight_boxes(shapes, pos, quat)
    _, center, half = boxes.link_boxes(np.arange(shapes.count), *cores(shapes))
    turned = Rotation.from_quat(quat, scalar_first=True).as_matrix()
    loose_low, loose_high = boxes.turned_boxes(turned, center, half)
    assert np.all(pos + loose_low <= low + 1e-9)
    assert np.all(pos + loose_high >= high - 1e-9)


@pytest.mark.parametrize("xp", [np, jnp])
def test_in_the_empty_box_is_no_point_and_it_is_infinitely_far_from_any_box(xp):
    empty = xp.full(3, xp.inf, dtype=xp.float32), xp.full(3, -xp.inf, dtype=xp.float32)
    assert not boxes.point_in_box(xp.asarray(ORIGIN[None]), *empty).any()
    assert np.isposinf(boxes.box_gap(ORIGIN, ORIGIN + 1, *empty))
    assert np.isposinf(boxes.box_gap(*empty, *empty))


@given(SEEDS)
def test_gaps_are_mujocos_box_distances_symmetric_and_move_along(seed):
    rng = np.random.default_rng(seed)
    (la, ha), (lb, hb) = random_boxes(rng, 4), random_boxes(rng, 4)
    gap = np.asarray(box_gap(la, ha, lb, hb))
    np.testing.assert_array_equal(gap, box_gap(lb, hb, la, ha))
    shift = rng.normal(size=3).astype(np.float32)
    np.testing.assert_allclose(gap, box_gap(la + shift, ha + shift, lb + shift, hb + shift), atol=1e-5)
    for i in range(4):
        spec = mujoco.MjSpec()
        for low, high in ((la[i], ha[i]), (lb[i], hb[i])):
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX, size=(high - low) / 2, pos=(high.astype(float) + low) / 2
            )
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        expected = mujoco.mj_geomDistance(model, data, 0, 1, 50.0, np.zeros(6))
        np.testing.assert_allclose(gap[i], max(expected, 0.0), atol=1e-4)


def test_box_gap_uses_all_three_axes():
    low = np.zeros(3, np.float32)
    np.testing.assert_allclose(
        boxes.box_gap(low, low + 1, low + np.array([2, 3, 1], np.float32), low + 4), np.sqrt(5), rtol=1e-6
    )


def test_a_point_on_the_face_is_in_the_box_and_nan_is_not():
    low, high = np.zeros(3, np.float32), np.ones(3, np.float32)
    points = np.array([[1, 0, 0.5], [1.0001, 0, 0.5], [np.nan, 0, 0.5]], np.float32)
    np.testing.assert_array_equal(boxes.point_in_box(points, low, high), [True, False, False])


def test_gradients_are_finite_also_where_boxes_touch_overlap_or_are_empty():
    low = jnp.zeros((4, 3))
    other = jnp.array([[0.5, 0.5, 0.5], [1, 1, 1], [2, 0, 0], [jnp.inf] * 3])

    @jax.jit
    @jax.grad
    def gradient(a):
        return jnp.sum(jnp.where(jnp.arange(4) < 3, boxes.box_gap(a, a + 1, other, other + 1), 0))

    assert np.all(np.isfinite(gradient(low)))


def test_the_tight_box_of_an_upright_cylinder_has_finite_gradients(shapes):
    points, radius, axis = (jnp.asarray(a, jnp.float32) for a in cores(shapes))

    @jax.jit
    @jax.grad
    def gradient(quat):
        return jnp.sum(boxes.core_reaches(quats_to_matrices(quat[..., None]), points, radius, axis))

    assert np.all(np.isfinite(gradient(jnp.tile(IDENTITY, (shapes.count, 1)))))
