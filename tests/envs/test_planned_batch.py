"""Many worlds with plans of their own, on any engine, planned for here or in processes."""

import numpy as np
import pytest

import ig2mj
from ig2mj.envs.planned_batch import PlannedBatch
from ig2mj.planning.steps import PlanningError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def make(tiny_home_folder):
    def made(engine, **options):
        name = f"goal/{tiny_home_folder} (on_top apple pan)"
        return ig2mj.make(name, worlds=2, engine=engine, pool_size=1, **options)

    return made


def test_worlds_of_the_native_engine_reach_their_goals(make):
    with PlannedBatch(make("native")) as batch:
        found = batch.run(range(3))
        assert [(e.number, e.success, e.q) for e in found] == [(0, True, 1.0), (1, True, 1.0), (2, True, 1.0)]
        more = batch.stream(3, seed=1)
        assert sorted(e.number for e in more) == [0, 1, 2] and all(e.success for e in more)
        figures = batch.spent.figures()
        assert figures["programs"] > 0 and figures["waited"] == 0 and 0.0 < figures["planning_share"] < 1.0


def test_processes_plan_while_worlds_wait(make):
    with PlannedBatch(make("native"), processes=1) as batch:
        batch.warm_up()
        found = batch.run(range(2))
        assert all(e.success for e in found)
        assert batch.spent.figures()["planned"] > 0.0
        assert not batch.planners.asked


def test_worlds_of_warp_reach_the_same_goals(make):
    with PlannedBatch(make("warp")) as batch:
        assert [e.success for e in batch.run(range(2))] == [True, True]


def test_an_episode_whose_time_is_over_has_no_success(make):
    with PlannedBatch(make("native")) as batch:
        found = batch.run(range(2), until=1e-6)
        assert not found or not any(e.success for e in found)
        assert np.isfinite(batch.spent.stepping)


def test_a_robot_that_cannot_be_planned_for_is_refused(make, monkeypatch):
    env = make("native")
    monkeypatch.setattr(env, "robot", "turtlebot")
    with pytest.raises(PlanningError, match="turtlebot"):
        PlannedBatch(env)
