"""On MuJoCo Warp as it comes everything works, grasping by constraints included; it is only slower."""

from __future__ import annotations

import types

import bench_scene
import engine_bench
import numpy as np
import pytest
import warp as wp
from mujoco.mjx.warp import forward

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.engine.contact_filter import DROPPED_DISTANCE
from ig2mj.engine.warp import ignored_contacts, patches
from ig2mj.testing import api_test

ACTIVITIES = [
    "BimanualPickAndPlace",
    "CookingMeat",
    "GraspingBook",
    "SlicingFruit",
    "SoakingTowel",
    "CleaningStainedShelf",
]

HANDS, OBJECTS, WORLDS = 2, 3, 4
GEOM_HAND = np.array([-1, 0, 0, 1, -1, -1, -1, -1])
GEOM_OBJECT = np.array([-1, -1, -1, -1, 0, 1, 1, 2])


def test_exactly_the_ignored_pairs_of_each_world_are_dropped(kernel_device):
    rng = np.random.default_rng(0)
    ignored = rng.random((WORLDS, HANDS, OBJECTS)) < 0.4
    pairs = np.array([(a, b) for a in range(8) for b in range(8)] * WORLDS, np.int32)
    world = np.repeat(np.arange(WORLDS), 64).astype(np.int32)
    count = len(pairs) - 10  # rows past the count are not looked at
    geom = wp.array(pairs, dtype=wp.vec2i)
    dist = wp.zeros(len(pairs), dtype=float)
    code = ignored_contacts.encode(GEOM_HAND, GEOM_OBJECT, OBJECTS)
    model = types.SimpleNamespace(
        npair=0,
        flg_adhesion=False,
        geom_adhesion=wp.array(code[None], dtype=float),
        pair_adhesion=wp.array(ignored.reshape(WORLDS, -1).astype(np.float32), dtype=float),
    )
    contact = types.SimpleNamespace(geom=geom, dist=dist, worldid=wp.array(world, dtype=int))
    data = types.SimpleNamespace(naconmax=len(pairs), nacon=wp.array([count], dtype=int), contact=contact)
    for _ in range(2):  # as in both passes of a step
        ignored_contacts._drop_ignored(model, data)
    expected = np.zeros(len(pairs), bool)
    for row, ((a, b), w) in enumerate(zip(pairs[:count], world, strict=False)):
        for one, other in ((a, b), (b, a)):
            hand, thing = GEOM_HAND[one], GEOM_OBJECT[other]
            expected[row] |= hand >= 0 and thing >= 0 and ignored[w, hand, thing]
    assert 20 < expected.sum() < 150
    assert np.array_equal(dist.numpy() == DROPPED_DISTANCE, expected)
    assert np.array_equal((geom.numpy() == -1).all(1), expected)


def test_other_models_of_the_process_notice_nothing_of_the_filter(monkeypatch):
    """A filter that was there before runs first, and models without codes are left as they are."""
    called = []
    monkeypatch.setattr(forward._cb, "contactfilter", lambda m, d: called.append(m))
    for _ in range(2):
        ignored_contacts.filter_contacts()
    monkeypatch.setattr(wp, "launch", lambda *args, **kwargs: pytest.fail("a kernel is launched"))
    model = types.SimpleNamespace(npair=0, flg_adhesion=False, pair_adhesion=np.zeros((1, 0)))
    forward._cb.contactfilter(model, None)
    assert called == [model]


@pytest.fixture
def plain(bench_folder) -> engine_bench.Bench:
    """The whole bench with its hand in two worlds, on MuJoCo Warp as it comes."""
    with patches.upstream_kernels():
        bench = engine_bench.bench(bench_folder, "warp", 2, False)
    assert not bench.engine.own_kernels
    return bench


@pytest.mark.slow
def test_a_hand_passes_through_what_it_ignores_in_one_world(plain):
    ignored = np.zeros((2, 1, len(plain.scene.object_names)), bool)
    ignored[1, 0, plain.index("box")] = True
    physics = plain.write(plain.fresh(), Write(ignored_contacts=ignored))
    through = bench_scene.TOP - bench_scene.HAND_START[2]
    ctrl = np.array([[0.0, 0.0, through]] * 2, np.float32)
    for _ in range(60):
        physics, view = plain.run(physics, 1, ctrl)
        touching = np.asarray(view.agent.touching)[:, 0, plain.index("box")].tolist()
    assert touching == [True, False]
    height = np.asarray(view.agent.hand_pos)[:, 0, 2]
    assert height[0] > bench_scene.TOP + 2 * bench_scene.HALF > height[1]


@pytest.mark.slow
@pytest.mark.parametrize("activity", ACTIVITIES)
def test_an_activity_keeps_its_promises_without_patches(activity):
    """With the grasping that it has by default, which ignores contacts of what is held."""
    with patches.upstream_kernels():
        env = ig2mj.make(activity, worlds=2, engine="warp", pool_size=4)
        assert not env.core.engine.own_kernels and env.core.grasping is not None
        api_test(env, steps=2, within=1e-3, astray=0.5)
