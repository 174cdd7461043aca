"""Robots by name: one line for each. Names are known without importing any robot.

ig2mj.agents.register("rover", lambda: UrdfRobot.load("rover"))
env = ig2mj.make("PointNavigation", robot="rover")
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from typing import TYPE_CHECKING

from ig2mj.errors import EngineError, UnknownNameError

if TYPE_CHECKING:
    from ig2mj.agents.task_robot import TaskRobot

ROBOTS: dict[str, str | Callable[[], TaskRobot]] = {
    "humanoid": "ig2mj.agents.humanoid:Humanoid",
    "fetch": "ig2mj.agents.fetch:Fetch",
    "turtlebot": "ig2mj.agents.turtlebot:TurtleBot",
}
"""By name: a robot's class or a function that makes the robot, or where to import it from ("module:name")."""


def register(name: str, make: Callable[[], TaskRobot]) -> None:
    """Makes a robot known to `ig2mj.make` by a name.

    Args:
      make: its class, or a function without arguments that makes it: anything that is a `TaskRobot`, also a
        `UrdfRobot`.

    Raises:
      EngineError: the name is taken, or `make` cannot be called.
    """
    if name in ROBOTS:
        raise EngineError(f"robot '{name}' is already registered: choose another name")
    if not callable(make):
        raise EngineError(f"robot '{name}': register its class or a function that makes it, not {make!r}")
    ROBOTS[name] = make


def make_robot(name: str) -> TaskRobot:
    """The robot of a name, at its own start.

    Raises:
      UnknownNameError: no such robot. EngineError: what is registered makes something else.
    """
    from ig2mj.agents.task_robot import TaskRobot

    if name not in ROBOTS and name.lower().endswith(".urdf"):
        fix = f"in Python UrdfRobot.load('{name}'), on the command line --robot-urdf {name}"
        raise EngineError(f"robot '{name}' is a file, not a name: {fix}")
    if name not in ROBOTS:
        raise UnknownNameError("robot", name, ROBOTS)
    registered = ROBOTS[name]
    robot = (pkgutil.resolve_name(registered) if isinstance(registered, str) else registered)()
    if not isinstance(robot, TaskRobot):
        raise EngineError(f"robot '{name}' is a {type(robot).__name__}: derive it from ig2mj.agents.TaskRobot")
    return robot
