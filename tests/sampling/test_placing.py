"""Placing: what the paper's table A.5 promises is measured on the placed state."""

from __future__ import annotations

import collections

import numpy as np
import pytest

from ig2mj.errors import StateError, UnknownNameError
from ig2mj.predicates.literals import ArityError
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import bind, order, read_conditions
from ig2mj.sampling.many import make_sampler, sample
from ig2mj.sampling.placement import RESTING_PENETRATION
from ig2mj.scene.scene import load_scene


@pytest.fixture(scope="module")
def sampler():
    return make_sampler(load_scene("small_home"))


def sampled(sampler, *texts, seed=0, work=250):
    conditions = bind(read_conditions(texts), sampler.model.tables, np.random.default_rng(seed))
    reasons = collections.Counter()
    return sampler.sample(conditions, np.random.default_rng(seed), Budget(work), reasons), reasons


CASES = [
    "(on_top plate_0 breakfast_table_0)",
    "(inside apple_0 fridge_0)",
    "(under apple_0 breakfast_table_0)",
    "(on_floor apple_0 kitchen_0)",
    "(next_to apple_0 bowl_0)",
    "(in_contact_with mug_0 bowl_0)",
]


@pytest.mark.parametrize("text", CASES)
def test_a_placed_object_rests_supported_and_apart(sampler, text):
    """Table A.5: supported by a surface, free of collisions; and, beyond iGibson, at rest with the predicate true."""
    row, reasons = sampled(sampler, text)
    assert row is not None, reasons
    view = sampler.query.view
    name = read_conditions([text])[0].arguments[0]
    index = sampler.query.scene.object_index(name)
    assert not np.asarray(view.awake).any()
    assert np.asarray(view.touching)[0, index].any()
    assert sampler.query.penetrations()[index] <= RESTING_PENETRATION


def test_a_negation_moves_the_object_away(sampler):
    there, _ = sampled(sampler, "(on_top plate_0 breakfast_table_0)")
    assert there is not None
    away, reasons = sampled(sampler, "(not (on_top plate_0 breakfast_table_0))")
    assert away is not None, reasons
    scene = sampler.query.scene
    plate, table = scene.object_index("plate_0"), scene.object_index("breakfast_table_0")
    assert not np.asarray(sampler.query.view.touching)[0, plate, table]


def test_conditions_are_sampled_together_from_the_support_upwards(sampler):
    texts = ["(on_top apple_0 plate_0)", "(on_top plate_0 breakfast_table_0)", "(open fridge_0)", "(frozen fish_0)"]
    plan = order(read_conditions(texts))
    assert [name for name, _ in plan.placements] == ["plate_0", "apple_0"]
    assert [c.predicate for c in plan.joints] == ["open"]
    row, reasons = sampled(sampler, *texts)
    assert row is not None, reasons
    fish = sampler.query.scene.object_index("fish_0")
    assert row.states.temperature[0, fish] <= 0.0


def test_joints_of_what_is_placed_are_drawn_until_they_rest():
    """A lid that is half open falls shut; an open jar is one whose lid leans back."""
    jars = make_sampler(load_scene("small_home", objects=["jar"]))
    for seed in range(4):
        row, reasons = sampled(jars, "(open jar)", "(on_top jar breakfast_table_0)", seed=seed)
        assert row is not None, reasons
        assert not np.asarray(jars.query.view.awake).any()
        assert jars.holds(read_conditions(["(open jar_0)"]), row.states)


def test_a_floor_narrows_another_rule(sampler):
    """Under a table and on the floor of a room: the first rule proposes, the second says where."""
    room = sampler.query.scene.object("breakfast_table_0").rooms[0]
    texts = [f"(on_floor apple_0 {room})", "(under apple_0 breakfast_table_0)"]
    assert [c.predicate for c in order(read_conditions(texts)).placements[0][1]] == ["under", "on_floor"]
    row, reasons = sampled(sampler, *texts)
    assert row is not None, reasons


