"""The ROS 2 bridge against rclpy itself: another node hears the topics, and its commands move the robot."""

from __future__ import annotations

import pathlib
import subprocess
import sys

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import Twist

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "examples"))

import ros2_bridge

OPTIONS = {"engine": "native", "pool_size": 2}


@pytest.fixture(scope="module")
def ros():
    rclpy.init()
    yield
    rclpy.try_shutdown()


@pytest.fixture(scope="module")
def bridge(ros):
    node = ros2_bridge.Bridge(seed=3, **OPTIONS)
    yield node
    node.destroy_node()


@pytest.fixture(scope="module")
def listener(ros):
    """Another node. `heard`: its last message of each topic."""
    node = rclpy.create_node("listener")
    node.heard = {}
    for name, kind in ros2_bridge.TOPICS.items():
        node.create_subscription(kind, name, lambda message, name=name: node.heard.__setitem__(name, message), 10)
    node.commands = node.create_publisher(Twist, "cmd_vel", 10)
    yield node
    node.destroy_node()


def drive(bridge, listener, forward: float, steps: int) -> None:
    for _ in range(steps):
        twist = Twist()
        twist.linear.x = forward
        listener.commands.publish(twist)
        for _ in range(20):
            rclpy.spin_once(bridge, timeout_sec=0.01)
        bridge.step()
        for _ in range(20):
            rclpy.spin_once(listener, timeout_sec=0.01)


def base(bridge) -> np.ndarray:
    return np.asarray(bridge.state.batch.world.view.agent.base_pos)[0, 0, :2].copy()


def test_a_node_that_listens_hears_every_topic(bridge, listener):
    drive(bridge, listener, 0.0, 3)
    heard, obs = listener.heard, {name: np.asarray(rows)[0] for name, rows in bridge.state.obs.items()}
    assert set(heard) == set(ros2_bridge.TOPICS)
    scan, options = heard["scan"], bridge.env.sensor_options
    assert len(scan.ranges) == options.scan_rays
    expected = options.scan_near + obs["scan"][:, 0] * (options.scan_far - options.scan_near)
    assert np.allclose(scan.ranges, expected, atol=1e-6)
    assert scan.angle_min == pytest.approx(-np.pi / 2) and scan.angle_increment * len(scan.ranges) == pytest.approx(
        np.pi
    )
    image = heard["camera/image"]
    assert (image.encoding, image.step) == ("rgb8", 3 * image.width)
    assert np.array_equal(np.frombuffer(bytes(image.data), np.uint8).reshape(image.height, image.width, 3), obs["rgb"])
    depth = heard["camera/depth"]
    seen = np.frombuffer(bytes(depth.data), np.float32).reshape(depth.height, depth.width, 1)
    assert np.array_equal(seen, obs["depth"])
    joints = heard["joint_states"]
    assert list(joints.name) == ["turtlebot_wheel_left_joint", "turtlebot_wheel_right_joint"]
    assert len(joints.position) == len(joints.velocity) == 2
    now = heard["clock"].clock
    assert now.sec + now.nanosec * 1e-9 == pytest.approx(bridge.steps * bridge.env.period)
    place = heard["odom"].pose.pose.position
    assert [place.x, place.y] == pytest.approx(base(bridge), abs=1e-6)


def test_commands_drive_the_robot_in_metres_per_second(bridge, listener):
    """Backwards, where the first start of this seed has room; half the speed for a second, within a third."""
    bridge.state, before = bridge.env.reset(3), None
    speeds = []
    for forward in (0.3, -0.3):
        drive(bridge, listener, forward, 3)  # gets up to speed
        before = base(bridge)
        drive(bridge, listener, forward, 5)
        speeds.append(float(np.linalg.norm(base(bridge) - before)) / (5 * bridge.env.period))
    assert max(speeds) == pytest.approx(0.3, rel=0.35)


def test_without_commands_the_robot_stops(bridge, listener):
    drive(bridge, listener, 0.3, 2)
    for _ in range(ros2_bridge.HOLD + 5):
        rclpy.spin_once(bridge, timeout_sec=0.0)
        bridge.step()
    before = base(bridge)
    bridge.step()
    assert np.linalg.norm(base(bridge) - before) < 0.005


def test_it_runs_as_a_program_and_says_how_fast_it_is():
    command = [sys.executable, ros2_bridge.__file__, "--steps", "50", "--seed", "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.startswith("50 steps, ")
