"""Variants of activities: other models of the same categories, in a household that lacks nothing."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.agents.fetch.figures import FINGERS, UPPER
from ig2mj.errors import EngineError
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.library import find_model
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.points import At
from ig2mj.tasks.pools import bare_scene, start_states
from ig2mj.tasks.variants import variant, variants


@pytest.mark.parametrize("name", ACTIVITIES)
def test_every_activity_has_three_models_of_what_it_is_about(name):
    task = ACTIVITIES[name]
    assert variants(task) == 3 and variant(task, 0) is task
    with pytest.raises(EngineError, match="0 to 2"):
        variant(task, 3)


def test_the_added_objects_are_of_another_model_under_the_same_names():
    scenes = [bare_scene(variant(ACTIVITIES["SlicingFruit"], n)) for n in (0, 1)]
    assert scenes[0].object_names == scenes[1].object_names
    assert [a.model for a in scenes[1].additions] == ["apple_01", "carving_knife_01"]


def test_a_book_is_added_where_the_homes_own_is_meant():
    task = variant(ACTIVITIES["GraspingBook"], 2)
    assert task.objects == ("notebook/notebook_02",) and task.objects_of_interest == ("notebook_1",)
    assert task.start == ("(on_top notebook_1 coffee_table_0)",) and task.near[0].object == "notebook_1"
    assert task.distances[0][1] == At("notebook_1") and "notebook_0" not in task.goal
    assert task.robots == ACTIVITIES["GraspingBook"].robots and task.expert is not None
    assert {"notebook_0", "notebook_1"} <= set(bare_scene(task).object_names)


def test_the_board_stays_on_its_wall_and_the_towel_is_another():
    own, other = ACTIVITIES["CleaningStainedShelf"], variant(ACTIVITIES["CleaningStainedShelf"], 1)
    assert own.objects[1] == other.objects[1] and other.objects[0] == "hand_towel/hand_towel_01"


@pytest.mark.parametrize("number", range(3))
def test_what_nothing_sticks_to_fits_between_fetchs_fingers(number):
    task = variant(ACTIVITIES["SoakingTowel"], number, "physical")
    (towel,) = (find_model(name).entry for name in task.objects)
    opening = UPPER[FINGERS].sum()
    assert max(towel.bounding_box[:2]) < opening - 0.015 and towel.assisted_grasp
    assert 0.2 < towel.mass < 0.5
    assert task.name == "SoakingTowel" and task.goal == ACTIVITIES["SoakingTowel"].goal
    fruit, knife = (find_model(name) for name in variant(ACTIVITIES["SlicingFruit"], number, "physical").objects)
    assert fruit.category == "apple" and knife.entry.assisted_grasp
    assert knife.entry.bounding_box[1] < opening - 0.015, "narrower than the gripper opens"
    assert len(knife.entry.orientations) == 1, "it stands on its handle, edge down"


@pytest.mark.parametrize("mode", ["mitten", "assisted", "sticky"])
def test_other_modes_and_other_activities_keep_their_objects(mode):
    assert variant(ACTIVITIES["SoakingTowel"], 0, mode) is ACTIVITIES["SoakingTowel"]
    assert variant(ACTIVITIES["CookingMeat"], 0, "physical") is ACTIVITIES["CookingMeat"]
    with pytest.raises(EngineError, match="0 to 2"):
        variant(ACTIVITIES["SoakingTowel"], 3, "physical")


def test_each_variant_has_its_own_pool():
    task = ACTIVITIES["CookingMeat"]
    files = {start_states(t).cached.name for t in (task, variant(task, 1), variant(task, 2))}
    assert len(files) == 3


@pytest.mark.slow
def test_without_mittens_fetch_looks_at_the_towel_that_it_is_to_take():
    """The towel's middle is within the half of its picture, which spans 45 degrees to each side."""
    env = ig2mj.make("SoakingTowel", robot="fetch", grasping="physical", worlds=4, pool_size=4)
    view = env.reset(0).batch.world.view
    eye, axes = (np.asarray(x)[:, 0] for x in (view.agent.eye_pos, view.agent.eye_quat))
    towel = np.asarray(view.object_com)[:, env.scene.object_index("bath_towel_0")]
    right, up, backwards = np.einsum("wji,wj->iw", matrices_on_host(axes), towel - eye)
    assert (
        (backwards < -0.3).all() and (np.abs(right) < 0.5 * -backwards).all() and (np.abs(up) < 0.5 * -backwards).all()
    )
    env.close()
