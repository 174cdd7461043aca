"""Primitives that the humanoid carries out by its own actions in a home that ships."""

import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def simulation():
    scene = ig2mj.load_scene("small_home", agents=[Humanoid().at(-1.0, 0.0, 0.0)])
    return ig2mj.Simulation(scene, grasping="assisted")


@pytest.mark.parametrize(
    ("before", "requests"),
    [
        ((), "open fridge_0, grasp apple_0, place_inside apple_0 fridge_0, close fridge_0, freeze apple_0 fridge_0"),
        ((), "grasp carving_knife_0, slice apple_0 carving_knife_0"),
        ((), "grasp fish_0, toggle_on stove_0, cook fish_0 stove_0"),
        (
            (("on_top", "dishtowel_0", "breakfast_table_0"),),
            "grasp dishtowel_0, toggle_on sink_0, soak dishtowel_0 sink_0",
        ),
        ((), "grasp hardback_0, place_under hardback_0 breakfast_table_0"),
        ((), "open fridge_0, grasp milk_0, place_on_floor milk_0 kitchen_0"),
        ((("open", "fridge_0"),), "close fridge_0"),
        ((("open", "window_0"),), "close window_0, open window_0"),
        ((), "navigate_to sofa_0, navigate_to breakfast_table_0"),
    ],
    ids=["freeze", "slice", "cook", "soak", "under", "on_floor", "close", "window", "wide"],
)
def test_the_humanoid_does(simulation, before, requests):
    simulation.reset()
    for predicate, *arguments in before:
        assert simulation.set_predicate(predicate, *arguments)
    for request in requests.split(", "):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
