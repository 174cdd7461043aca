"""Doors between rooms that stand open with their leaves across a robot's way."""

import types

import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.planning import doors
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.domain import Domain
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.starts import open_doors
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld
from ig2mj.sampling.query import SceneQuery
from ig2mj.worlds.rules import Rules


@pytest.fixture(scope="module")
def world():
    """The hall of a home whose doors all stand open."""
    scene = ig2mj.load_scene("willow", agents=[Humanoid().at(-0.5, 0.7, 0.0)])
    body = body_of(scene, scene.agents[0].controller(scene.tables, 0, 0.1))
    query, opens = SceneQuery(scene), open_doors(scene)
    assert opens is not None
    query.write(opens)
    start, model = query.save(), Rules.of_scene(scene).model
    stage = types.SimpleNamespace(
        scene=scene,
        view=query.view,
        model=model,
        states=None,
        snapshot=lambda world: start,
        agent=0,
        controller=None,
        num_worlds=1,
        by_friction=False,
        act=print,
        ended=print,
    )
    motion, reads = MotionPlanner(scene), SceneQuery(scene)
    return PlannedWorld(stage, body, Domain(model, 2), motion, reads, 0, np.random.default_rng(0))


def test_the_leaf_that_stands_across_the_only_way_is_found_with_the_floor_behind_it(world):
    leaf = doors.leaf_in_the_way(world, Step("wipe", ("bottom_cabinet_4", "rag")))
    assert leaf is not None and leaf.door == "door_4"
    stance = leaf.off(world)
    assert leaf.before(stance) and world.floor().way(world.base[0], stance.xy) is not None
    assert stance.xy[1] > 1.5  # in the bedroom, whose door is at y = 1.33


def test_no_leaf_is_in_the_way_to_what_is_in_reach(world):
    assert doors.leaf_in_the_way(world, Step("open", ("door_4",))) is None
