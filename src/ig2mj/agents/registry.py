"""Robots by name: one line for each. Names are known without importing any robot.

ig2mj.agents.register("rover", lambda: UrdfRobot.load("rover"))
env = ig2mj.make("PointNavigation", robot="rover")

A folder that `ig2mj convert robot` wrote takes the place of a name: `robot="robots/rover"`.
"""

from __future__ import annotations

import os
import pathlib
import pkgutil
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.plugins import Registry, source_of_caller

if TYPE_CHECKING:
    from ig2mj.agents.task_robot import TaskRobot

OWN: dict[str, str] = {
    "humanoid": "ig2mj.agents.humanoid:Humanoid",
    "fetch": "ig2mj.agents.fetch:Fetch",
    "turtlebot": "ig2mj.agents.turtlebot:TurtleBot",
}
"""Where to import the class of each of ig2mj's robots from ("module:name")."""

ROBOTS: Registry[Any] = Registry(
    "robot", "a robot's class, or a function without arguments that makes a robot,", callable, OWN, pattern=r"[\w.-]+"
)
"""By name: a robot's class or a function that makes the robot; `OWN`, and those of plug-ins."""


def register(name: str, make: Callable[[], TaskRobot]) -> None:
    """Makes a robot known to `ig2mj.make` by a name.

    Args:
      make: its class, or a function without arguments that makes it: anything that is a `TaskRobot`, also a
        `UrdfRobot`.

    Raises:
      EngineError: the name is taken, or `make` cannot be called. PluginError: it is no name.
    """
    if name in ROBOTS:
        raise EngineError(f"robot '{name}' is already registered: choose another name")
    if not callable(make):
        raise EngineError(f"robot '{name}': register its class or a function that makes it, not {make!r}")
    ROBOTS.add(name, make, source_of_caller())


def is_robot_folder(value: str | os.PathLike) -> bool:
    """A folder that `ig2mj convert robot` wrote."""
    return (pathlib.Path(value) / "robot.json").is_file()


def check_robot(value: str) -> None:
    """Raises EngineError or UnknownNameError where a text is neither a robot's name nor its folder."""
    if value in ROBOTS or is_robot_folder(value):
        return
    file = pathlib.Path(value)
    for ending, option in ((".urdf", "--robot-urdf"), (".xml", "--robot-mjcf"), (".mjcf", "--robot-mjcf")):
        if file.suffix.lower() == ending:
            fix = f"in Python UrdfRobot.load('{value}'), on the command line {option} {value}"
            if option == "--robot-mjcf":
                fix = f"`ig2mj convert robot` makes a folder of it, on the command line {option} {value}"
            raise EngineError(f"robot '{value}' is a file, not a name: {fix}")
    if file.is_dir() or file.name != value:
        problem = f"robot '{value}' is neither a name ({', '.join(ROBOTS)}) nor a folder with robot.json"
        raise EngineError(f"{problem}: `ig2mj convert robot` writes such folders")
    raise UnknownNameError("robot", value, ROBOTS, also="a folder that `ig2mj convert robot` wrote is one, too")


def find_robot(robot: str | TaskRobot) -> tuple[str, TaskRobot]:
    """A robot and its name. robot: a name of the registry, a folder of a converted robot, or the robot itself.

    Raises:
      As `make_robot`.
    """
    if not isinstance(robot, str):
        if not hasattr(robot, "attach"):
            raise EngineError(f"robot = {robot!r}: a name, a folder, or a robot is expected")
        return robot.name, robot
    body = make_robot(robot)
    return (body.name if is_robot_folder(robot) else robot), body


def robot_name(value: str) -> str:
    """The name that a robot of the registry, or the one of a folder, has in environments."""
    return find_robot(value)[0] if is_robot_folder(value) else value


def make_robot(name: str) -> TaskRobot:
    """The robot of a name, or of a folder that `ig2mj convert robot` wrote, at its own start.

    Raises:
      UnknownNameError: no such robot. EngineError: what is registered makes something else. InputError: the folder is
        broken, or its robot has legs.
    """
    from ig2mj.agents.task_robot import TaskRobot

    check_robot(name)
    if is_robot_folder(name):
        from ig2mj.agents.urdf.robot import UrdfRobot

        return UrdfRobot.load(name)
    registered = ROBOTS[name]
    robot = (pkgutil.resolve_name(registered) if isinstance(registered, str) else registered)()
    if not isinstance(robot, TaskRobot):
        raise EngineError(f"robot '{name}' is a {type(robot).__name__}: derive it from ig2mj.agents.TaskRobot")
    return robot
