"""One task in several homes at once, and the splits that choose homes, models and start states."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.envs.several_homes import HomesEnvironment
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.scene.library import library
from ig2mj.tasks.splits import FEWEST, HELD_OUT_HOMES, SPLITS, TRAIN_HOMES, Split, models_of, undivided


def test_models_of_a_category_are_divided_three_to_one_by_their_names():
    names = [f"mug_{k:02d}" for k in range(40)]
    train, held_out = models_of(names, "train"), models_of(names, "held_out")
    assert sorted(train + held_out) == names and len(held_out) == 10
    assert models_of(names[::-1], "held_out") == held_out[::-1]  # whatever their order
    assert models_of(names[:3], "train") == models_of(names[:3], "held_out") == names[:3]


def test_categories_of_few_models_are_listed():
    assert set(undivided()) == {c for c, models in library().items() if len(models) < FEWEST}


def test_models_of_the_user_join_a_part():
    names = ["a", "b", "c", "d"]
    assert "mine" in models_of([*names, "mine"], "held_out", {"mine": "held_out"})
    assert "mine" not in models_of([*names, "mine"], "train", {"mine": "held_out"})
    with pytest.raises(EngineError, match="no model is held out of mine"):
        models_of(["mine"], "held_out", {"mine": "train"})


def test_no_home_is_in_both_parts():
    assert not set(TRAIN_HOMES) & set(HELD_OUT_HOMES) and (len(TRAIN_HOMES), len(HELD_OUT_HOMES)) == (8, 4)
    assert SPLITS["held_out:all"] == Split("held_out:all", *["held_out"] * 4)


def test_a_place_belongs_to_the_split_of_its_home():
    Split.of("held_out:homes").check_home("elm:1")
    with pytest.raises(EngineError, match="home='birch:1' is none"):
        Split.of("held_out:homes").check_home("birch:1")


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"split": "held_out:home"}, UnknownNameError, "near matches: held_out:homes"),
        ({"split": "held_out:homes", "home": "birch"}, EngineError, "takes held-out homes .*'birch' is none"),
        ({"homes": "trian"}, UnknownNameError, "near matches: train"),
        ({"homes": "train", "home": "birch"}, EngineError, "give one of them"),
        ({"homes": "train", "split": "held_out:all"}, EngineError, "this split takes held-out homes"),
        ({"home": ["birch", "elm"], "worlds": 1}, EngineError, "1 worlds in 2 homes"),
        ({"home": []}, EngineError, "name at least one"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_made(options, error, said):
    with pytest.raises(error, match=said):
        ig2mj.make("CookingMeat", engine="native", **options)


@pytest.fixture(scope="module")
def env() -> HomesEnvironment:
    settings = {"engine": "native", "pool_size": 2, "horizon": 3, "observations": "proprioception"}
    return ig2mj.make("PointNavigation", "turtlebot", 3, home=["small_home", "small_home"], **settings)


@pytest.mark.slow
def test_worlds_are_shared_out_over_homes_and_step_as_alone(env):
    assert [e.num_worlds for e in env.envs] == [2, 1] and env.home_of(2) == "small_home"
    action = np.random.default_rng(0).uniform(-1, 1, (3, *env.action_space.shape)).astype(np.float32)
    state = env.step(env.reset(4), action)
    alone = env.envs[1].step(env.envs[1].reset(env.seed_of(1, 4)), action[2:])
    np.testing.assert_array_equal(np.asarray(state.obs["proprioception"])[2:], np.asarray(alone.obs["proprioception"]))
    assert state.reward.shape == (3,) and state.info["success"].shape == (3,)
    for _ in range(2):
        state = env.step_autoreset(state, action)
    assert np.asarray(state.truncated).all() and np.asarray(state.parts[0].info["steps"]).tolist() == [3, 3]
    with pytest.raises(ig2mj.errors.ActionError, match=r"shape \(3, "):
        env.step(state, action[:2])


@pytest.mark.slow
def test_two_places_of_a_home_are_two_parts():
    """They are made again from what they say they were made with."""
    settings = {"engine": "native", "pool_size": 2, "observations": "privileged_state"}
    env = ig2mj.make("CookingMeat", worlds=2, home=["birch", "birch:1"], **settings)
    assert env.homes == ("birch", "birch:1") and [e.config.home for e in env.envs] == ["birch", "birch:1"]
    again = ig2mj.make("CookingMeat", env.envs[1].config)
    assert again.task == env.envs[1].task and again.task.roles["bottom_cabinet_1"] == "bottom_cabinet_0"


@pytest.mark.slow
def test_ground_truth_is_named_by_the_part_that_objects_play():
    settings = {"engine": "native", "pool_size": 2, "observations": "privileged_state"}
    env = ig2mj.make("CookingMeat", worlds=1, home=["small_home"], **settings)
    own = ig2mj.make("CookingMeat", worlds=1, **settings)
    assert env.privileged_names == own.privileged_names
