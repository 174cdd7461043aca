"""The options `--robot-urdf FILE`, `--robot-mjcf FILE` and `--robot-layout FILE`, and folders as values of `--robot`.

A file is converted on first use, and again when it or its meshes have changed, into a folder of the cache. Commands
then know the robot by its folder, as if `--robot FOLDER` had been given, so that jobs in other processes find it, too.
"""

from __future__ import annotations

import dataclasses
import hashlib
import pathlib
import shutil
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.errors import Ig2mjError, InputError
from ig2mj.process.processors import available

if TYPE_CHECKING:
    from ig2mj.agents.urdf import UrdfRobot

File = Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")]


@dataclasses.dataclass(frozen=True)
class OwnRobot:
    """A robot of your own.

    Attributes:
      robot_urdf: URDF of a robot of your own, in place of --robot (docs/guide/robots.md).
      robot_mjcf: MJCF of a robot of your own, in place of --robot.
      robot_layout: TOML or JSON file that assigns its joints to base, arm and gripper; default: found from its shape
        and names.
    """

    robot_urdf: File = None
    robot_mjcf: File = None
    robot_layout: File = None

    @property
    def given(self) -> bool:
        """A file of a robot is."""
        return self.robot_urdf is not None or self.robot_mjcf is not None


Own = Annotated[OwnRobot, tyro.conf.OmitArgPrefixes]

NONE = OwnRobot()


def choose_robot(robot: str | None, own: OwnRobot = NONE) -> str | None:
    """What `--robot` and the options of one's own robot name: a name of the registry, a folder, or None: nothing.

    Raises:
      Ig2mjError: options exclude each other. UnknownNameError, EngineError: there is no such robot. InputError: a file
        cannot be converted, or the layout does not fit.
    """
    from ig2mj.agents.registry import check_robot, is_robot_folder

    named = {"--robot": robot, "--robot-urdf": own.robot_urdf, "--robot-mjcf": own.robot_mjcf}
    chosen = [option for option, value in named.items() if value is not None]
    if len(chosen) > 1:
        raise Ig2mjError(f"give either {' or '.join(chosen)}")
    for option, file in (("--robot-urdf", own.robot_urdf), ("--robot-mjcf", own.robot_mjcf)):
        if file is not None:
            return str(_converted(file, own.robot_layout, option))
    if robot is not None and robot != "hand":
        check_robot(robot)
    if own.robot_layout is None:
        return robot
    if robot is None or not is_robot_folder(robot):
        raise Ig2mjError("--robot-layout needs --robot-urdf, --robot-mjcf or --robot FOLDER")
    return str(_with_layout(pathlib.Path(robot), own.robot_layout))


def own_robot(robot: str | None, own: OwnRobot) -> UrdfRobot | None:
    """The robot itself, of a file or of a folder; None: none is given. Raises as `choose_robot`, and as
    `UrdfRobot.load`."""
    from ig2mj.agents.urdf import UrdfRobot

    folder = choose_robot(robot, own)
    return None if folder is None else UrdfRobot.load(folder)


def _converted(file: pathlib.Path, layout: pathlib.Path | None, option: str) -> pathlib.Path:
    """The cache's folder of a file, up to date, with the layout."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.convert_robot import convert_robot

    from ig2mj.cli.common.printing import add_bar, progress_bar

    kind = "URDF" if option == "--robot-urdf" else "MJCF"
    if not file.is_file():
        raise InputError(file, "is not a file", element=option, fix=f"name a robot's {kind}")
    ending = file.suffix.lower()
    if (ending == ".urdf") != (kind == "URDF"):
        other = "--robot-mjcf" if kind == "URDF" else "--robot-urdf"
        if ending in (".urdf", ".xml", ".mjcf") and not (kind == "URDF" and ending == ".xml"):
            raise InputError(file, f"is no {kind}", element=option, fix=f"{other} takes it")
    out = _place(file, layout) / file.stem
    with progress_bar() as bar:
        report = add_bar(bar, f"converting {file.name}")
        convert_robot(file, out, options=ConvertOptions(report=False, jobs=available(), progress=report))
    _put_layout(out, layout)
    return out


def _with_layout(folder: pathlib.Path, layout: pathlib.Path) -> pathlib.Path:
    """A copy of a converted robot in the cache, with another layout."""
    out = _place(folder, layout) / folder.resolve().name
    shutil.copytree(folder, out, dirs_exist_ok=True)
    _put_layout(out, layout)
    return out


def _place(source: pathlib.Path, layout: pathlib.Path | None) -> pathlib.Path:
    """A folder of the cache, for this source and the content of this layout."""
    from ig2mj_converters.base.cache_folder import cache_folder

    named = str(source.resolve()).encode()
    if layout is not None:
        if not layout.is_file():
            raise InputError(layout, "is not a file", element="--robot-layout", fix="name a TOML or JSON file")
        named += b"\0" + layout.read_bytes()
    place = cache_folder("robots") / hashlib.blake2b(named, digest_size=8).hexdigest()
    place.mkdir(parents=True, exist_ok=True)
    return place


def _put_layout(folder: pathlib.Path, layout: pathlib.Path | None) -> None:
    """Puts a layout into a converted robot's folder, where it fits; without one there is none."""
    from ig2mj.agents.urdf import UrdfRobot
    from ig2mj.agents.urdf.robot import LAYOUT_FILES

    if layout is None:
        return
    UrdfRobot.load(folder, layout)  # errors name the user's file
    for name in LAYOUT_FILES:
        (folder / name).unlink(missing_ok=True)
    json = layout.suffix.lower() == ".json"
    shutil.copyfile(layout, folder / LAYOUT_FILES[1 if json else 0])
