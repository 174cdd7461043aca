"""The view's eyes are where controllers have them, on every engine and in every face."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_home import write_tiny_home

import ig2mj
from ig2mj.agents import Fetch, Humanoid
from ig2mj.engine.registry import make_engine
from ig2mj.engine.view import axis_sizes, faults
from ig2mj.worlds import Worlds

HALF = np.sqrt(0.5)

NEAR_BALL = {"pos": (-1.0, 0.6, 0.6), "quat": (HALF, 0.0, 0.0, -HALF)}
"""Before the ball at (-1, -1), which is in view there."""


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    home = write_tiny_home(tmp_path_factory.mktemp("eyes") / "home")
    return ig2mj.load_scene(home, agents=[Fetch(pos=(0.5, -1.2, 0.0)), Humanoid(**NEAR_BALL)])


def looking_away(worlds: Worlds) -> np.ndarray:
    """In world 1 the humanoid turns its head by 1 rad, raised by 5 cm."""
    names = [n for c in worlds.core.controllers for n in c.action_names]
    action = np.zeros((2, len(names)), np.float32)
    action[1, names.index("eye_yaw")], action[1, names.index("eye_z")] = 1.0, 0.05
    return action


@pytest.fixture(scope="module", params=["native", pytest.param("warp", marks=pytest.mark.slow)])
def looked(request, scene):
    """Two turns of the head in world 1, none in world 0; then what the batch's view says."""
    engine = make_engine(request.param, scene, 2)
    worlds = Worlds(scene, 2, engine, goal="(in_fov_of_agent ball)")
    batch = worlds.start(0)
    first, status = worlds.step(batch)
    seen_at_first = np.asarray(status.holds)
    batch = first
    for _ in range(3):
        batch, status = worlds.step(batch, looking_away(worlds))
    return worlds, batch, seen_at_first, np.asarray(status.holds)


def test_the_eye_of_the_view_is_the_controllers(looked):
    worlds, batch, _, _ = looked
    view = batch.world.view
    pos, quat = worlds.core.controllers[1].eye(view, batch.controllers[1])
    np.testing.assert_allclose(view.agent.eye_pos[:, 1], pos, atol=1e-6)
    np.testing.assert_allclose(view.agent.eye_quat[:, 1], quat, atol=1e-6)
    compiled = worlds.engine.view(batch.world.physics).agent
    np.testing.assert_allclose(view.agent.eye_pos[:, 0], compiled.eye_pos[:, 0], atol=1e-6)
    assert np.linalg.norm(np.asarray(view.agent.eye_pos - compiled.eye_pos)[1, 1]) == pytest.approx(0.15, abs=1e-3)
    np.testing.assert_allclose(view.agent.eye_pos[0], compiled.eye_pos[0], atol=1e-5)


def test_a_goal_of_the_field_of_view_is_of_where_the_head_looks(looked):
    """Fetch sees the ball in no world."""
    _, _, at_first, after = looked
    assert at_first.tolist() == [True, True] and after.tolist() == [True, False]


def test_the_view_keeps_its_schema(looked):
    worlds, batch, _, _ = looked
    assert faults(batch.world.view, axis_sizes(worlds.scene.tables, 2)) == []


def test_a_reset_looks_ahead_again(looked):
    worlds, batch, _, _ = looked
    batch = worlds.reset(batch, np.array([False, True]))
    batch, status = worlds.step(batch, np.zeros_like(looking_away(worlds)))
    assert np.asarray(status.holds).tolist() == [True, True]


def test_a_simulation_asks_where_the_head_looks(scene):
    simulation = ig2mj.Simulation(scene)
    assert simulation.predicate("in_fov_of_agent", "ball")
    for _ in range(2):
        simulation.robots.act(eye_yaw=1.0)
    assert not simulation.predicate("in_fov_of_agent", "ball")
    simulation.reset()
    assert simulation.predicate("in_fov_of_agent", "ball")
