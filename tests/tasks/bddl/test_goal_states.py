"""Goal states: a reading of the goal, made true in a start state."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.predicates.logic import And, Atom, Not, Or
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import scene_folder
from ig2mj.tasks.bddl.binding import bind
from ig2mj.tasks.bddl.definitions import load_activity
from ig2mj.tasks.bddl.goal_states import GoalSampler, choose_reading, sample_goals
from ig2mj.tasks.bddl.start import load_bound, row_status

IN_A, IN_B = Atom("inside", ("apple", "a")), Atom("inside", ("apple", "b"))
GOAL = """(define (problem packing) (:domain igibson)
 (:objects apple.n.01_1 - apple.n.01 plate.n.04_1 - plate.n.04 electric_refrigerator.n.01_1 - electric_refrigerator.n.01
   table.n.02_1 - table.n.02 bowl.n.01_1 - bowl.n.01)
 (:init (ontop plate.n.04_1 table.n.02_1) (ontop bowl.n.01_1 table.n.02_1) (ontop apple.n.01_1 table.n.02_1)
   (dusty plate.n.04_1) (inroom electric_refrigerator.n.01_1 kitchen))
 (:goal (and (not (dusty ?plate.n.04_1)) (ontop ?plate.n.04_1 ?table.n.02_1)
   (or (and (inside ?apple.n.01_1 ?electric_refrigerator.n.01_1) (nextto ?apple.n.01_1 ?bowl.n.01_1)
            (nextto ?bowl.n.01_1 ?apple.n.01_1) (inside ?bowl.n.01_1 ?electric_refrigerator.n.01_1))
       (inside ?apple.n.01_1 ?plate.n.04_1)) (not (inside ?apple.n.01_1 ?plate.n.04_1)))))
"""


def chosen(goal, truth=(), **options):
    table = {IN_A: False, IN_B: False, **dict(truth)}
    return choose_reading(goal, table, np.random.default_rng(0), **{"few_changes": True, **options})


def test_an_object_is_put_into_one_container_even_if_two_are_named():
    reading = chosen(And((IN_A, Or((IN_B, Not(IN_B))))))
    assert reading == {IN_A: True, IN_B: False}


def test_what_holds_already_is_preferred():
    for seed in range(8):
        found = choose_reading(Or((IN_A, IN_B)), {IN_A: False, IN_B: True}, np.random.default_rng(seed), True)
        assert found == {IN_B: True}


def test_a_fixed_object_is_not_to_be_moved():
    assert chosen(IN_A, fixed=frozenset({"apple"})) is None
    near = Atom("next_to", ("sink", "bucket"))
    assert choose_reading(near, {near: False}, np.random.default_rng(0), True, frozenset({"sink"})) == {near: True}
    assert choose_reading(near, {near: False}, np.random.default_rng(0), True, frozenset({"sink", "bucket"})) is None


def test_nothing_is_next_to_itself():
    own, other = (Atom("next_to", ("a", name)) for name in "ab")
    truth = {own: False, other: False}
    assert choose_reading(Or((own, other)), truth, np.random.default_rng(1), False) == {other: True}


@pytest.fixture(scope="module")
def packing(tmp_path_factory):
    file = tmp_path_factory.mktemp("bddl") / "packing.bddl"
    file.write_text(GOAL, encoding="utf-8")
    binding = bind(load_activity(str(file)), load_manifest(scene_folder("small_home")))
    return binding, load_bound(binding), str(file)


@pytest.mark.slow
def test_a_goal_state_is_its_start_with_the_goal_made_true(packing):
    binding, scene, _ = packing
    sampler = GoalSampler(binding, scene)
    start, _ = sampler.start(seed=3, number=0)
    assert start is not None
    found = sampler.goal(start, seed=3, number=0)
    assert found.row is not None, found.rejected
    placed = {c.arguments[0] for c in found.reading if c.is_placement}
    others = [o for o in scene.object_names if o not in placed and not scene.object(o).fixed]
    index = [scene.object_index(o) for o in others]
    sampler.sampler.query.load(start.physics)
    before = np.array(sampler.sampler.query.view.object_com[0, index])
    sampler.sampler.query.load(found.row.physics)
    assert np.abs(np.array(sampler.sampler.query.view.object_com[0, index]) - before).max() < 0.01


@pytest.mark.slow
def test_goal_states_of_a_pool_fulfil_the_goal_and_are_the_same_again(packing):
    binding, scene, file = packing
    done = sample_goals(binding, scene, 1, seed=5, name=file)
    assert done.complete and done.pool is not None
    assert row_status(binding, scene, done.pool, 0).holds
    again = sample_goals(binding, scene, 1, seed=5, name=file)
    assert again.pool is not None
    np.testing.assert_array_equal(done.pool.physics.scene.qpos, again.pool.physics.scene.qpos)
