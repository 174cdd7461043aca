"""Contacts of a hand with an object that it ignores are dropped, all others stay; per world, on every engine."""

from __future__ import annotations

import bench_scene
import engine_bench
import numpy as np
import pytest

from ig2mj.engine.base import Write

THROUGH = bench_scene.TOP - bench_scene.HAND_START[2]
"""Control that drives the hand through the box down to the table."""


@pytest.fixture(params=["native", *(pytest.param(n, marks=pytest.mark.slow) for n in ("warp", "jax"))])
def full(request, bench_folder) -> engine_bench.Bench:
    """The whole bench with its hand in two worlds, on each engine in turn."""
    return engine_bench.bench(bench_folder, request.param, 2, False)


def ignoring(bench, worlds: list[int], name: str = "box") -> Write:
    ignored = np.zeros((bench.num_worlds, 1, len(bench.scene.object_names)), bool)
    ignored[worlds, 0, bench.index(name)] = True
    return Write(ignored_contacts=ignored)


def test_a_hand_passes_through_what_it_ignores_and_stops_at_the_table(full):
    physics = full.write(full.fresh(), ignoring(full, [1]))
    ctrl = np.array([[0.0, 0.0, THROUGH]] * 2, np.float32)
    physics, view = full.run(physics, 60, ctrl)
    height = np.asarray(view.agent.hand_pos)[:, 0, 2]
    box, table = full.index("box"), full.index("table")
    top = bench_scene.TOP + 2 * bench_scene.HALF
    assert height[0] > top and height[1] == pytest.approx(bench_scene.TOP + 0.04, abs=0.005)
    assert np.asarray(view.agent.touching)[:, 0, box].tolist() == [True, False]
    assert np.asarray(view.agent.touching)[:, 0, table].tolist() == [False, True]
    assert full.touches(view, "box", "table").all(), "its other contacts are unharmed"
    assert full.z(view, "box")[1] == pytest.approx(bench_scene.TOP + bench_scene.HALF, abs=0.002)
    forces = np.asarray(view.agent.finger_force)[:, 0].sum(1)
    assert forces[0] > 10 and forces[1] == 0


def touches_box(full, view) -> list[bool]:
    return np.asarray(view.agent.touching)[:, 0, full.index("box")].tolist()


def test_what_is_ignored_from_now_on_is_touched_no_more(full):
    """Before any step, and without a forward pass on MJX; forces are forgotten where something changed, only there."""
    ctrl = np.array([[0.0, 0.0, THROUGH]] * 2, np.float32)
    physics, before = full.run(full.fresh(), 60, ctrl)
    assert touches_box(full, before) == [True, True]
    view = full.view(full.write(physics, ignoring(full, [1])))
    assert touches_box(full, view) == [True, False]
    assert full.touches(view, "box", "table").all()
    assert (np.asarray(view.agent.finger_force).sum((1, 2)) > 0).tolist() == [True, False]


def test_what_is_ignored_no_more_is_touched_again(full):
    ctrl = np.array([[0.0, 0.0, THROUGH]] * 2, np.float32)
    physics, view = full.run(full.write(full.fresh(), ignoring(full, [0, 1])), 60, ctrl)
    assert touches_box(full, view) == [False, False]
    physics = full.write(physics, ignoring(full, [1]))
    if full.engine.name == "native":
        assert touches_box(full, full.view(physics)) == [True, False], "before any step"
    _, view = full.run(physics, 1, ctrl)
    assert touches_box(full, view) == [True, False]


def test_to_ignore_something_else_changes_nothing(full):
    ctrl = np.array([[0.0, 0.0, THROUGH]] * 2, np.float32)
    plain, _ = full.run(full.fresh(), 30, ctrl)
    other, _ = full.run(full.write(full.fresh(), ignoring(full, [0], "knife")), 30, ctrl)
    one, two = (full.engine.export(physics, 0) for physics in (plain, other))
    np.testing.assert_allclose(one.qpos, two.qpos, atol=1e-5)


def test_what_is_ignored_is_saved_and_loaded(full):
    physics = full.write(full.fresh(), ignoring(full, [1]))
    row = full.engine.export(physics, 1)
    assert row.agents.ignored_contacts.sum() == 1
    physics = full.load(full.fresh(), full.every(row))
    ctrl = np.array([[0.0, 0.0, THROUGH]] * 2, np.float32)
    _, view = full.run(physics, 60, ctrl)
    assert (np.asarray(view.agent.hand_pos)[:, 0, 2] < bench_scene.TOP + 0.05).all()


def test_two_hands_ignore_different_objects(tiny_home_folder):
    """Bits of C MuJoCo: every pair but the ignored ones keeps a bit in common."""
    import ig2mj
    from ig2mj.agents.floating_hand import FloatingHand
    from ig2mj.engine.contact_filter import BitLayers, geom_hands

    hands = [FloatingHand(pos=(x, 0, 1), name=f"hand_{x}") for x in (-1, 0, 1)]
    scene = ig2mj.load_scene(tiny_home_folder, agents=hands)
    model, tables = scene.model, scene.tables
    ignored = np.zeros((3, tables.num_objects), bool)
    ignored[0, [2, 5]] = ignored[2, [5, 6]] = True
    contype, conaffinity = BitLayers(model, tables).masks(ignored)

    def meet(types, affinities):
        return (types[:, None] & affinities) != 0

    before, after = meet(model.geom_contype, model.geom_conaffinity), meet(contype, conaffinity)
    before, after = before | before.T, after | after.T
    hand, thing = geom_hands(model, tables), tables.geom_object
    drop = (hand[:, None] >= 0) & (thing >= 0) & ignored[hand[:, None], thing]
    np.testing.assert_array_equal(after, before & ~drop & ~drop.T)
    assert (before & drop).any()
