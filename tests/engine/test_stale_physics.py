"""Physics that was used up raises on every engine; forks and saved physics go on as the original does."""

from __future__ import annotations

import copy
import pickle

import bench_scene
import engine_bench
import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.view import SCHEMA, read_field
from ig2mj.errors import EngineError, LostWorldError, StaleStateError

PURE = [pytest.param(name, marks=pytest.mark.slow) for name in ("warp", "jax")]


@pytest.fixture(scope="module", params=["native", *PURE])
def small(request, bench_folder):
    return engine_bench.bench(bench_folder, request.param)


@pytest.fixture(scope="module")
def pushed(bench_folder):
    """Three worlds on two threads in which a hand pushes a box: contacts, forces and awake trees."""
    scene = engine_bench.bench_home(bench_folder, False)
    engine = NativeEngine(scene, 3, threads=2)
    physics = engine.reset()
    for _ in range(6):
        physics, _ = engine.step(physics, CTRL)
    return engine, physics


CTRL = np.tile([0.3, 0.1, 0.0], (3, 1))


def used_up(small):
    """Physics, and what a donating step leaves of it."""
    physics = small.fresh()
    if small.engine.pure:
        donating = jax.jit(small.engine.step, donate_argnums=0)
        physics = small.engine.fork(physics)  # the bench keeps its own
        return physics, donating(physics)[0]
    return physics, small.engine.step(physics)[0]


def test_every_method_refuses_used_physics_and_names_the_remedy(small):
    old, now = used_up(small)
    engine = small.engine
    calls = {
        "check": engine.check,
        "step": engine.step,
        "view": engine.view,
        "time": engine.time,
        "write": lambda p: engine.write(p, Write()),
        "load": lambda p: engine.load(p, small.first),
        "snapshot": engine.snapshot,
        "export": lambda p: engine.export(p, 0),
        "health": engine.health,
        "to_mujoco": lambda p: engine.to_mujoco(p, 0),
        "fork": engine.fork,
        "saved": engine.saved,
    }
    for call in calls.values():
        with pytest.raises(StaleStateError, match=r"is stale.*fork\(state\)"):
            call(old)
    assert "stale" in repr(old) and "stale" not in repr(now)
    assert engine.time(engine.current(now))[0] == pytest.approx(1 / 30)


def test_a_fork_goes_on_as_the_original_whatever_the_other_does(small):
    start = small.write(small.fresh(), small.teleport("box", (0.1, 0.1, 0.9), worlds=[1]))
    start, _ = small.run(start, 2)
    fork = small.engine.fork(start)
    _, first = small.run(start, 3)
    first = jax.tree.map(np.array, first)
    _, second = small.run(fork, 3)
    for name in SCHEMA:
        assert np.asarray(read_field(second, name)).tobytes() == np.asarray(read_field(first, name)).tobytes(), name


def test_saved_physics_goes_on_as_the_original(small):
    start = small.write(small.fresh(), small.teleport("box", (0.1, 0.1, 0.9), worlds=[1]))
    start, _ = small.run(start, 2)
    restored = small.engine.restored(small.engine.saved(start))
    within = 1e-5 if small.engine.pure else 0.0  # other programs round otherwise
    for steps in (0, 3):
        views = [small.run(p, steps)[1] if steps else small.view(p) for p in (start, restored)]
        for name in SCHEMA:
            a, b = (np.asarray(read_field(view, name), np.float64) for view in views)
            np.testing.assert_allclose(a, b, rtol=0, atol=within, err_msg=name)


def test_saved_physics_of_another_number_of_worlds_is_refused(small):
    saved = small.engine.saved(small.fresh())
    three = jax.tree.map(lambda a: np.concatenate([a, a[:1]]), saved)
    with pytest.raises(EngineError, match="3 snapshots do not fit 2 worlds"):
        small.engine.restored(three)


# The native engine, to the bit.


def test_forks_deep_copies_and_pickles_go_on_to_the_last_bit(pushed):
    engine, physics = pushed
    start = engine.fork(physics)
    copies = {"a fork": engine.fork(start), "a deep copy": copy.deepcopy(start)}
    copies["a pickle"] = pickle.loads(pickle.dumps(start))
    copies["a pickle of a pickle"] = pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(start))))
    for what, one in copies.items():
        now, then = engine.view(start), engine.view(one)
        for name in SCHEMA:
            assert read_field(now, name).tobytes() == read_field(then, name).tobytes(), f"{what}: {name}"
    for _ in range(5):
        start, view = engine.step(start, CTRL)
        for what, one in copies.items():
            copies[what], other = engine.step(one, CTRL)
            for name in SCHEMA:
                assert read_field(view, name).tobytes() == read_field(other, name).tobytes(), f"{what}: {name}"
    alone = engine.snapshot(start)
    for what, one in copies.items():
        for a, b in zip(jax.tree.leaves(engine.snapshot(one)), jax.tree.leaves(alone), strict=True):
            assert a.tobytes() == b.tobytes(), what


