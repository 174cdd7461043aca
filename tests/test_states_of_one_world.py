"""`Simulation` and extended states: ask, set, explain, save and restore, on the native engine."""

from __future__ import annotations

import re

import jax
import jaxtyping
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.errors import AbilityError, EngineError, InputError, StateError, UnknownNameError
from ig2mj.predicates import AbilityWarning
from ig2mj.states import StateOptions


@pytest.fixture
def world(tiny_home) -> ig2mj.Simulation:
    simulation = ig2mj.Simulation(tiny_home)
    simulation.step(count=2)
    return simulation


def test_every_object_state_can_be_asked(world):
    assert world.state("temperature", "apple") == 23.0
    assert world.state("max_temperature", "apple") == 23.0
    assert world.state("toggled_on", "stove") is False
    assert world.state("wetness", "sponge") == 0.0
    assert world.state("dust", "table") == 0.0
    assert world.state("open", "cabinet") is False
    assert world.state("heat_source", "stove") is False
    assert world.state("rooms", "table") == ["kitchen_0"]
    low, high = world.state("aabb", "box")
    assert np.allclose(np.subtract(high, low), 0.1, atol=5e-3)
    assert "table" in world.state("contact_bodies", "box")
    assert set(world.state("temperature")) == {"apple", "apple_half_0", "apple_half_1"}


def test_table_a4_axis_states_name_the_objects_above_below_and_beside(world):
    assert "table" in world.state("in_same_negative_vertical_axis_objs", "box")
    assert world.state("in_same_positive_vertical_axis_objs", "box") == []
    assert "cabinet" in world.state("in_same_horizontal_plane_objs", "book")


def test_predicates_by_name(world):
    assert world.predicate("on_top", "box", "table")
    assert not world.predicate("on_top", "table", "box")
    assert world.predicate("inside", "book", "cabinet")
    assert not world.predicate("inside", "box", "cabinet")
    assert world.predicate("touching", "pan", "stove")
    assert world.holds("(and (on_top pan stove) (not (toggled_on stove)))")


def test_a_stove_that_is_switched_on_cooks_and_burns_an_apple(tiny_home):
    world = ig2mj.Simulation(tiny_home)
    world.set_object_pose("apple", (0.0, 1.6, 0.9))  # on the pan, under the stove's heat link
    world.set_state("toggled_on", "stove", True)
    world.set_state("temperature", "apple", 69.0)
    assert not world.predicate("cooked", "apple")
    world.step(count=10)
    assert world.state("temperature", "apple") > 70.0
    assert world.predicate("cooked", "apple")
    world.set_state("temperature", "apple", 250.0)
    world.step()
    assert world.predicate("burnt", "apple") and not world.predicate("cooked", "apple")


def test_explain_names_what_is_missing(world):
    text = world.explain("(and (cooked apple) (on_top box table))")
    assert "(cooked apple)" in text and "23.0 C" in text and "(on_top box table)" not in text.split("Missing:")[1]


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("cooked", "apple"),
        ("burnt", "apple"),
        ("frozen", "apple"),
        ("soaked", "sponge"),
        ("toggled_on", "stove"),
        ("dusty", "table"),
        ("stained", "table"),
        ("open", "cabinet"),
    ],
)
def test_table_a5_predicates_are_set_true_and_false(world, name, target):
    world.set_state(name, target, True)
    assert world.predicate(name, target)
    world.set_state(name, target, False)
    assert not world.predicate(name, target)


def test_table_a5_an_opened_door_stays_open_in_physics(world):
    world.set_state("open", "cabinet", True)
    world.step(count=3)
    assert world.predicate("open", "cabinet")
    assert max(world.state("joint_states", "cabinet")) > 0.01


def test_slicing_swaps_the_apple_for_its_halves(world):
    world.set_state("temperature", "apple", 55.0)
    where, _ = world.object_pose("apple")
    world.set_state("sliced", "apple", True)
    assert world.predicate("sliced", "apple")
    for half in ("apple_half_0", "apple_half_1"):
        assert np.allclose(world.object_pose(half)[0], where, atol=1e-5)
        assert world.state("temperature", half) == pytest.approx(55.0)
    assert np.linalg.norm(world.object_pose("apple")[0] - where) > 10
    world.step(count=30)
    assert np.linalg.norm(world.object_pose("apple_half_0")[0] - where) < 0.5
    with pytest.raises(StateError):
        world.set_state("sliced", "apple", False)


def test_a_restored_world_goes_on_bitwise_the_same(tiny_home, tmp_path):
    world = ig2mj.Simulation(tiny_home)
    world.set_object_pose("ball", (-1.0, -1.0, 0.6))
    world.set_state("stained", "table", True)
    world.set_state("frozen", "apple", True)
    world.set_state("toggled_on", "sink", True)
    world.step(count=5)
    world.save(tmp_path / "world.npz")
    outcomes = []
    for threads in (1, 2):
        again = ig2mj.Simulation(tiny_home, NativeEngine(tiny_home, threads=threads))
        again.load(tmp_path / "world.npz")
        again.step(count=12)
        again.set_state("frozen", "apple", True)  # draws at random
        outcomes.append(again)
    world.step(count=12)
    world.set_state("frozen", "apple", True)
    for again in outcomes:
        assert again.time == world.time
        for a, b in zip(jax.tree.leaves(again.states), jax.tree.leaves(world.states), strict=True):
            assert np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True)
        assert np.array_equal(again.data.qpos, world.data.qpos)
    assert world.states.water.active.any()
    with np.load(tmp_path / "world.npz", allow_pickle=False) as archive:
        assert all(archive[name].dtype != object for name in archive.files)


