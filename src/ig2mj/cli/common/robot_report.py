"""What `ig2mj convert robot` and `ig2mj robots show` say of a converted robot, with a picture."""

from __future__ import annotations

import pathlib
import shutil

PICTURE = "robot.png"

HEAD = """\
# Which joints and links of the robot do what; ig2mj reads this file whenever it loads the folder.
# What a line does not say is found: delete a line to have it found, write [] or "" for none (docs/guide/robots.md).
"""


def write_layout(
    folder: pathlib.Path, given: pathlib.Path | None, former: tuple[str, bytes] | None, shown: pathlib.Path
) -> str:
    """Puts the layout into a folder that was just converted: the file given, else the one that was there before, else
    what is found.

    Args:
      former: name and content of the layout of an earlier conversion. shown: what the folder is called afterwards.

    Returns:
      One line about it. Raises InputError or UnknownNameError: it does not fit the robot, or the robot has legs.
    """
    from ig2mj.agents.urdf import UrdfRobot
    from ig2mj.agents.urdf.robot import LAYOUT_FILES

    if given is not None:
        UrdfRobot.load(folder, given)  # errors name the user's file
        place = folder / LAYOUT_FILES[1 if given.suffix.lower() == ".json" else 0]
        shutil.copyfile(given, place)
        return f"layout: {shown / place.name}, as {given} says"
    if former is not None:
        place = folder / former[0]
        place.write_bytes(former[1])
        UrdfRobot.load(folder)
        return f"layout: {shown / place.name}, kept from the earlier conversion"
    place = folder / LAYOUT_FILES[0]
    place.write_text(HEAD + UrdfRobot.load(folder, {}).layout.as_toml(), encoding="utf-8")
    return f"layout: {shown / place.name}, found; edit it to change what is below"


def tell_robot(folder: pathlib.Path, said: str = "", picture: pathlib.Path | None = None) -> None:
    """Prints what the layout assigns, and renders it into the folder, or into a file."""
    from ig2mj.agents.urdf import UrdfRobot
    from ig2mj.agents.urdf.summary import summary

    robot = UrdfRobot.load(folder)
    if said:
        print(f"  {said}")
    for what, value in summary(robot):
        print(f"  {what:<13} {value}")
    file = folder / PICTURE if picture is None else picture
    try:
        from ig2mj.viewer.robot_picture import robot_picture

        robot_picture(robot).save(file)
        print(f"  picture: {file}")
    except Exception as e:  # a machine without OpenGL converts robots, too
        print(f"  no picture: {e}")
