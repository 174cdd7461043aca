"""`first_met` finds what `fall_contact` finds: the least depth of all objects, and the object."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from hand_world import HandWorld, Item

from ig2mj.geometry.first_fall import FallPieces, Ways, first_met
from ig2mj.geometry.targets import RayTargets, fall_contact

RNG = np.random.default_rng(0)
LINES, SHIFT, DEPTHS = 40, np.array([0.1, 0.3], np.float32), np.array([0.0, 0.4, 2.0], np.float32)


def _world(count: int) -> HandWorld:
    """A floor and boxes in disorder over it."""
    items = [Item("floor", (((0, 0, -0.1), (3, 3, 0.1)),), fixed=True)]
    for n in range(count):
        quat, pos = RNG.normal(size=4), tuple(RNG.uniform((-1, -1, 0), (1, 1, 2)))
        boxes = tuple((tuple(RNG.uniform(-0.2, 0.2, 3)), tuple(RNG.uniform(0.05, 0.3, 3))) for _ in range(3))
        items.append(Item(f"box{n}", boxes, pos=pos, quat=tuple(quat / np.linalg.norm(quat))))
    return HandWorld(*items)


@pytest.mark.slow
@pytest.mark.parametrize("rests", [False, True])
@pytest.mark.parametrize("backend", ["cpu", "gpu"])
def test_the_first_object_is_the_one_of_least_depth(backend, rests, monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: backend)  # the object is found in another way on each
    world = _world(20)
    view = world.view()
    half = np.arange(len(world.tables.body_rests)) % 2 == 1  # bodies that never move are computed in another way
    tables = dataclasses.replace(
        world.tables,
        body_rests=half & rests,
        body_rest_pos=np.asarray(view.body_pos[0]),
        body_rest_quat=np.asarray(view.body_quat[0]),
    )
    begin = RNG.uniform(-1.2, 1.2, (1, LINES, 3)).astype(np.float32) + np.array([0, 0, 1.5], np.float32)
    aside = RNG.uniform(-1.0, 1.0, (1, LINES, 2)).astype(np.float32)
    moved = np.concatenate([SHIFT[:, None] * aside[:, :, None], np.tile(-DEPTHS[:-1, None], (1, LINES, 1, 1))], axis=-1)
    start, length = begin[:, :, None] + moved, np.tile(np.diff(DEPTHS), (1, LINES, 1))
    ignored = RNG.integers(-1, tables.num_objects, (1, LINES)).astype(np.int32)
    active = RNG.random((1, LINES)) < 0.8
    every = fall_contact(
        RayTargets.build(tables, np.arange(tables.num_objects)),
        view.body_pos, view.body_quat, start.reshape(1, -1, 3), length.reshape(1, -1),
    )  # fmt: skip
    reach = np.asarray(every).reshape(1, LINES, 2, -1) + DEPTHS[:-1, None]
    reach = np.where(ignored[..., None, None] == np.arange(tables.num_objects), np.inf, reach).min(axis=2)
    reach = np.where(active[..., None], reach, np.inf)
    ways = (active, [*begin.transpose(2, 0, 1)], [*aside.transpose(2, 0, 1)], ignored)
    found = jax.jit(lambda p, q, w: first_met(FallPieces.of(tables), p, q, Ways(*w, SHIFT, DEPTHS)))(
        view.body_pos, view.body_quat, ways
    )
    np.testing.assert_allclose(found.depth, reach.min(-1), rtol=1e-5, atol=1e-5)
    expected = np.where(np.isfinite(reach.min(-1)), reach.argmin(-1), -1)
    np.testing.assert_array_equal(found.object, expected)
    assert len(np.unique(expected)) > 6, "the lines meet many objects"
