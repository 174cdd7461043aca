"""States of plug-ins are states as ig2mj's own: stepped (incrementally too), inherited, saved, recorded, replayed."""

from __future__ import annotations

import dataclasses
import json
import pickle

import h5py
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import registries
from hand_world import HandWorld, Item
from jaxtyping import Float, Int

import ig2mj
from ig2mj.demos import Recording
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.view import Array
from ig2mj.errors import InputError, PluginError, StateError
from ig2mj.predicates import Predicate
from ig2mj.states import StateSpec, initial_states, states_of_manifest
from ig2mj.states.added_checks import AddedUpdates
from ig2mj.states.spec import Cut
from ig2mj.states.world import added_fields, states_class
from ig2mj.worlds import Pool, Worlds, load_pool, save_pool


def _grow_old(step):
    return step.having(age=step.states.age + jnp.where(step.in_use, step.model.options.timestep, 0.0))


def _count_moves(step):
    """Knocks: how often an object was seen at more than 1 cm from where it was last."""
    now = jnp.asarray(step.view.object_pos)
    moved = jnp.linalg.norm(now - step.states.seen_at, axis=-1) > 0.01
    seen = jnp.where(moved[..., None], now, step.states.seen_at)
    return step.having(knocks=step.states.knocks + moved, seen_at=seen)


AGE = StateSpec.of_objects("age", float, 0.0, _grow_old, unit="s", abilities=("cookable",), part="heat")
KNOCKS = dataclasses.replace(
    StateSpec.of_objects("knocks", int, 0, _count_moves, abilities=None),
    fields={"knocks": Int[Array, "W O"], "seen_at": Float[Array, "W O 3"]},
    initial=lambda model: {
        "knocks": np.zeros((1, model.tables.num_objects), np.int32),
        "seen_at": np.zeros((1, model.tables.num_objects, 3), np.float32),
    },
    inherit=lambda states, cut: {"knocks": cut.of_whole(states.knocks)},
)
OLD = Predicate.of_states(
    lambda model, states: states.age > 1.0,
    name="old",
    ability="cookable",
    set=lambda model, states, objects, value: {"age": jnp.where(objects, 9.0 * value, states.age)},
)


@pytest.fixture(scope="module", autouse=True)
def home(tiny_home):
    """The tiny home with two states of a plug-in and a predicate."""
    with registries.restored():
        plain = ig2mj.Simulation(tiny_home)
        _ = plain.states
        ig2mj.register(states=[KNOCKS, AGE], predicates=[OLD])
        yield tiny_home, plain


@pytest.fixture(scope="module")
def world(home):
    return ig2mj.Simulation(home[0])


def test_they_are_stepped_asked_and_set(world):
    world.reset()
    world.step(count=3)
    assert world.state("age", "apple") == pytest.approx(0.1) and world.state("age", "apple_half_0") == 0.0
    assert max(world.state("knocks").values()) == 1
    assert not world.predicate("old", "apple")
    world.set_state("old", "apple", True)
    assert world.state("age", "apple") == 9.0 and world.holds("(old apple)")
    world.set_state("age", "apple", 0.5)
    assert "age is" not in world.explain("(old apple)") and not world.holds("(old apple)")


def test_halves_inherit_them(world):
    model, names = world.state_model, world.scene.object_names
    whole, half = names.index("apple"), names.index("apple_half_1")
    states = dataclasses.replace(
        initial_states(model, 1),
        age=jnp.arange(len(names), dtype=jnp.float32)[None],
        knocks=jnp.ones((1, len(names)), int),
    )
    source = np.arange(len(names))
    source[half] = whole
    after = states.inherited(Cut(model, np.arange(len(names))[None] == half, source))
    assert float(after.age[0, half]) == whole and float(after.age[0, whole]) == whole


def test_a_simulation_from_before_the_registration_says_so(home):
    with pytest.raises(StateError, match="'age' was registered after these states were made: load the scene again"):
        home[1].state("age", "apple")
    assert type(home[1].states) is not type(ig2mj.Simulation(home[0]).states)


def test_steps_that_skip_what_cannot_change_give_the_same_bytes(home):
    """A heated fish, an apple that is put somewhere, long rest; with every step whole and without."""

    def story(incremental):
        world = ig2mj.Simulation(home[0], incremental=incremental)
        world.set_state("toggled_on", "stove", True)
        world.step(count=40)
        world.set_object_pose("apple", (0.0, 1.6, 0.861))
        world.step(count=40)
        return jax.tree.map(np.asarray, world.states)

    skipped, whole = story(True), story(False)
    assert added_fields(skipped) == ["age", "knocks", "seen_at"]
    for name in skipped.__dataclass_fields__:
        assert all(map(np.array_equal, *map(jax.tree.leaves, (getattr(skipped, name), getattr(whole, name))))), name


