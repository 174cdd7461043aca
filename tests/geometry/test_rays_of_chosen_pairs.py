"""`RayTargets`: the planned computation gives what the plain one gives, for every kind, pair and padding."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from plain_rays import rays_hit_pieces

from ig2mj.geometry import poses
from ig2mj.geometry.hulls import signed_depth
from ig2mj.geometry.targets import RayTargets, fall_contact, lines_enter_targets

hit_pieces = jax.jit(rays_hit_pieces, static_argnames="inflate")
W, BODIES = 6, 4
DIRECTIONS = np.array([[0, 0, 1], [1, 0, 0], [0.6, 0.8, 0]], np.float32)
LENGTHS = np.array([5.0, 1.0, 0.7], np.float32)
PAIR_TARGETS = np.array([2, 0, 1, 0, 3])  # object 3 owns nothing


@pytest.fixture(scope="module")
def house(shapes):
    """Ten pieces on four bodies of three objects, with offsets in their bodies, in three worlds."""
    rng = np.random.default_rng(11)
    quat = poses.quat_normalize(rng.normal(size=(shapes.count, 4)).astype(np.float32))
    tables = {
        "piece_object": np.array([0, 0, 0, 1, 1, 2, 2, 2, 2, 0]),
        "piece_body": np.array([0, 0, 3, 1, 1, 2, 2, 2, 2, 0]),
        "piece_pos": (rng.normal(size=(shapes.count, 3)) * 0.1).astype(np.float32),
        "piece_quat": np.asarray(quat),
        "piece_kind": shapes.kind,
        "piece_size": shapes.size,
        "piece_planes": shapes.planes,
    }
    body_pos = (rng.normal(size=(W, BODIES, 3)) * 0.2).astype(np.float32)
    body_quat = np.asarray(poses.quat_normalize(rng.normal(size=(W, BODIES, 4)).astype(np.float32)))
    return tables, body_pos, body_quat


def plain_entries(house, origins, directions, lengths, inflate=0.0) -> np.ndarray:
    """[W, P, R] by `rays_hit_pieces` on all pieces."""
    tables, body_pos, body_quat = house
    body = tables["piece_body"]
    pos, quat = poses.compose(body_pos[:, body], body_quat[:, body], tables["piece_pos"], tables["piece_quat"])
    rest = (tables["piece_kind"], tables["piece_size"], tables["piece_planes"])
    found = []
    for p, target in enumerate(PAIR_TARGETS):
        o = np.broadcast_to(origins[:, p, None], (W, len(directions), 3))
        t = np.asarray(hit_pieces(o, np.broadcast_to(directions, o.shape), lengths, pos, quat, *rest, inflate=inflate))
        found.append(np.isfinite(t[:, :, tables["piece_object"] == target]).any(axis=-1))
    return np.stack(found, axis=1)


@pytest.mark.parametrize("inflate", [pytest.param(0.0, marks=pytest.mark.slow), 0.00175])
def test_planned_lines_agree_with_plain_rays_both_ways(house, inflate):
    tables, body_pos, body_quat = house
    origins = (np.random.default_rng(1).normal(size=(W, len(PAIR_TARGETS), 3)) * 0.2).astype(np.float32)
    targets = RayTargets.from_pieces(PAIR_TARGETS, **tables)
    forwards, backwards = jax.jit(
        lambda pos, quat, o: lines_enter_targets(targets, pos, quat, o, DIRECTIONS, LENGTHS, inflate)
    )(body_pos, body_quat, origins)
    np.testing.assert_array_equal(forwards, plain_entries(house, origins, DIRECTIONS, LENGTHS, inflate))
    np.testing.assert_array_equal(backwards, plain_entries(house, origins, -DIRECTIONS, LENGTHS, inflate))
    assert 0.05 < np.asarray(forwards).mean() < 0.95, "the example shall have both answers"
    assert not np.asarray(forwards)[:, PAIR_TARGETS == 3].any(), "an object without pieces is never entered"
    one_way = jax.jit(lambda o: lines_enter_targets(targets, body_pos, body_quat, o, DIRECTIONS, LENGTHS, inflate)[0])
    np.testing.assert_array_equal(one_way(origins), forwards)


def test_nan_poses_and_origins_enter_nothing(house):
    tables, body_pos, body_quat = house
    targets = RayTargets.from_pieces(PAIR_TARGETS, **tables)
    origins = np.zeros((W, len(PAIR_TARGETS), 3), np.float32) + 0.4
    distances = np.ones(origins.shape[:2], np.float32)

    @jax.jit
    def ask(pos, quat, o):
        return (
            *lines_enter_targets(targets, pos, quat, o, DIRECTIONS, LENGTHS),
            jnp.isfinite(fall_contact(targets, pos, quat, o, distances)),
        )

    assert any(map(np.any, ask(body_pos, body_quat, origins * 0)))
    bad = np.full_like
    for args in (
        (bad(body_pos, np.nan), body_quat, origins),
        (body_pos, bad(body_quat, np.nan), origins),
        (body_pos, body_quat, bad(origins, np.nan)),
    ):
        assert not any(map(np.any, ask(*args)))


def test_no_pairs_and_no_pieces_are_fine(house):
    tables, body_pos, body_quat = house
    none = RayTargets.from_pieces(np.zeros(0, int), **tables)
    assert lines_enter_targets(none, body_pos, body_quat, np.zeros((W, 0, 3), np.float32), DIRECTIONS, LENGTHS)[
        0
    ].shape == (W, 0, 3)
    bare = RayTargets.from_pieces(np.array([3]), **tables)
    assert not np.any(lines_enter_targets(bare, body_pos, body_quat, np.zeros((W, 1, 3)), DIRECTIONS, LENGTHS))


@pytest.mark.slow
def test_a_falling_point_stops_at_the_first_surface_or_at_once_when_inside(house):
    tables, body_pos, body_quat = house
    targets = RayTargets.from_pieces(PAIR_TARGETS, **tables)
    rng = np.random.default_rng(4)
    points = (rng.normal(size=(W, 20, 3)) * 0.25).astype(np.float32)
    far = np.full((W, 20), 0.3, np.float32)
    reach = np.asarray(jax.jit(lambda p: fall_contact(targets, body_pos, body_quat, p, far))(points))
    body = tables["piece_body"]
    pos, quat = poses.compose(body_pos[:, body], body_quat[:, body], tables["piece_pos"], tables["piece_quat"])

    def depth(points: np.ndarray) -> np.ndarray:
        """Depth in each pair's target [W, N, P]."""
        local = poses.quat_rotate_inverse(quat[:, None], points[:, :, None] - pos[:, None])
        each = np.asarray(signed_depth(tables["piece_kind"], tables["piece_size"], tables["piece_planes"], local))
        owned = [np.where(tables["piece_object"] == t, each, -np.inf).max(axis=-1) for t in PAIR_TARGETS]
        return np.stack(owned, axis=-1)

    inside = depth(points) > 1e-4
    np.testing.assert_array_equal(reach[inside], 0.0)
    at_start = depth(points) < -1e-4
    for p in range(len(PAIR_TARGETS)):
        landed = np.isfinite(reach[..., p]) & at_start[..., p]
        fall = np.where(landed, reach[..., p], 0.0)
        end = points - np.stack([0 * fall, 0 * fall, fall], axis=-1)
        np.testing.assert_allclose(depth(end)[..., p][landed], 0.0, atol=1e-4)
        # Nothing on the way: sampled heights above the landing are outside.
        for share in (0.25, 0.5, 0.75):
            between = points - np.stack([0 * fall, 0 * fall, share * fall], axis=-1)
            assert np.all(depth(between)[..., p][landed] < 1e-4)
    assert inside.any() and np.isfinite(reach[at_start]).any() and np.isinf(reach).any()


@pytest.mark.slow
def test_works_under_vmap_over_variants(house):
    """A batch of batches: what a search over placements does."""
    tables, body_pos, body_quat = house
    targets = RayTargets.from_pieces(PAIR_TARGETS, **tables)
    origins = (np.random.default_rng(2).normal(size=(2, W, len(PAIR_TARGETS), 3)) * 0.3).astype(np.float32)

    def one(o):
        return lines_enter_targets(targets, body_pos, body_quat, o, DIRECTIONS, LENGTHS)[0]

    together = jax.jit(jax.vmap(one))(jnp.asarray(origins))
    np.testing.assert_array_equal(together, np.stack([jax.jit(one)(o) for o in origins]))
