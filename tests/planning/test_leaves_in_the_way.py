"""Doors between rooms that stand open with their leaves across a robot's way."""

import pytest
from still_world import still_world

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.planning import doors
from ig2mj.planning.starts import open_doors
from ig2mj.planning.steps import Step
from ig2mj.sampling.query import SceneQuery


@pytest.fixture(scope="module")
def world():
    """The hall of a home whose doors all stand open."""
    scene = ig2mj.load_scene("willow", agents=[Humanoid().at(-0.5, 0.7, 0.0)])
    query, opens = SceneQuery(scene), open_doors(scene)
    assert opens is not None
    query.write(opens)
    return still_world(scene, query)


def test_the_leaf_that_stands_across_the_only_way_is_found_with_the_floor_behind_it(world):
    leaf = doors.leaf_in_the_way(world, Step("wipe", ("bottom_cabinet_4", "rag")))
    assert leaf is not None and leaf.door == "door_4"
    stance = leaf.off(world)
    assert leaf.before(stance) and world.floor().way(world.base[0], stance.xy) is not None
    assert stance.xy[1] > 1.5  # in the bedroom, whose door is at y = 1.33


def test_no_leaf_is_in_the_way_to_what_is_in_reach(world):
    assert doors.leaf_in_the_way(world, Step("open", ("door_4",))) is None