def test_a_world_is_saved_with_them_and_older_files_begin_with_them(world, home, tmp_path):
    world.reset()
    world.step(count=3)
    world.save(tmp_path / "with.npz")
    world.step(count=3)
    world.load(tmp_path / "with.npz")
    assert world.state("age", "apple") == pytest.approx(0.1)
    home[1].save(tmp_path / "without.npz")
    world.load(tmp_path / "without.npz")
    assert world.state("age", "apple") == 0.0
    with pytest.raises(InputError, match=r"holds the state 'age', which is not registered here \(it is from module "):
        home[1].load(tmp_path / "with.npz")


def test_a_manifest_may_give_them(world):
    scene = world.scene
    entry = scene.manifest.objects[scene.object_index("apple")]
    entry.state = {"age": 7.0}
    try:
        states = states_of_manifest(world.state_model, scene.manifest, {})
    finally:
        entry.state = {}
    assert float(states.age[0, scene.object_index("apple")]) == 7.0


@pytest.mark.slow
def test_pools_have_them_or_are_completed(world, home, tmp_path):
    scene, engine = home[0], NativeEngine(home[0])
    physics = jax.tree.map(lambda leaf: np.asarray(leaf)[None], engine.export(engine.reset(), 0))
    aged = dataclasses.replace(initial_states(world.state_model, 1), age=jnp.full((1, len(scene.object_names)), 7.0))
    save_pool(Pool(physics=physics, states=aged), tmp_path / "with.npz", scene)
    save_pool(Pool(physics=physics, states=home[1].states), tmp_path / "without.npz", scene)
    for name, age in (("with", 7.0), ("without", 0.0)):
        pool = load_pool(tmp_path / f"{name}.npz", scene)
        batch = Worlds(scene, 2, "native", pool=pool).start(seed=0)
        assert np.asarray(batch.world.states.age)[:, 0].tolist() == [age, age]
    with registries.restored():
        registries.forget()
        with pytest.warns(UserWarning, match="states of plug-ins that are not here are left out: 'age' of module "):
            assert added_fields(load_pool(tmp_path / "with.npz", scene).states) == []


def test_pickles_and_snapshots_carry_them(world, home):
    world.reset()
    world.step(count=3)
    copy = pickle.loads(pickle.dumps(world.states))
    assert type(copy) is type(world.states) and np.array_equal(copy.age, world.states.age)
    snapshot = world.engine.export(world.physics, 0)
    assert ig2mj.Simulation.from_snapshot(home[0], snapshot, world.states).state("age", "apple") > 0
    assert ig2mj.Simulation.from_snapshot(home[0], snapshot, home[1].states).state("age", "apple") == 0
    assert world.fork().state("age", "apple") == world.state("age", "apple")


def test_recordings_name_them_and_come_out_the_same(world, home, tmp_path):
    world.reset()
    with world.record(tmp_path / "with.h5"):
        world.step(count=4)
    with Recording(tmp_path / "with.h5") as recording:
        kept = json.loads(recording.header["plugin_states"])
        assert set(kept) == {"age", "knocks", "seen_at"} and recording.header["acting_states"] == "none"
        assert recording.runs[0].all_rows("frames/states/age")[-1].max() == pytest.approx(4 / 30)
    again = ig2mj.Simulation(home[0])
    assert again.replay(tmp_path / "with.h5").differences == []
    with pytest.raises(InputError, match=r"the state 'age' of module .* is not registered here"):
        home[1].replay(tmp_path / "with.h5")


@pytest.mark.slow
def test_recordings_without_them_can_be_replayed_with_them(world, home, tmp_path):
    home[1].reset()
    with home[1].record(tmp_path / "without.h5"):
        home[1].step(count=4)
    done = world.replay(tmp_path / "without.h5")
    assert (done.frames, done.differences, done.warnings) == (5, [], [])
    assert world.state("age", "apple") == pytest.approx(4 / 30)


