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
        (
            (("on_top", "scrub_brush_0", "breakfast_table_0"),),
            "toggle_on sink_0, grasp scrub_brush_0, soak scrub_brush_0 sink_0",
        ),
        (
            (("on_top", "scrub_brush_0", "breakfast_table_0"), ("soaked", "scrub_brush_0"), ("stained", "plate_0")),
            "grasp scrub_brush_0, scrub plate_0 scrub_brush_0",
        ),
        ((), "grasp hardback_0, place_next_to hardback_0 mug_0"),
        ((), "grasp mug_0, place_on_floor mug_0 kitchen_0"),
        (
            (("open", "fridge_0"), ("inside", "apple_0", "fridge_0")),
            "close fridge_0, freeze apple_0 fridge_0",
        ),
        ((), "push hardback_0 sofa_0"),
    ],
    ids=[
        *("slice", "cook", "on_top", "under", "drawer", "close", "window", "wipe"),
        *("soak", "scrub", "next_to", "on_floor", "freeze", "push"),
    ],
)
def test_fetch_does(simulation, before, requests):
    simulation.reset()
    for predicate, *arguments in before:
        assert simulation.set_predicate(predicate, *arguments)
    assert not simulation.predicate("cooked", "fish_0")
    for request in requests.split(", "):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"


def test_fetch_pushes_a_chair_over_the_floor(simulation):
    simulation.reset()
    chair = simulation.scene.object_index("straight_chair_0")
    height = float(simulation.view.object_pos[0, chair, 2])
    simulation.set_object_pose("straight_chair_0", (0.6, 0.5, height), (1.0, 0.0, 0.0, 0.0))
    outcome = simulation.agent.do("push", "straight_chair_0", "coffee_table_0")
    assert outcome.done, outcome


def test_fetch_turns_over_a_towel_that_lies_with_the_side_up_that_cleans(simulation):
    simulation.reset()
    simulation.set_object_pose("dishtowel_0", (0.2, 0.3, 0.01), (0.0, 1.0, 0.0, 0.0))
    assert simulation.set_predicate("dusty", "coffee_table_0")
    for request in ("grasp dishtowel_0", "wipe coffee_table_0 dishtowel_0"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"


def test_fetch_puts_down_what_it_holds_to_open_where_that_goes(simulation):
    simulation.reset()
    assert not simulation.predicate("open", "fridge_0")
    for request in ("grasp plate_0", "place_inside plate_0 fridge_0"):
        outcome = simulation.agent.do(*request.split())
        assert outcome.done, f"{request}: {outcome}"
