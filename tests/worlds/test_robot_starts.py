"""The axis `robot_start`: free of collisions, with the objects within reach, hands along with the base."""

from __future__ import annotations

import engine_bench
import numpy as np
import pytest

import ig2mj
from ig2mj.engine.base import Write
from ig2mj.engine.model_fields import POSES, ModelFields, own_fields
from ig2mj.engine.registry import make_engine
from ig2mj.envs.start_choices import moving_fields
from ig2mj.errors import EngineError
from ig2mj.tasks.registry import load_task
from ig2mj.worlds.randomize import Randomize
from ig2mj.worlds.robot_starts import COUNT


@pytest.mark.parametrize(
    "name", ["native", pytest.param("jax", marks=pytest.mark.slow), pytest.param("warp", marks=pytest.mark.slow)]
)
def test_a_body_without_joints_is_where_its_world_has_it(name, bench_folder):
    """After a write, after a step, and from a snapshot."""
    scene = engine_bench.bench_home(bench_folder, False)
    model = scene.model
    body = next(b for b in range(1, model.nbody) if model.body_parentid[b] == 0 and not model.body_jntnum[b])
    engine = make_engine(name, scene, 2, model_fields=POSES)
    physics = engine.reset()
    before = np.asarray(engine.view(physics).body_pos)[:, body].copy()
    own = own_fields(model, POSES)
    pos, quat = np.tile(own.body_pos, (2, 1, 1)), np.tile(own.body_quat, (2, 1, 1))
    pos[1, body] += (0.1, 0.0, 0.0)
    physics = engine.write(physics, Write(model_fields=ModelFields(body_pos=pos, body_quat=quat)))
    kept, expected = engine.snapshot(physics), [[0, 0, 0], [0.1, 0, 0]]
    np.testing.assert_allclose(np.asarray(engine.view(physics).body_pos)[:, body] - before, expected, atol=1e-5)
    _, view = engine.step(physics, None)
    np.testing.assert_allclose(np.asarray(view.body_pos)[:, body] - before, expected, atol=1e-5)
    again = engine.load(engine.reset(), kept)
    np.testing.assert_allclose(np.asarray(engine.view(again).body_pos)[:, body] - before, expected, atol=1e-5)


def test_only_activities_start_robots_elsewhere():
    with pytest.raises(EngineError, match="robot_start of PointNavigation"):
        moving_fields(load_task("PointNavigation"), None, Randomize(robot_start=True))


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["humanoid", "fetch"])
def test_base_and_hands_move_together_and_meet_nothing(robot):
    """The hand is where it was in the frame of the base; a pinned base has a pose of its own in each world."""
    worlds = 6
    env = ig2mj.make("GraspingBook", robot, worlds, "native", pool_size=worlds, randomize=["robot_start"])
    usual = ig2mj.make("GraspingBook", robot, 1, "native", pool_size=1).start_from(np.array([0])).batch.world.view.agent
    state = env.start_from(np.arange(worlds))
    agent, offset = state.batch.world.view.agent, np.asarray(state.draw.robot_start)
    assert np.ptp(offset, axis=0).min() > 0.02 and len(env.core.starts.robot_starts.offsets) == COUNT
    base, own = np.asarray(agent.base_pos)[:, 0], np.asarray(usual.base_pos)[0, 0]
    np.testing.assert_allclose(base[:, :2] - own[:2], offset[:, :2], atol=1e-4)  # it faces x
    turn = 2 * np.arctan2(np.asarray(agent.base_quat)[:, 0, 3], np.asarray(agent.base_quat)[:, 0, 0])
    np.testing.assert_allclose(turn, offset[:, 2], atol=1e-4)
    away, before = np.asarray(agent.hand_pos)[:, 0] - base, (np.asarray(usual.hand_pos)[0, 0] - own)
    cos, sin = np.cos(-offset[:, 2]), np.sin(-offset[:, 2])
    turned = np.stack([cos * away[:, 0] - sin * away[:, 1], sin * away[:, 0] + cos * away[:, 1], away[:, 2]], axis=1)
    np.testing.assert_allclose(turned, np.tile(before, (worlds, 1)), atol=2e-3)
    still = np.zeros((worlds, *env.action_space.shape), np.float32)
    for _ in range(3):
        state = env.step(state, still)
    after = np.asarray(state.batch.world.view.agent.base_pos)[:, 0]
    assert np.linalg.norm(after - base, axis=1).max() < 0.01 and not np.asarray(state.info["flags"]).any()
    state = env.reset(state, np.array([True] + [False] * (worlds - 1)))
    assert not np.allclose(np.asarray(state.draw.robot_start)[0], offset[0])
    np.testing.assert_array_equal(np.asarray(state.draw.robot_start)[1:], offset[1:])