def test_forces_of_the_last_step_are_copied_and_forgotten_in_the_next(pushed):
    """A hand that presses on a box: copies have its force until the next step, which computes its own."""
    engine, physics = pushed[0], pushed[0].reset()
    down = np.tile([0.0, 0.0, bench_scene.TOP - bench_scene.HAND_START[2]], (3, 1))
    for _ in range(60):
        physics, view = engine.step(physics, down)
    assert (view.agent.finger_force.sum((1, 2)) > 10).any(), "some hand presses"
    copies = [engine.fork(physics), pickle.loads(pickle.dumps(physics))]
    for one in copies:
        np.testing.assert_array_equal(engine.view(one).agent.finger_force, view.agent.finger_force)
    lifted = np.tile([0.0, 0.0, 0.3], (3, 1))
    for ctrl in (down, *[lifted] * 30):
        physics, view = engine.step(physics, ctrl)
        for k, one in enumerate(copies):
            copies[k], then = engine.step(one, ctrl)
            np.testing.assert_array_equal(then.agent.finger_force, view.agent.finger_force)
            np.testing.assert_array_equal(then.link_force, view.link_force)
    assert not view.agent.finger_force.any(), "the hands are lifted"


def test_views_of_used_physics_stay_as_they_were(pushed):
    engine, physics = pushed
    start = engine.fork(physics)
    start, view = engine.step(start, CTRL)
    before = engine.fork(start)
    for _ in range(3):
        start, _ = engine.step(start, CTRL)
    now = engine.view(before)
    for name in SCHEMA:  # fields that nobody has read yet are made of the old arrays, too
        assert read_field(view, name).tobytes() == read_field(now, name).tobytes(), name


def test_copies_of_a_lost_world_are_lost_and_the_others_go_on(pushed):
    engine, physics = pushed
    lost = engine.fork(physics)
    world = lost.worlds[1]
    world.data.qvel[world.model.joint("box/free").dofadr] = np.nan
    with pytest.raises(LostWorldError):
        engine.step(lost, CTRL)
    copies = [engine.fork(lost), pickle.loads(pickle.dumps(lost)), engine.restored(engine.saved(lost))]
    with pytest.raises(LostWorldError, match="'box'"):
        engine.step(lost, CTRL)
    view = engine.view(lost)
    for one in copies:
        assert engine.health(one).finite.tolist() == [True, False, True]
        with pytest.raises(LostWorldError, match="'box'"):
            engine.step(one, CTRL)
        then = engine.view(one)
        for name in ("object_pos", "body_pos", "touching"):
            np.testing.assert_array_equal(read_field(then, name), read_field(view, name), name)


def test_a_step_that_raises_leaves_the_physics_valid(pushed):
    """`LostWorldError` says so: the other worlds go on with the same physics."""
    engine, physics = pushed
    going = engine.fork(physics)
    with pytest.raises(EngineError, match="controls"):
        engine.step(going, np.zeros((3, 1)))
    engine.check(going)


def test_a_pickle_of_another_scene_is_refused(pushed, tiny_home):
    engine, physics = pushed
    other = pickle.loads(pickle.dumps(physics))
    with pytest.raises(EngineError, match="does not fit scene"):
        NativeEngine(tiny_home, 3).step(other)
    with pytest.raises(EngineError, match="step it first"):
        _ = other.worlds
    engine.step(other, CTRL)


def test_an_interrupted_simulation_goes_on(tiny_home, monkeypatch):
    simulation = ig2mj.Simulation(tiny_home, states=None)
    simulation.step()
    taken = simulation.physics

    def interrupted(*_):
        raise KeyboardInterrupt

    react = simulation.core._apply_rules
    monkeypatch.setattr(simulation.core, "_apply_rules", interrupted)  # after physics was stepped
    with pytest.raises(KeyboardInterrupt):
        simulation.step()
    monkeypatch.setattr(simulation.core, "_apply_rules", react)
    simulation.step()
    assert simulation.time == pytest.approx(3 / 30)
    with pytest.raises(StaleStateError):
        simulation.engine.view(taken)


@pytest.mark.slow
def test_physics_of_warp_is_neither_pickled_nor_deep_copied(bench_folder):
    physics = engine_bench.bench(bench_folder, "warp").fresh()
    for take in (copy.deepcopy, pickle.dumps):
        with pytest.raises(EngineError, match=r"env\.fork\(state\).*env\.save\(state, file\)"):
            take(physics)
    assert copy.copy(physics).data is physics.data


@pytest.mark.slow
def test_physics_of_mjx_in_jax_is_pickled(bench_folder):
    bench = engine_bench.bench(bench_folder, "jax")
    for one in (copy.deepcopy(bench.fresh()), pickle.loads(pickle.dumps(bench.fresh()))):
        np.testing.assert_array_equal(bench.view(one).object_pos, bench.view(bench.fresh()).object_pos)
