"""A ROS 2 node whose robot lives in a home: `python examples/ros2_bridge.py`.

It needs rclpy: a ROS 2 of your own, or with Python 3.12 `pip install "ros-jazzy-rclpy[fastrtps]" ros-jazzy-sensor-msgs
ros-jazzy-nav-msgs ros-jazzy-rosgraph-msgs`. It publishes /clock, /scan, /camera/image, /camera/depth, /joint_states and
/odom in each agent step (10 Hz), and drives as /cmd_vel says. A command holds for half a second.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState, LaserScan
from std_msgs.msg import Header

import ig2mj
from ig2mj.agents import turtlebot
from ig2mj.agents.controllers import drive_limits
from ig2mj.agents.fetch import figures

DRIVES = {"turtlebot": turtlebot, "fetch": figures}
"""Where the sizes of each robot's wheels are."""

HOLD = 5
"""Agent steps for which a command holds."""

TOPICS = {"clock": Clock, "scan": LaserScan, "joint_states": JointState, "odom": Odometry}
TOPICS |= {"camera/image": Image, "camera/depth": Image}


def image(header: Header, pixels: np.ndarray, encoding: str) -> Image:
    """[height, width, channels] as a message."""
    height, width, step = *pixels.shape[:2], pixels.nbytes // len(pixels)
    return Image(header=header, height=height, width=width, encoding=encoding, step=step, data=pixels.tobytes())


class Bridge(Node):
    """One world of an environment as a node. `state`: of the environment; `steps`: since the start."""

    def __init__(self, task: str = "PointNavigation", robot: str = "turtlebot", seed: int = 0, **options: Any):
        """Makes the environment and the topics. `options`: of `ig2mj.make`."""
        super().__init__("ig2mj")
        self.env = ig2mj.make(task, robot=robot, worlds=1, observations=("scan", "rgb", "depth"), **options)
        self.state, self.steps, self.robot = self.env.reset(seed), 0, robot
        drive, tables, model = DRIVES[robot], self.env.scene.tables, self.env.scene.model
        self._limits = np.array(drive_limits(drive.WHEEL_RADIUS, drive.AXLE, drive.MAX_WHEEL))
        named = {int(address): model.joint(j).name for j, address in enumerate(model.jnt_qposadr)}
        self._joints = [named[int(address)] for address in tables.agent_joint_qposadr]
        self._command, self._since = np.zeros(2), HOLD
        self._topics = {name: self.create_publisher(kind, name, 10) for name, kind in TOPICS.items()}
        self.create_subscription(Twist, "cmd_vel", self._listen, 10)

    def _listen(self, twist: Twist) -> None:
        self._command, self._since = np.array([twist.linear.x, twist.angular.z]), 0

    def step(self) -> dict[str, Any]:
        """One agent step; publishes what it gives. Returns the messages by topic."""
        drive = self._command / self._limits if self._since < HOLD else np.zeros(2)
        action = np.zeros((1, self.env.action_space.shape[0]), np.float32)
        action[0, :2] = np.clip(drive, -1, 1)
        self.state = self.env.step_autoreset(self.state, action)
        self.steps, self._since = self.steps + 1, self._since + 1
        messages = self.messages()
        for name, message in messages.items():
            self._topics[name].publish(message)
        return messages

    def messages(self) -> dict[str, Any]:
        """What is published now, by topic."""
        now, agent = self.steps * self.env.period, self.state.batch.world.view.agent
        stamp = Time(sec=int(now), nanosec=round(now % 1 * 1e9) % 10**9)
        obs = {name: np.asarray(rows)[0] for name, rows in self.state.obs.items()}
        options, base = self.env.sensor_options, Header(stamp=stamp, frame_id="base_link")
        eye, near, far = Header(stamp=stamp, frame_id="camera"), options.scan_near, options.scan_far
        half, turn = math.radians(options.scan_angle) / 2, math.radians(options.scan_angle) / options.scan_rays
        span = {"angle_min": -half, "angle_max": half - turn, "angle_increment": turn, "scan_time": self.env.period}
        ranges = (near + obs["scan"][:, 0] * (far - near)).astype(np.float32).tolist()
        odometry = Odometry(header=Header(stamp=stamp, frame_id="odom"), child_frame_id="base_link")
        place, quat = odometry.pose.pose.position, odometry.pose.pose.orientation
        place.x, place.y, place.z = map(float, np.asarray(agent.base_pos)[0, 0])
        quat.w, quat.x, quat.y, quat.z = map(float, np.asarray(agent.base_quat)[0, 0])
        position, velocity = (np.asarray(rows)[0].tolist() for rows in (agent.joint_pos, agent.joint_vel))
        return {
            "clock": Clock(clock=stamp),
            "scan": LaserScan(header=base, **span, range_min=near, range_max=float(far), ranges=ranges),
            "camera/image": image(eye, obs["rgb"], "rgb8"),
            "camera/depth": image(eye, obs["depth"].astype(np.float32), "32FC1"),
            "joint_states": JointState(header=base, name=self._joints, position=position, velocity=velocity),
            "odom": odometry,
        }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", choices=sorted(DRIVES), default="turtlebot")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steps", type=int, default=0, help="0: until Ctrl-C")
    arguments = parser.parse_args()
    rclpy.init()
    bridge, begun = Bridge(robot=arguments.robot, seed=arguments.seed), time.monotonic()
    try:
        while rclpy.ok() and (not arguments.steps or bridge.steps < arguments.steps):
            rclpy.spin_once(bridge, timeout_sec=0.0)
            bridge.step()
            time.sleep(max(0.0, begun + bridge.steps * bridge.env.period - time.monotonic()))
            if bridge.steps % 50 == 0:
                print(f"{bridge.steps} steps, {bridge.steps / (time.monotonic() - begun):.1f} per second", flush=True)
    except KeyboardInterrupt:
        pass
    bridge.destroy_node()
    rclpy.try_shutdown()
