"""Navigation tasks: every promise of an environment, and that their goals can be reached."""

from __future__ import annotations

import numpy as np
import pytest
from navigating import column, drive, small

import ig2mj
from ig2mj.errors import EngineError
from ig2mj.testing import api_test

ROWS = 8


@pytest.fixture(scope="module")
def point():
    task = small("PointNavigation", target_dist=(1.0, 4.0))
    return ig2mj.make(task, worlds=4, pool_size=ROWS, observations=("proprioception", "privileged_state", "task_obs"))


@pytest.mark.slow
def test_every_promise_is_kept(point):
    api_test(point)


@pytest.mark.slow
def test_who_follows_the_way_arrives(point):
    state = point.reset(3)
    over, paid = np.zeros(4, bool), np.zeros(4)
    first = column(point, state, "way_left")[:, 0]
    spl = np.zeros(4)
    for _ in range(200):
        state = point.step(state, drive(point, state))
        paid += np.where(
            over, 0.0, np.asarray(state.info["reward/potential"]) + np.asarray(state.info["reward/success"])
        )
        ended = np.asarray(state.terminated) & ~over
        spl[ended] = np.asarray(state.info["spl"])[ended]
        over |= ended
        if over.all():
            break
    assert over.all()
    left = point.task.tolerance + 0.1
    assert (paid > 10 + first - left - 0.05).all() and (paid < 10 + first).all()
    assert (spl > 0.6).all() and (spl <= 1.0).all()


def test_the_goal_is_seen_in_polar_coordinates_of_the_base(point):
    state = point.reset(1)
    x, y = column(point, state, "goal_x", "goal_y").T
    seen = np.asarray(state.obs["task_obs"])
    assert seen[:, 0] == pytest.approx(np.hypot(x, y), abs=1e-4)
    assert seen[:, 1] == pytest.approx(np.arctan2(y, x), abs=1e-4)
    straight, way = seen[:, 0], column(point, state, "way_left")[:, 0]
    assert (way > straight - 0.1).all()


def test_robots_begin_at_rest(point):
    """One that only touched the floor would drive off otherwise in single precision; see `starts._sunk`."""
    state = point.reset(4)
    before = np.array(state.batch.world.view.agent.base_pos)
    state = point.step(state, np.zeros((4, 2), np.float32))
    assert np.abs(np.asarray(state.batch.world.view.agent.base_pos) - before).max() < 2e-5, "0.15 mm from touching it"


@pytest.mark.slow
def test_who_drives_into_a_wall_pays_for_every_step_of_it(point):
    state = point.reset(2)
    forward = np.tile(np.array([[1.0, 0.0]], np.float32), (4, 1))
    for _ in range(60):
        state = point.step(state, forward)
    assert (np.asarray(state.info["collisions"]) > 0).sum() >= 3
    hit = column(point, state, "collision")[:, 0] > 0
    assert np.asarray(state.info["reward/collision"])[hit] == pytest.approx(-0.1)


@pytest.mark.slow
def test_starts_belong_to_their_split(point):
    others = ig2mj.make(point.task, worlds=4, pool_size=ROWS, split="held_out")
    seen = [np.asarray(env.reset(0).batch.world.view.agent.base_pos) for env in (point, others)]
    assert not np.allclose(*seen)
    with pytest.raises(EngineError, match="turtlebot, fetch can"):
        ig2mj.make(point.task, robot="humanoid")
