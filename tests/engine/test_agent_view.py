"""What the view says of agents: velocities, finger forces, touching, held objects; alike on every engine."""

from __future__ import annotations

import functools

import bench_scene
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.floating_hand import add_floating_hand, hand_ctrl
from ig2mj.engine.mjx.velocities import Moved, body_velocities, joints_above
from ig2mj.engine.native.engine import NativeEngine

ON_BOX = bench_scene.TOP + 2 * bench_scene.HALF + 0.04 - bench_scene.HAND_START[2]
"""Control at which the ball of the bench's hand just touches the box."""


def graspable(bench, name: str) -> int:
    """Y of an object's main body."""
    tables = bench.engine.tables
    return int(np.flatnonzero(tables.graspable_object == bench.index(name))[0])


def test_a_hand_presses_on_the_box_below_it(full):
    """In world 1 only; at rest the finger's force is the motor's: 1000 N/m times the way not reached."""
    ctrl = np.array([[0, 0, 0], [0, 0, ON_BOX - 0.02]], np.float32)
    _, view = full.run(full.fresh(), 60, ctrl)
    agent, box = view.agent, full.index("box")
    assert np.asarray(agent.touching)[:, 0, box].tolist() == [False, True]
    assert not np.asarray(agent.touching)[:, 0, full.index("knife")].any()
    force = np.asarray(agent.finger_force)[:, 0]
    assert force[0] == pytest.approx(0.0)
    left = float(np.asarray(agent.hand_pos)[1, 0, 2]) - bench_scene.HAND_START[2] - ctrl[1, 2]
    assert force[1, graspable(full, "box")] == pytest.approx(1000 * left, rel=0.02)
    assert left > 0.015 and np.count_nonzero(force[1] > 0.01) == 1


def test_a_hand_that_lets_go_touches_nothing(full):
    physics, _ = full.run(full.fresh(), 40, np.array([[0, 0, ON_BOX - 0.02]] * 2, np.float32))
    _, view = full.run(physics, 40, np.zeros((2, 3), np.float32))
    assert not np.asarray(view.agent.touching).any() and not np.asarray(view.agent.finger_force).any()


def test_velocities_are_those_of_the_poses(full):
    """Of the hand while it moves and of a box that falls, against the way covered in a control step."""
    physics = full.write(full.fresh(), full.teleport("box", [0.3, 0.1, 1.5], (0.9, 0.1, 0.3, 0.2)))
    ctrl = np.array([[0.5, 0, 0], [0, 0.5, 0.5]], np.float32)
    physics, before = full.run(physics, 4, ctrl)
    physics, after = full.run(physics, 1, ctrl)
    for pos, vel, slack in (("hand_pos", "hand_linvel", 0.15), ("base_pos", "base_linvel", 0.15)):
        way = np.asarray(getattr(after.agent, pos)) - np.asarray(getattr(before.agent, pos))
        mean = (np.asarray(getattr(after.agent, vel)) + np.asarray(getattr(before.agent, vel))) / 2
        assert np.abs(mean).max() > 0.5
        np.testing.assert_allclose(30 * way, mean, atol=slack)
    box = full.index("box")
    way = np.asarray(after.object_pos)[:, box] - np.asarray(before.object_pos)[:, box]
    mean = (np.asarray(after.object_linvel) + np.asarray(before.object_linvel))[:, box] / 2
    np.testing.assert_allclose(30 * way, mean, atol=0.05)
    assert (np.asarray(after.object_linvel)[:, full.index("table")] == 0).all()
    np.testing.assert_allclose(after.agent.joint_pos, np.asarray(full.engine.snapshot(physics).qpos)[:, -3:], atol=1e-6)
    np.testing.assert_allclose(after.agent.joint_vel, np.asarray(after.agent.hand_linvel)[:, 0], atol=1e-5)


def test_two_hands_are_two_agents_with_fingers_of_their_own(tiny_home_folder):
    hands = [functools.partial(add_floating_hand, pos=(x, 0, 1), name=f"hand_{x}") for x in (-1, 1)]
    scene = ig2mj.load_scene(tiny_home_folder, agents=hands)
    engine, tables = NativeEngine(scene), scene.tables
    _, view = engine.step(
        engine.reset(), np.concatenate([hand_ctrl((0, 0, 0.1)), hand_ctrl((0, 0, 0), (0, 0, 1))])[None]
    )
    assert view.agent.hand_linvel[0, 0, 2] > 0.1 and abs(view.agent.hand_linvel[0, 1, 2]) < 0.01
    assert view.agent.hand_angvel[0, 1, 2] > 0.1 and abs(view.agent.hand_angvel[0, 0, 2]) < 0.01
    assert tables.finger_hand.tolist() == [0] * 10 + [1] * 10 == tables.finger_agent.tolist()
    assert (view.agent.finger_pos[0, :10, 0] < 0).all() and (view.agent.finger_pos[0, 10:, 0] > 0).all()


def test_velocities_from_joints_are_mujocos():
    """A tree with every kind of joint, several on one body, moving at random."""
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody>
      <body name="a" pos="0 0 1"><freejoint/><geom size="0.1"/>
        <body name="b" pos="0.3 0.1 0" euler="20 30 40"><joint type="ball" pos="0.05 0 0"/><geom size="0.1"/>
          <body name="c" pos="0 0.4 0"><joint type="slide" axis="1 1 0"/>
            <joint type="hinge" axis="0 1 1" pos="0 0 0.2"/><joint type="hinge" axis="1 0 0"/><geom size="0.1"/>
            <body name="d" pos="0.2 0 0"><geom size="0.1"/></body>
      </body></body></body><body name="e"/></worldbody></mujoco>""")
    data, rng = mujoco.MjData(model), np.random.default_rng(3)
    for _ in range(5):
        mujoco.mj_integratePos(model, data.qpos, rng.normal(size=model.nv), 1.0)
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_forward(model, data)
        arrays = (data.qpos, data.qvel, data.xpos, data.xquat, data.xanchor, data.xaxis)
        moved = Moved(*(jnp.asarray(array[None], jnp.float32) for array in arrays))
        linear, angular = body_velocities(joints_above(model, np.arange(model.nbody)), moved)
        for body in range(model.nbody):
            expected = np.zeros(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, expected, 0)
            np.testing.assert_allclose(linear[0, body], expected[3:], atol=1e-4)
            np.testing.assert_allclose(angular[0, body], expected[:3], atol=1e-4)
