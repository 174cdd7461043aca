"""`convert_robot`: a robot's URDF or MJCF as MJCF of one form, and next to it what MJCF does not keep of it.

convert_robot("my_robot.urdf", "my_robot")      # my_robot/object.xml, meshes/, robot.json
convert_robot("panda.xml", "panda")             # Menagerie style
"""

from __future__ import annotations

import os
import pathlib
from collections.abc import Sequence

from ig2mj.errors import InputError

from .base.description import ROBOT_CATEGORY
from .base.options import ConvertOptions, under_limits
from .base.outcome import ConversionOutcome
from .conversion import convert_object
from .reading.mjcf_grippers import Mounting

MJCF_ENDINGS = (".xml", ".mjcf")


@under_limits
def convert_robot(
    file: str | os.PathLike,
    out: str | os.PathLike,
    *,
    name: str | None = None,
    options: ConvertOptions | None = None,
    grippers: Sequence[Mounting] = (),
) -> ConversionOutcome:
    """Converts a robot as `convert_object` converts an object of category "agent", and writes `robot.json`.

    Args:
      file: URDF, or MJCF (`.xml`, `.mjcf`; see `convert_mjcf_robot`).
      out: folder for the result, replaced when everything went well.
      name: of the robot, default the one that the file gives, or the file's where that has none.
      grippers: MJCF files of grippers that are mounted on an arm of MJCF.

    Raises:
      InputError: naming the file and the element. UnknownNameError: the arm has no part of the name that a gripper is
        to be mounted on.
    """
    if pathlib.Path(file).suffix.lower() in MJCF_ENDINGS:
        from .convert_mjcf_robot import convert_mjcf_robot

        return convert_mjcf_robot(file, out, name=name, options=options, grippers=grippers)
    if grippers:
        raise InputError(file, "takes no gripper of another file", element="--gripper", fix="name an arm's MJCF")
    return convert_object(file, ROBOT_CATEGORY, out, model=name, options=options or ConvertOptions())