def test_reset_brings_states_back(world):
    world.set_state("temperature", "apple", 90.0)
    world.reset()
    assert world.state("temperature", "apple") == 23.0


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda w: w.state("temperatur", "apple"), UnknownNameError, "temperature"),
        (lambda w: w.state("temperature", "aple"), UnknownNameError, "apple"),
        (lambda w: w.state("temperature", "table"), AbilityError, "cookable"),
        (lambda w: w.set_state("cokked", "apple", True), UnknownNameError, "cooked"),
        (lambda w: w.set_state("cooked", "table", True), AbilityError, "cookable"),
        (lambda w: w.set_state("temperature", "table", 3.0), AbilityError, "cookable"),
        (lambda w: w.set_state("temperature", "apple", float("nan")), StateError, "nan"),
        (lambda w: w.set_state("temperature", "apple", 1e40), StateError, "1e+40"),
        (lambda w: w.set_state("temperature", "apple", True), StateError, "to a number"),
        (lambda w: w.set_state("cooked", "apple", 3.0), StateError, "true or false"),
        (lambda w: w.set_state("pose", "apple", 1.0), StateError, "settable"),
        (lambda w: w.set_state("on_top", "apple", True), StateError, "place"),
        (lambda w: w.predicate("on_topp", "apple", "table"), UnknownNameError, "on_top"),
        (lambda w: w.predicate("on_top", "apple", "tabel"), UnknownNameError, "table"),
        (lambda w: w.predicate("cooked", "table", strict=True), AbilityError, "cookable"),
    ],
)
def test_wrong_names_and_values_are_typed_errors_of_one_line(world, call, error, words):
    with pytest.raises(error) as caught:
        call(world)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_predicate_without_the_ability_is_false_with_a_warning(tiny_home):
    world = ig2mj.Simulation(tiny_home)
    with pytest.warns(AbilityWarning) as caught:
        assert not world.predicate("frozen", "ball")
    assert caught[0].filename == __file__, "the warning names the line of the user's code"


def test_a_file_of_another_scene_is_refused(world, tmp_path):
    world.save(tmp_path / "world.npz")
    (tmp_path / "no.npz").write_bytes(b"nothing")
    with pytest.raises(InputError):
        world.load(tmp_path / "no.npz")
    with pytest.raises(InputError):
        world.load(tmp_path / "absent.npz")


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("physics.scene.qpos", lambda a: np.full_like(a, np.nan), "holds numbers that are not finite"),
        ("physics.scene.tree_asleep", lambda a: np.full_like(a, 10**6), "names number 1000000 of"),
        ("states.temperature", lambda a: np.full_like(a, np.inf), "holds numbers that are not finite"),
        ("states.temperature", lambda a: np.concatenate([a, a]), "has shape"),
        ("states.dust.body", lambda a: np.full_like(a, 10**6), "names number 1000000 of"),
        ("key", lambda a: a[:1], "has shape"),
        ("step", lambda a: a[:0], "has shape"),
        ("step", lambda a: a - 9, "a clock begins at 0"),
    ],
)
def test_a_file_with_numbers_that_no_world_has_is_refused(world, tmp_path, name, change, says):
    file = tmp_path / "world.npz"
    world.save(file)
    with np.load(file) as archive:
        arrays = dict(archive)
    np.savez(file, **(arrays | {name: change(arrays[name])}))
    with pytest.raises(InputError, match=f"{re.escape(name)}: .*{says}"):
        world.load(file)


def test_physics_alone_has_no_states(tiny_home):
    world = ig2mj.Simulation(tiny_home, states=None)
    world.step()
    with pytest.raises(StateError, match="physics only"):
        world.state("temperature")


def test_igibsons_rules_on_request(tiny_home):
    world = ig2mj.Simulation(tiny_home, states=StateOptions(compat="igibson"))
    world.set_state("burnt", "apple", True)
    assert world.predicate("cooked", "apple")  # burnt implies cooked, there


def test_what_is_no_number_is_refused_as_a_state(world, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    for value in ("hot", None, [3.0], 1j):
        with pytest.raises(StateError, match="is set to a number, not to"):
            world.set_state("temperature", "apple", value)
    assert world.state("temperature", "apple") == 23.0


def test_a_predicate_that_is_asked_as_a_state_names_what_to_ask(world):
    with pytest.raises(StateError, match=r"is a predicate, not a state: ask predicate\('cooked'"):
        world.state("cooked", "apple")


def test_seeds_of_samplings_are_whole_numbers(world, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    with pytest.raises(EngineError, match="a seed is a whole number"):
        world.set_predicate("on_top", "apple", "table", seed="x")


def test_sizes_of_images_are_whole_numbers(world, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)
    for size in ({"width": 0}, {"height": -1}, {"width": 1.5}, {"width": "x"}):
        with pytest.raises(EngineError, match="a whole number of at least 1"):
            world.render(**size)
    assert world.render(width=33, height=7).shape == (7, 33, 3)
