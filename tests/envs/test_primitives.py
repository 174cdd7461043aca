"""Environments whose actions are primitives."""

import gymnasium
import numpy as np
import pytest

import ig2mj
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.planning.steps import PlanningError

GOAL = "goal/small_home (and (inside apple_0 fridge_0) (not (open fridge_0)))"
STEPS = (("open", "fridge_0"), ("grasp", "apple_0"), ("place_inside", "apple_0", "fridge_0"), ("close", "fridge_0"))


@pytest.fixture(scope="module")
def env():
    return ig2mj.make(GOAL, action_space="primitives", rung="symbolic", horizon=4)


def test_the_return_of_an_episode_is_its_q(env):
    observation, info = env.reset(seed=0)
    assert isinstance(env, gymnasium.Env) and env.observation_space.contains(observation)
    assert info["q"] == 0.0
    total = 0.0
    for words in STEPS:
        observation, reward, terminated, truncated, info = env.step(env.action_of(*words))
        total += reward
        assert env.observation_space.contains(observation) and not truncated
    assert terminated and info["success"] and total == pytest.approx(1.0)
    assert "(inside apple_0 fridge_0)" in env.describe()


def test_a_primitive_that_fails_says_why_and_earns_nothing(env):
    env.reset(seed=0)
    _, reward, terminated, _, info = env.step(env.action_of("place_inside", "apple_0", "fridge_0"))
    assert info["reason"] == "no_grasp" and reward == 0.0 and not terminated


def test_function_calls_and_steps_are_actions_too(env):
    env.reset(seed=0)
    call = {"name": "grasp", "arguments": {"object": "apple_0"}}
    assert env.step(call)[4]["held"] == ("apple_0",)
    assert np.array_equal(env.facts.held, ["apple_0"])


def test_the_horizon_is_a_number_of_primitives(env):
    env.reset(seed=0)
    assert [env.step(env.action_of("grasp", "apple_0"))[3] for _ in range(4)] == [False, False, False, True]


@pytest.mark.parametrize(
    ("action", "error", "said"),
    [
        (10**6, EngineError, "there are"),
        ({"name": "grap"}, UnknownNameError, "grasp"),
        ({"name": "grasp", "arguments": {"object": "aple_0"}}, UnknownNameError, "apple_0"),
        ({"name": "grasp", "arguments": {}}, PlanningError, "takes object"),
        ({"verb": "grasp"}, PlanningError, "name"),
    ],
)
def test_a_faulty_action_is_refused(env, action, error, said):
    env.reset(seed=0)
    with pytest.raises(error, match=said):
        env.step(action)


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"action_space": "primitive"}, UnknownNameError, "primitives"),
        ({"action_space": "primitives", "rung": "physical"}, UnknownNameError, "physics"),
        ({"action_space": "primitives", "worlds": 4}, UnknownNameError, "worlds"),
        ({"action_space": "primitives", "horizon": 0}, EngineError, "at least 1"),
        ({"action_space": "primitives", "robot": "turtlebot"}, PlanningError, "hands"),
    ],
)
def test_faulty_options_are_refused(options, error, said):
    with pytest.raises(error, match=said):
        ig2mj.make(GOAL, **options)


@pytest.mark.slow
def test_a_robot_carries_out_primitives_in_physics():
    env = ig2mj.make(GOAL, action_space="primitives")
    env.reset(seed=0)
    _, _, _, _, info = env.step(env.action_of("grasp", "apple_0"))
    assert info["held"] == ("apple_0",) and info["time"] > 0


def test_a_home_has_the_objects_and_substances_that_are_asked_for():
    objects = ["carafe@on_top:breakfast_table_0", "substances:water@carafe_0"]
    made = ig2mj.make(
        "goal/small_home (filled mug_0 water)", action_space="primitives", rung="symbolic", objects=objects
    )
    made.reset(seed=0)
    assert "(contains carafe_0 water)" in made.describe() and "(contains mug_0 water)" not in made.describe()
    for words in (("grasp", "carafe_0"), ("pour", "carafe_0", "mug_0", "water")):
        *_, terminated, _, info = made.step(made.action_of(*words))
        assert not info["reason"], info
    assert terminated and info["success"] and "(contains mug_0 water)" in made.describe()
    arguments = {"object": "carafe_0", "target": "mug_0", "substance": "beer"}
    with pytest.raises(UnknownNameError, match="no substance in use is named 'beer'"):
        made.step({"name": "pour", "arguments": arguments})


def test_an_activity_with_objects_of_its_own_takes_no_others():
    with pytest.raises(PlanningError, match="has its own objects"):
        ig2mj.make("activity/cleaning_windows", action_space="primitives", rung="symbolic", objects=["mug"])