@pytest.mark.slow
def test_a_recording_says_where_the_plug_in_computes_something_else(world, home, tmp_path):
    world.reset()
    with world.record(tmp_path / "with.h5"):
        world.step(count=2)
    with h5py.File(tmp_path / "with.h5", "a") as opened:
        opened.attrs["plugin_states_hash"] = "0"
    assert "plugin_states_hash was 0" in world.replay(tmp_path / "with.h5").warnings[0]
    with h5py.File(tmp_path / "with.h5", "a") as opened:
        opened.attrs["acting_states"] = "fire"
    with pytest.raises(InputError, match="acting_states was fire, and is none here"):
        world.replay(tmp_path / "with.h5")


# What an update may do, found by tracing it.


def _model(*specs: StateSpec):
    model = HandWorld(Item("rock"), Item("stove", abilities={"heatSource": {"requires_inside": False}})).model()
    return dataclasses.replace(model, added=specs)


def _state(update, part="events", **others) -> StateSpec:
    return StateSpec.of_objects("mine", float, 0.0, update, abilities=None, part=part, **others)


@pytest.mark.parametrize(
    ("spec", "whole", "acts", "reads"),
    [
        (AGE, False, (), ()),
        (KNOCKS, False, (), ("object_pos",)),
        (_state(lambda s: s.having(mine=s.states.temperature), "heat"), False, (), ()),
        (_state(lambda s: s.having(mine=s.states.temperature)), True, (), ()),
        (_state(lambda s: s.having(temperature=s.states.mine), "heat"), False, ("mine",), ()),
        (_state(lambda s: s.having(wetness=s.states.wetness + 1), "heat"), True, ("mine",), ()),
        (_state(lambda s: s.having(toggled_on=s.states.mine > 0)), False, ("mine",), ()),
        (
            _state(lambda s: s.having(mine=s.view.agent.finger_pos.sum((1, 2))[:, None] + s.states.mine)),
            False,
            (),
            None,
        ),
        (
            _state(
                lambda s: s.having(mine=s.states.mine.at[:, 0].add(s.relations.inside([(0, 1)])[:, 0])),
                queries=lambda model: [("inside", 0, 1)],
            ),
            False,
            (),
            None,
        ),
    ],
)
def test_what_an_update_reads_and_changes_is_found(spec, whole, acts, reads):
    found = AddedUpdates.of(_model(spec))
    assert (found.whole, found.acts) == (whole, acts)
    assert reads is None or found.reads == set(reads)
    assert found.digest == AddedUpdates.of(_model(spec)).digest != AddedUpdates.of(_model(AGE, KNOCKS)).digest


@pytest.mark.parametrize(
    ("spec", "line"),
    [
        (
            _state(lambda s: s.having(mine=s.states.mine[0])),
            r"gives 'mine' as float32\[2\]; float32\[2, 2\] is expected",
        ),
        (_state(lambda s: s.having(mine=s.states.mine > 0)), r"'mine' as bool\[2, 2\]; float32"),
        (_state(lambda s: s.states), "update of state 'mine' gives .*; EventStep is expected"),
        (_state(lambda s: s.having(mine=s.states.nothing)), "update of state 'mine' .* fails: AttributeError"),
        (_state(lambda s: s.having(nothing=0), "heat"), "update of state 'mine' .part 'heat'. fails: TypeError"),
        (
            dataclasses.replace(_state(lambda s: s), initial=lambda model: {"mine": np.zeros((2, 2), "f4")}),
            r"its initial gives 'mine' of shape \(2, 2\); the first axis is that of worlds, and is 1",
        ),
        (
            dataclasses.replace(_state(lambda s: s), initial=lambda model: {"mine": [0.0]}),
            r"its initial gives 'mine' as list , which is not of the field's",
        ),
        (
            dataclasses.replace(_state(lambda s: s), initial=lambda model: {}),
            r"has fields \['mine'\], and its initial gives \[\]",
        ),
    ],
)
def test_an_update_at_fault_is_named_before_the_first_step(spec, line):
    with pytest.raises(PluginError, match=line):
        AddedUpdates.of(_model(spec))


def test_a_state_of_no_part_is_refused():
    with pytest.raises(ValueError, match="parts are 'events' and 'heat'"):
        _state(lambda s: s, "later")
    with pytest.raises(ValueError, match="has queries, which only an update of the part 'events' can read"):
        _state(lambda s: s, "heat", queries=lambda model: [])


def test_the_class_of_states_is_the_same_for_the_same_fields():
    assert states_class([AGE, KNOCKS]) is states_class([KNOCKS, AGE])
    assert states_class([]) is type(initial_states(_model(), 1))
