"""Rewards are differences of the potential, without iGibson's two traps."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.engine.registry import make_engine
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.reward import ActivityMeasures, Lift, Reward
from ig2mj.tasks.task import place_robot
from ig2mj.worlds.rules import Rules


def measures(literals=0.0, distances=(1.0, 2.0), held=False, stains=0.0):
    return ActivityMeasures(
        jnp.array([literals], jnp.float32),
        jnp.array([distances], jnp.float32),
        jnp.array([held]),
        jnp.array([stains], jnp.float32),
    )


@pytest.fixture(scope="module")
def cleaning():
    """Scene, rules and rewards of both robots for the stained shelf, and one world of it."""
    task, made = ACTIVITIES["CleaningStainedShelf"], {}
    for robot in task.robots:
        scene = load_scene(task.home, agents=[place_robot(task, robot)[1]], objects=task.objects)
        rules = Rules.of_scene(scene).with_goal(task.goal)
        made[robot] = Reward(task, robot, scene, rules.model), rules, make_engine("native", scene, 1)
    return made


def terms(cleaning, robot, before, after):
    return {n: float(t[0]) for n, t in cleaning[robot][0].terms(before, after).items()}


def test_the_humanoid_is_paid_one_for_the_goal_one_a_metre_and_a_half_a_stain(cleaning):
    found = terms(cleaning, "humanoid", measures(stains=20.0), measures(1.0, (0.7, 1.8), True, 17.0))
    assert found == pytest.approx({"goal": 1.0, "distance": 0.5, "pickup": 0.0, "stains": 1.5}, abs=1e-5)


def test_fetch_is_paid_for_one_distance_at_a_time(cleaning):
    """To the first object until it is held, then from it to the second; in the step between, for neither."""
    apart = terms(cleaning, "fetch", measures(), measures(0.0, (0.9, 1.5)))
    assert apart["distance"] == pytest.approx(20 * 0.1, abs=1e-4)
    taken = terms(cleaning, "fetch", measures(), measures(0.0, (0.0, 1.5), True))
    assert (taken["distance"], taken["pickup"]) == (0.0, 5.0)
    carried = terms(cleaning, "fetch", measures(held=True), measures(0.0, (0.9, 1.5), True))
    assert carried["distance"] == pytest.approx(20 * 0.5, abs=1e-4)
    assert terms(cleaning, "fetch", measures(held=True), measures())["pickup"] == -5.0


def test_a_distance_that_is_not_defined_any_more_keeps_its_last_value(cleaning):
    """In iGibson it becomes 0: whoever wipes off the last stain is paid for the way to it."""
    reward, rules, engine = cleaning["humanoid"]
    view, states = engine.view(engine.reset()), rules.initial  # no stains
    now = reward.measure(view, states, rules.goal.status(states, view), measures(distances=(5.0, 0.25)))
    assert float(now.distances[0, 1]) == 0.25
    assert 0.0 < float(now.distances[0, 0]) != 5.0
    assert np.asarray(now.stains).tolist() == [0.0]


def test_a_lift_is_by_all_hands_that_hold_the_object_when_it_last_leaves_the_floor():
    lift = Lift(np.array([False, False, True]), np.zeros(3, bool))
    steps = (
        ([True, True, True], [True, False, True], [True, False, False], "the third was off the floor before"),
        ([True, True, True], [False, True, True], [True, False, False], "hands that come later do not count"),
        ([False, False, False], [True, True, True], [True, False, False], "on the floor again"),
        ([True, True, True], [False, True, True], [False, True, True], "the last time counts"),
    )
    for off_floor, held_by_all, expected, why in steps:
        lift = lift.after(np.array(off_floor), np.array(held_by_all))
        assert lift.by_all.tolist() == expected, why
