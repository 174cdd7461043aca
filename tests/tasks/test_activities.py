"""The six activities fit their homes: names, goals, points, robots in free floor, all within reach."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ig2mj.engine.registry import make_engine
from ig2mj.envs.names import NAMES
from ig2mj.errors import EngineError
from ig2mj.scene.scene import load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.reward import Reward
from ig2mj.tasks.task import place_robot
from ig2mj.worlds.rules import Rules

FLOOR = ("floors", "carpet")


def test_names_are_known_without_loading_tasks():
    assert tuple(ACTIVITIES) == NAMES[: len(ACTIVITIES)]


@pytest.mark.parametrize("name", ACTIVITIES)
def test_a_home_of_at_least_sixty_objects_has_all_that_the_activity_is_about(name):
    task = ACTIVITIES[name]
    for robot in task.robots:
        scene = load_scene(task.home, agents=[place_robot(task, robot)[1]], objects=task.objects)
        rules = Rules.of_scene(scene).with_goal(task.goal)
        Reward(task, robot, scene, rules.model)
        assert len(load_scene(task.home).object_names) >= 60
        engine = make_engine("native", scene, 1)
        touched = np.flatnonzero(engine.view(engine.reset()).agent.touching[0, 0])
        assert {scene.tables.object_categories[o] for o in touched} <= set(FLOOR), f"{robot} starts in something"


def test_one_arm_does_not_lift_the_cauldron():
    """Paper, appendix A.3: five of the six activities were learned by Fetch."""
    with pytest.raises(EngineError, match=r"'fetch' has 1 hand: .* takes 2 \(humanoid can\)"):
        place_robot(ACTIVITIES["BimanualPickAndPlace"], "fetch")


@pytest.mark.parametrize("robot", ["humanoid", "fetch"])
def test_whoever_slices_fruit_sees_the_part_of_the_table_where_things_lie(robot):
    task = ACTIVITIES["SlicingFruit"]
    scene = load_scene(task.home, agents=[place_robot(task, robot)[1]], objects=task.objects)
    engine = make_engine("native", scene, 1)
    view, table = engine.view(engine.reset()), scene.object_index("coffee_table_0")
    low, high = np.asarray(view.aabb_low)[0, table], np.asarray(view.aabb_high)[0, table]
    top = np.stack(np.meshgrid(*np.linspace(low[:2], high[:2], 40).T, [high[2]]), -1).reshape(-1, 3)
    near = task.near[0]
    top = top[np.linalg.norm(top - near.pos, axis=1) < near.most]
    across, up, depth = (_in_eye(view, top)).T
    edge = depth * np.tan(scene.tables.agent_fovy[0] / 2)
    seen = (depth > 0) & (np.abs(across) < edge) & (np.abs(up) < edge)
    assert len(top) > 100
    assert seen.mean() > 0.7


def _in_eye(view, points):
    """Right, up and ahead of the first robot's eye, m."""
    eye = Rotation.from_quat(np.roll(np.asarray(view.agent.eye_quat)[0, 0], -1))
    return eye.inv().apply(points - np.asarray(view.agent.eye_pos)[0, 0]) * (1.0, 1.0, -1.0)
