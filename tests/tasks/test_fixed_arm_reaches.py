"""A robot that is bolted to the floor does Reaching and the activities at a counter, and no other navigation."""

from __future__ import annotations

import numpy as np
import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_robot import convert_robot
from rover import write_rover

import ig2mj
from ig2mj.agents.urdf import UrdfRobot
from ig2mj.errors import EngineError


@pytest.fixture(scope="module")
def arm(tmp_path_factory) -> UrdfRobot:
    """The rover's arm, its base bolted down."""
    made = tmp_path_factory.mktemp("arm")
    convert_robot(write_rover(made), made / "out", options=ConvertOptions(report=False))
    return UrdfRobot.load(made / "out", {"base": "fixed"})


def test_a_fixed_arm_drives_to_no_point(arm):
    with pytest.raises(EngineError, match="does not drive: it cannot do PointNavigation"):
        ig2mj.make("PointNavigation", robot=arm, pool_size=1)


@pytest.mark.slow
def test_goals_of_a_fixed_arm_are_where_its_hand_gets(arm):
    env = ig2mj.make("Reaching", robot=arm, pool_size=3, engine="native")
    state = env.reset(0)
    base, hand = (np.asarray(getattr(state.batch.world.view.agent, name))[0, 0] for name in ("base_pos", "hand_pos"))
    goals = env.core.starts.pool.size and np.asarray(env.objective._goals)
    assert len(goals) == 3
    reach = 0.22 + 0.34 + 0.1
    assert (np.linalg.norm(goals - base - [0.1, 0, 0.18], axis=1) < reach).all() and (goals[:, 2] > 0.05).all()
    assert np.linalg.norm(hand - base) < 1.0
    after = env.step(state, np.zeros((1, *env.action_space.shape), np.float32))
    assert np.isfinite(np.asarray(after.reward)).all() and not bool(np.asarray(after.terminated)[0])


@pytest.mark.slow
def test_a_fixed_arm_stands_on_a_pedestal_at_the_table_of_an_activity(arm):
    env = ig2mj.make("GraspingBook", robot=arm, pool_size=2, grasping="assisted", engine="native")
    state = env.reset(0)
    height = float(np.asarray(state.batch.world.view.agent.base_pos)[0, 0, 2])
    assert height == pytest.approx(0.8 - 0.18, abs=0.01), "its first joint is 0.18 m above its base"
    after = env.step(state, np.zeros((1, *env.action_space.shape), np.float32))
    assert np.isfinite(np.asarray(after.reward)).all()
