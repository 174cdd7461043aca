"""Entry-only rays, as Bullet's, against MuJoCo's, which also report exits of rays that start inside."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_rays import enters, rays_hit_pieces

from ig2mj.geometry import poses, rays
from ig2mj.geometry.hulls import signed_depth
from ig2mj.geometry.rays import capsule_interval, cylinder_interval, polyhedron_interval, sphere_interval
from ig2mj.scene.tables import PieceKind

SEEDS = st.integers(0, 2**31)
NUM_RAYS = 12
hit_pieces = jax.jit(rays_hit_pieces, static_argnames="inflate")
X, Z = np.array([1.0, 0, 0], np.float32), np.array([0, 0, 1.0], np.float32)
CUBE = np.concatenate([np.concatenate([np.eye(3), -np.eye(3)]), np.ones((6, 1))], axis=1).astype(np.float32)


def enters_backwards(low, high, length: float) -> bool:
    """Against the line's direction."""
    return bool(rays.fractions_enter(low, 1.0, high, 1.0, length)[1])


def mujoco_ray(shapes, geom: int, origin: np.ndarray, direction: np.ndarray) -> float:
    """Distance to one geom's surface, -1 for none; MuJoCo tells exits of inner rays too."""
    model, data = shapes.model, shapes.data
    pos, mat = data.geom_xpos[geom], data.geom_xmat[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
        return mujoco.mj_rayMesh(model, data, geom, origin, direction)
    return mujoco.mju_rayGeom(pos, mat, model.geom_size[geom], origin, direction, int(model.geom_type[geom]))


@given(SEEDS)
def test_entries_are_mujocos_hits_without_those_from_inside(shapes, seed):
    rng = np.random.default_rng(seed)
    pos, quat = shapes.scatter(rng, 0.15)
    origins = rng.normal(size=(NUM_RAYS, 3)).astype(np.float32) * 0.3
    directions = rng.normal(size=(NUM_RAYS, 3))
    directions = (directions / np.linalg.norm(directions, axis=-1, keepdims=True)).astype(np.float32)
    lengths = rng.uniform(0.1, 1.0, NUM_RAYS).astype(np.float32)
    t = np.asarray(hit_pieces(origins, directions, lengths, pos, quat, shapes.kind, shapes.size, shapes.planes))
    local = poses.quat_rotate_inverse(quat[None], origins[:, None] - pos[None])
    depth = np.asarray(signed_depth(shapes.kind, shapes.size, shapes.planes, local))
    depth_in, depth_out = depth >= -1e-4, ~(depth >= 1e-4)
    for r in range(NUM_RAYS):
        for k in range(shapes.count):
            if depth_in[r, k] and depth_out[r, k]:
                continue  # on the surface, within rounding
            if depth_in[r, k]:
                assert t[r, k] == np.inf, "a ray from inside does not hit"
                continue
            expected = mujoco_ray(shapes, k, origins[r].astype(float), directions[r].astype(float))
            if expected < 0 or expected > lengths[r] + 1e-4:
                assert t[r, k] == np.inf or _grazes(shapes, k, pos, quat, origins[r], directions[r])
            elif expected < lengths[r] - 1e-4:
                missed = t[r, k] == np.inf
                if not (missed and _grazes(shapes, k, pos, quat, origins[r], directions[r])):
                    np.testing.assert_allclose(t[r, k], expected, atol=2e-4)


def _grazes(shapes, k, pos, quat, origin, direction) -> bool:
    """Whether hitting or missing hangs on 0.1 mm."""
    o = poses.quat_rotate_inverse(quat[k], origin - pos[k])
    d = poses.quat_rotate_inverse(quat[k], direction)
    args = (np.array(shapes.kind[k]), shapes.size[k], shapes.planes[k], o, d)
    hits = [bool(enters(*rays.piece_interval(*args, inflate), np.float32(10.0))) for inflate in (-1e-4, 1e-4)]
    return hits[0] != hits[1]


@pytest.mark.parametrize(
    "interval",
    [
        lambda o, d: sphere_interval(o, d, 1.0),
        lambda o, d: capsule_interval(o, d, 1.0, 0.0),
        lambda o, d: cylinder_interval(o, d, 1.0, 1.0),
        lambda o, d: polyhedron_interval(o, d, CUBE),
    ],
    ids=["sphere", "capsule", "cylinder", "polyhedron"],
)
class TestUnitShape:
    """Shapes that reach from -1 to 1 along x, seen along x."""

    def test_a_ray_from_outside_enters_where_the_surface_is(self, interval):
        low, high = interval(-3 * X, X)
        np.testing.assert_allclose([low, high], [2, 4], atol=1e-5)
        assert enters(low, high, 2.5) and not enters(low, high, 1.9)

    def test_a_ray_from_inside_does_not_hit(self, interval):
        low, high = interval(0.5 * X, X)
        assert not enters(low, high, 10.0) and not enters_backwards(low, high, 10.0)

    def test_a_ray_that_leads_away_does_not_hit_but_its_opposite_does(self, interval):
        low, high = interval(3 * X, X)
        assert not enters(low, high, 10.0) and enters_backwards(low, high, 10.0)
        assert not enters_backwards(low, high, 1.9)

    def test_a_parallel_line_beside_the_shape_has_the_empty_interval(self, interval):
        low, high = interval(-3 * X + 1.001 * Z, X)
        assert low == np.inf and high == -np.inf

    def test_nan_hits_nothing(self, interval):
        for o, d in ((X * np.float32(np.nan), X), (-3 * X, X * np.float32(np.nan))):
            low, high = interval(o, d)
            assert not enters(low, high, 10.0) and not enters_backwards(low, high, 10.0)

    def test_t_counts_in_lengths_of_the_direction(self, interval):
        low, high = interval(-3 * X, 2 * X)
        np.testing.assert_allclose([low, high], [1, 2], atol=1e-5)


def test_a_line_along_a_cylinders_axis_enters_through_the_cap():
    low, high = cylinder_interval(-3 * Z, Z, 0.5, 1.0)
    np.testing.assert_allclose([low, high], [2, 4], atol=1e-5)
    low, high = cylinder_interval(-3 * Z + X, Z, 0.5, 1.0)
    assert low == np.inf and high == -np.inf


def test_bullets_rays_see_shapes_grown_by_inflate():
    beside = -3 * X + 1.001 * Z
    assert not enters(*polyhedron_interval(beside, X, CUBE), 5.0)
    assert enters(*polyhedron_interval(beside, X, CUBE, 0.00175), 5.0)


def test_padding_planes_alone_are_no_piece():
    nothing = np.tile(np.array([0, 0, 0, 1], np.float32), (4, 1))
    assert not enters(*polyhedron_interval(-3 * X, X, nothing), np.inf)


@given(SEEDS)
def test_rigid_motion_changes_nothing(shapes, seed):
    rng = np.random.default_rng(seed)
    pos, quat = shapes.scatter(rng, 0.2)
    origins = rng.normal(size=(NUM_RAYS, 3)).astype(np.float32)
    directions = -origins / np.linalg.norm(origins, axis=-1, keepdims=True)
    lengths = np.full(NUM_RAYS, 3.0, np.float32)
    turn = poses.quat_normalize(rng.normal(size=4).astype(np.float32))
    shift = rng.normal(size=3).astype(np.float32)
    args = (shapes.kind, shapes.size, shapes.planes)
    before = np.asarray(hit_pieces(origins, directions, lengths, pos, quat, *args))
    moved_pos, moved_quat = poses.compose(shift, turn, pos, quat)
    moved_origins = poses.quat_rotate(turn, origins) + shift
    after = np.asarray(
        hit_pieces(moved_origins, poses.quat_rotate(turn, directions), lengths, moved_pos, moved_quat, *args)
    )
    both = np.isfinite(before) & np.isfinite(after)
    np.testing.assert_allclose(after[both], before[both], atol=1e-3)
    for r, k in zip(*np.nonzero(np.isfinite(before) != np.isfinite(after)), strict=True):
        assert _grazes(shapes, k, pos, quat, origins[r], directions[r])


@pytest.mark.slow
def test_gradients_of_entries_are_finite_and_right(shapes):
    """Moving the origin along the ray brings the entry nearer at the same rate; also where other rays miss."""
    rng = np.random.default_rng(3)
    one_of_each = slice(0, 4)  # sphere, capsule, cylinder, box
    pos, quat = (a[one_of_each] for a in shapes.scatter(rng, 0.2))
    kind, size, planes = shapes.kind[one_of_each], shapes.size[one_of_each], shapes.planes[one_of_each, :12]
    origins = (rng.normal(size=(NUM_RAYS, 3)) * 2).astype(np.float32)
    aims = pos[np.arange(NUM_RAYS) % 4] - origins
    directions = (aims / np.linalg.norm(aims, axis=-1, keepdims=True)).astype(np.float32)

    def whole(origins, pos, quat):
        t = rays_hit_pieces(origins, directions, jnp.full(NUM_RAYS, 5.0), pos, quat, kind, size, planes)
        return jnp.sum(jnp.where(jnp.isfinite(t), t, 0.0)), jnp.sum(jnp.isfinite(t), axis=-1)

    gradients, hits = jax.jit(jax.grad(whole, argnums=(0, 1, 2), has_aux=True))(origins, pos, quat)
    assert hits.sum() > 5
    assert all(np.all(np.isfinite(g)) for g in gradients)
    np.testing.assert_allclose(np.sum(gradients[0] * directions, axis=-1), -hits, atol=1e-2)


def test_kinds_unknown_while_tracing_give_the_same(shapes):
    pos, quat = shapes.scatter(np.random.default_rng(5), 0.2)
    origins = np.random.default_rng(6).normal(size=(NUM_RAYS, 3)).astype(np.float32)
    lengths = np.full(NUM_RAYS, 3.0, np.float32)
    args = (origins, -origins, lengths, pos, quat)
    static = jax.jit(lambda *a: rays_hit_pieces(*a, shapes.kind, shapes.size, shapes.planes))(*args)
    traced = hit_pieces(*args, jnp.asarray(shapes.kind), shapes.size, shapes.planes)
    np.testing.assert_allclose(traced, static, rtol=1e-5)
    assert np.isfinite(static).any() and PieceKind.POLYHEDRON in shapes.kind
