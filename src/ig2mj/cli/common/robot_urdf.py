"""The options `--robot-urdf FILE` and `--robot-layout FILE` of several commands."""

from __future__ import annotations

import hashlib
import os
import pathlib
from typing import TYPE_CHECKING

from ig2mj.errors import Ig2mjError, InputError

if TYPE_CHECKING:
    from ig2mj.agents.urdf import UrdfRobot


def check_layout(urdf: pathlib.Path | None, layout: pathlib.Path | None) -> None:
    """Raises Ig2mjError for a layout without a robot."""
    if layout is not None and urdf is None:
        raise Ig2mjError("--robot-layout needs --robot-urdf")


def own_robot(urdf: pathlib.Path, layout: pathlib.Path | None, robot: str | None = None) -> UrdfRobot:
    """The robot of a URDF; converted on first use, and again when the file or its meshes have changed.

    Args:
      layout: assigns the joints; None: guessed from their names. robot: value of `--robot`, which must be None.

    Raises:
      Ig2mjError: there is a `--robot`, too. InputError, UnknownNameError: as the converter and `UrdfRobot.load`.
    """
    from ig2mj_converters.base.cache_folder import cache_folder
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.convert_robot import convert_robot

    from ig2mj.agents.urdf import UrdfRobot
    from ig2mj.cli.common.printing import add_bar, progress_bar

    if robot is not None:
        raise Ig2mjError("give either --robot or --robot-urdf")
    if not urdf.is_file():
        raise InputError(urdf, "is not a file", element="--robot-urdf", fix="name a robot's URDF")
    place = hashlib.blake2b(str(urdf.resolve()).encode(), digest_size=8).hexdigest()
    out = cache_folder("robots") / place / urdf.stem
    out.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar() as bar:
        report = add_bar(bar, f"converting {urdf.name}")
        convert_robot(urdf, out, options=ConvertOptions(report=False, jobs=os.cpu_count() or 1, progress=report))
    return UrdfRobot.load(out, layout)
