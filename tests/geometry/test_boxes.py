"""Axis-aligned boxes: tight ones against trimesh, iGibson's against Bullet's measured ones (spec/states.md 4.2, 24)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ig2mj.geometry import boxes
from ig2mj.scene.tables import PieceKind

SEEDS = st.integers(0, 2**31)
IDENTITY = np.array([1, 0, 0, 0], np.float32)
piece_boxes, rotated_boxes = jax.jit(boxes.piece_boxes), jax.jit(boxes.rotated_boxes)
box_gap = jax.jit(boxes.box_gap)


def random_boxes(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    low = rng.normal(size=(count, 3)).astype(np.float32)
    return low, low + rng.uniform(0.1, 1, (count, 3)).astype(np.float32)


@given(SEEDS)
def test_tight_boxes_are_those_of_trimeshs_bodies(shapes, seed):
    pos, quat = shapes.scatter(np.random.default_rng(seed), 1.0)
    low, high = piece_boxes(shapes.kind, shapes.size, shapes.vertices, pos, quat)
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


def test_igibsons_box_is_that_of_the_turned_local_box(shapes):
    """A ball's hull of radius 0.1 has its box at 0.1015 unturned and up to 0.173 turned (spec/states.md 4.2)."""
    turned = np.asarray(Rotation.from_rotvec([0.6, 0.6, 0.6]).as_quat(scalar_first=True), np.float32)
    half = np.full(3, 0.1, np.float32)
    low, high = rotated_boxes(np.zeros(3, np.float32), half, np.zeros(3, np.float32), IDENTITY, 0.003)
    np.testing.assert_allclose([-low, high], 0.103, atol=1e-6)
    _, high = rotated_boxes(np.zeros(3, np.float32), half, np.zeros(3, np.float32), turned, 0.0)
    corners = boxes.box_corners(-half, half)
    exact = Rotation.from_quat(turned, scalar_first=True).apply(corners).max(axis=0)
    np.testing.assert_allclose(high, exact, atol=1e-5)
    assert np.max(high) > 0.15


def test_margins_are_bullets_3_mm_for_one_hull_and_4_mm_for_a_compound(shapes):
    body = np.array([5, 5, 9])
    pos = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], np.float32)
    quat = np.tile(IDENTITY, (3, 1))
    cube = np.tile(np.asarray(boxes.box_corners(-np.ones(3, np.float32), np.ones(3, np.float32)))[None], (3, 1, 1))
    kind = np.full(3, PieceKind.POLYHEDRON)
    found, center, half, margin = boxes.link_boxes(body, kind, np.zeros((3, 3), np.float32), cube, pos, quat)
    np.testing.assert_array_equal(found, [5, 9])
    np.testing.assert_allclose(center, [[0.5, 0, 0], [0, 2, 0]])
    np.testing.assert_allclose(half, [[1.5, 1, 1], [1, 1, 1]])
    np.testing.assert_allclose(margin, [0.004, 0.003])


@given(SEEDS)
def test_the_rotated_box_holds_the_tight_one(shapes, seed):
    pos, quat = shapes.scatter(np.random.default_rng(seed), 1.0)
    low, high = piece_boxes(shapes.kind, shapes.size, shapes.vertices, pos, quat)
    loose_low, loose_high = rotated_boxes(shapes.box_center, shapes.box_half, pos, quat)
    assert np.all(np.asarray(loose_low) <= np.asarray(low) + 1e-5)
    assert np.all(np.asarray(loose_high) >= np.asarray(high) - 1e-5)


def test_union_by_object_and_the_empty_box():
    low = np.array([[[0, 0, 0], [1, 1, 1], [-5, 0, 0]]], np.float32)
    owner = np.array([0, 0, -1])
    joined_low, joined_high = boxes.union_boxes(low, low + 1, owner, 2)
    np.testing.assert_array_equal(joined_low[0, 0], [0, 0, 0])
    np.testing.assert_array_equal(joined_high[0, 0], [2, 2, 2])
    empty = joined_low[:, 1], joined_high[:, 1]
    assert np.all(np.isposinf(empty[0])) and np.all(np.isneginf(empty[1]))
    assert not boxes.point_in_box(np.zeros((1, 3), np.float32), *empty).any()
    assert np.all(np.isposinf(boxes.box_gap(joined_low[:, 0], joined_high[:, 0], *empty)))
    assert np.all(np.isposinf(boxes.box_gap(*empty, *empty)))


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
    np.testing.assert_allclose(boxes.box_gap(low, low + 1, low + np.float32([2, 3, 1]), low + 4), np.sqrt(5), rtol=1e-6)


def test_a_point_on_the_face_is_in_the_box_and_nan_is_not():
    low, high = np.zeros(3, np.float32), np.ones(3, np.float32)
    assert boxes.point_in_box(np.array([1, 0, 0.5], np.float32), low, high)
    assert not boxes.point_in_box(np.array([1.0001, 0, 0.5], np.float32), low, high)
    assert not boxes.point_in_box(np.array([np.nan, 0, 0.5], np.float32), low, high)
    np.testing.assert_allclose(boxes.point_box_distance(np.array([4, 5, 0.5], np.float32), low, high), 5.0)


def test_gradients_are_finite_also_where_boxes_touch_overlap_or_are_empty():
    low = jnp.zeros((4, 3))
    other = jnp.array([[0.5, 0.5, 0.5], [1, 1, 1], [2, 0, 0], [jnp.inf] * 3])

    @jax.jit
    @jax.grad
    def gradient(a):
        return jnp.sum(jnp.where(jnp.arange(4) < 3, boxes.box_gap(a, a + 1, other, other + 1), 0))

    assert np.all(np.isfinite(gradient(low)))
    turn = jax.jit(
        jax.grad(
            lambda q: sum(
                jnp.sum(b)
                for b in boxes.piece_boxes(
                    np.arange(4), np.ones((4, 3), np.float32), np.ones((4, 1, 3), np.float32), np.zeros((4, 3)), q
                )
            )
        )
    )(jnp.tile(IDENTITY, (4, 1)))
    assert np.all(np.isfinite(turn)), "an upright cylinder has a kink there"
