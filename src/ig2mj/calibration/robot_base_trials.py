"""Trials of a robot's base: it stands without a command (`stands`), and drives ahead (`drives`)."""

from __future__ import annotations

import math

import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.urdf import UrdfRobot
from ig2mj.simulation import Simulation

STAND_SECONDS = 5.0
MOST_TILT, MOST_DRIFT, MOST_SAG = math.radians(5.0), 0.03, 0.05
"""rad, m, and rad or m: of the base and of the arm's joints, of a robot that stands."""

DISTANCE, MOST_DRIVE_SECONDS = 1.0, 20.0
"""m that a robot drives, and s that it may take."""


def stands(simulation: Simulation, robot: UrdfRobot) -> bool:
    """Nothing tilts, drifts or sags in five seconds without a command."""
    data, name = simulation.data, robot.name
    joints = [f"{name}_{joint}" for joint in robot.layout.arm]
    before, at = np.array(data.body(name).xpos), np.array([data.joint(j).qpos[0] for j in joints])
    upright = np.array(data.body(name).xmat).reshape(3, 3)[:, 2]
    simulation.robots.act(count=round(STAND_SECONDS / ACTION_PERIOD))
    data = simulation.data
    tilt = float(np.arccos(np.clip(upright @ np.array(data.body(name).xmat).reshape(3, 3)[:, 2], -1, 1)))
    sag = np.abs(np.array([data.joint(j).qpos[0] for j in joints]) - at)
    drift = float(np.linalg.norm(data.body(name).xpos - before))
    return bool(tilt < MOST_TILT and drift < MOST_DRIFT and (sag < MOST_SAG).all())


def drives(simulation: Simulation, robot: UrdfRobot) -> float:
    """m in the direction in which the robot looks at the start."""
    data = simulation.data
    start, ahead = np.array(data.body(robot.name).xpos), np.array(data.body(robot.name).xmat).reshape(3, 3)[:, 0]
    gone = 0.0
    for _ in range(round(MOST_DRIVE_SECONDS / ACTION_PERIOD)):
        simulation.robots.act(forward=0.5)
        gone = float((simulation.data.body(robot.name).xpos - start) @ ahead)
        if gone >= DISTANCE:
            break
    return gone