def test_an_impossible_request_ends_within_its_budget_and_says_why(sampler):
    row, reasons = sampled(sampler, "(inside plate_0 mug_0)")
    assert row is None
    assert sum(reasons.values()) > 0


def test_fixed_objects_are_not_placed(sampler):
    with pytest.raises(StateError, match="fixed"):
        sampled(sampler, "(on_top fridge_0 breakfast_table_0)")


@pytest.mark.parametrize("predicate", ["on_top", "inside", "under", "next_to", "in_contact_with"])
def test_nothing_is_placed_at_what_has_no_collision_geometry(sampler, predicate):
    with pytest.raises(StateError, match="'ceilings' has no collision geometry"):
        sampled(sampler, f"({predicate} apple_0 ceilings)")


def test_a_condition_has_all_its_arguments(sampler):
    for text in ("(on_top)", "(on_top apple_0)", "(on_floor)"):
        with pytest.raises(ArityError, match="takes 2 arguments"):
            sampled(sampler, text)


def test_objects_that_bear_each_other_in_a_circle_are_refused():
    with pytest.raises(StateError, match="circle"):
        order(read_conditions(["(on_top a b)", "(on_top b a)"]))


def test_only_literals_and_conjunctions_can_be_sampled():
    assert len(read_conditions(["(and (cooked a) (not (on_top b c)))"])) == 2
    with pytest.raises(StateError, match="conjunctions"):
        read_conditions(["(or (cooked a) (cooked b))"])


def test_a_category_stands_for_one_object_of_it_and_numbered_ones_differ(sampler):
    tables = sampler.model.tables
    rng = np.random.default_rng(0)
    one = bind(read_conditions(["(on_top plate breakfast_table)", "(dusty plate)"]), tables, rng)
    assert one[0].arguments[0] == one[1].arguments[0]
    assert tables.object_categories[tables.object_names.index(one[0].arguments[0])] == "plate"
    with pytest.raises(StateError, match="too few"):
        bind(read_conditions([f"(cooked fish#{n})" for n in range(9)]), tables, rng)
    with pytest.raises(UnknownNameError, match="near matches"):
        bind(read_conditions(["(cooked fsh_0)"]), tables, rng)


def test_rows_belong_to_their_seed_and_number():
    scene = load_scene("small_home")
    texts = ["(on_top plate_0 breakfast_table_0)"]
    three = sample(scene, texts, 3, seed=5)
    again = sample(scene, texts, 2, seed=5)
    assert three.complete and again.complete
    assert np.array_equal(three.pool.physics.qpos[:2], again.pool.physics.qpos)
    assert not np.array_equal(three.pool.physics.qpos[0], three.pool.physics.qpos[1])


@pytest.mark.slow
def test_the_number_of_processes_changes_nothing():
    scene = load_scene("small_home")
    texts = ["(on_top plate_0 breakfast_table_0)", "(inside apple_0 fridge_0)"]
    alone, two = (sample(scene, texts, 4, seed=1, jobs=jobs) for jobs in (1, 2))
    assert np.array_equal(alone.pool.physics.qpos, two.pool.physics.qpos)
    assert alone.rejected == two.rejected


def test_a_box_stands_next_to_what_is_little_higher_than_its_middle():
    """The box's rays leave its middle, 28 mm up, and meet a fish that is 29 mm high."""
    scene = load_scene("small_home", objects=["container_date"])
    small = make_sampler(scene)
    fish = sampled(small, "(on_floor fish_0 kitchen_0)")[0]
    assert fish is not None
    small.start_from(fish.physics, fish.states)
    high = small.query.box(scene.object_index("fish_0"))[1][2]
    row, reasons = sampled(small, "(next_to container_date_0 fish_0)")
    assert row is not None, reasons
    middle = float(np.asarray(small.query.view.object_com)[0, scene.object_index("container_date_0"), 2])
    assert middle < high < middle + 0.002
