"""Primitives that Fetch carries out by its own actions, with its arm, in a home that ships."""

import pytest

import ig2mj
from ig2mj.agents.registry import make_robot

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def simulation():
    scene = ig2mj.load_scene("small_home", agents=[make_robot("fetch").at(-1.0, 0.0, 0.0)])
    return ig2mj.Simulation(scene, grasping="assisted")


@pytest.mark.parametrize(
    ("before", "requests"),
    [
        ((), "grasp carving_knife_0, slice apple_0 carving_knife_0"),
        (
            (("on_top", "fish_0", "coffee_table_0"),),  # on the stove it would be cooked before it is taken
            "toggle_on stove_0, grasp fish_0, cook fish_0 stove_0, release fish_0, toggle_off stove_0",
        ),
        ((), "grasp apple_0, place_on_top apple_0 coffee_table_0"),
        ((), "grasp hardback_0, place_under hardback_0 breakfast_table_0"),
        ((), "open bottom_cabinet_0, close bottom_cabinet_0, open stove_0"),
        ((("open", "fridge_0"),), "close fridge_0"),
        ((("open", "window_0"),), "close window_0, open window_0"),
        ((("dusty", "plate_0"),), "grasp scrub_brush_0, wipe plate_0 scrub_brush_0"),
    ],
    ids=["slice", "cook", "on_top", "under", "drawer", "close", "window", "wipe"],
)
def test_fetch_does(simulation, before, requests):
    simulation.reset()
    for predicate, *arguments in before:
        assert simulation.set_predicate(predicate, *arguments)
    assert not simulation.predicate("cooked", "fish_0")
    for request in requests.split(", "):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
