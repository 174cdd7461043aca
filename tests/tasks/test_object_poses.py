"""Start states of the axis `object_poses`: other supports, clutter, and rows that differ most."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.envs.start_choices import varied_poses
from ig2mj.errors import EngineError
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.object_poses import farthest, other_starts, spread_starts
from ig2mj.tasks.pools import bare_scene, pool_of
from ig2mj.tasks.registry import load_task
from ig2mj.worlds.randomize import Randomize


def test_rows_that_differ_most_are_taken():
    points = np.array([[0.0, 0], [0.1, 0], [10, 0], [5, 0], [5.1, 0], [0, 8]])
    assert farthest(points, 4).tolist() == [0, 2, 3, 5]
    assert farthest(points, 99).tolist() == [0, 1, 2, 3, 4, 5]


@pytest.mark.slow
def test_other_furniture_in_reach_bears_the_objects_but_none_that_the_goal_is_about():
    towel = ACTIVITIES["SoakingTowel"]
    starts = [task.start for task in other_starts(towel, bare_scene(towel))]
    assert starts[0] == towel.start and "(on_top bath_towel_0 bottom_cabinet_0)" in starts[1]
    assert not any("bath_towel_0 sink_0" in text for start in starts for text in start)


def test_only_activities_have_start_states_that_differ():
    with pytest.raises(EngineError, match="object_poses of PointNavigation: only start states"):
        varied_poses(load_task("PointNavigation"), None, Randomize(object_poses=True), "train")


@pytest.mark.slow
def test_rows_lie_farther_apart_than_the_first_rows_of_the_pool():
    task = ACTIVITIES["GraspingBook"]
    address = bare_scene(task).model.joint("notebook_0/free").qposadr[0]

    def nearest(rows: np.ndarray) -> float:
        gaps = np.linalg.norm(rows[:, None] - rows, axis=-1) + 9 * np.eye(len(rows))
        return float(gaps.min(1).mean())

    spread, plain = (
        np.asarray(pool.physics.scene.qpos)[:, address : address + 2]
        for pool in (spread_starts(task, "held_out", 16), pool_of(task, "held_out", 16))
    )
    assert len(spread) == 16 and nearest(spread) > 1.2 * nearest(plain)
