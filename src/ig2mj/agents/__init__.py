"""Robots: their bodies, their controllers and assistive grasping. Everything at run time is pure and batched."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ig2mj.agents.base import Controller, Robot
    from ig2mj.agents.fetch import Fetch
    from ig2mj.agents.floating_hand import FloatingHand
    from ig2mj.agents.humanoid import Humanoid
    from ig2mj.agents.registry import register
    from ig2mj.agents.task_robot import HandControl, TaskRobot
    from ig2mj.agents.turtlebot import TurtleBot
    from ig2mj.agents.urdf import UrdfRobot

__all__ = [
    "Controller",
    "Fetch",
    "FloatingHand",
    "HandControl",
    "Humanoid",
    "Robot",
    "TaskRobot",
    "TurtleBot",
    "UrdfRobot",
    "register",
]

_HOME = {
    "Controller": "ig2mj.agents.base",
    "Fetch": "ig2mj.agents.fetch",
    "FloatingHand": "ig2mj.agents.floating_hand",
    "HandControl": "ig2mj.agents.task_robot",
    "Humanoid": "ig2mj.agents.humanoid",
    "Robot": "ig2mj.agents.base",
    "TaskRobot": "ig2mj.agents.task_robot",
    "TurtleBot": "ig2mj.agents.turtlebot",
    "UrdfRobot": "ig2mj.agents.urdf",
    "register": "ig2mj.agents.registry",
}


def __getattr__(name: str) -> Any:
    """Imports the public names when they are first used: names of robots are known without MuJoCo and JAX."""
    from ig2mj.process.public_names import public_name

    return public_name("ig2mj.agents", name, _HOME)
