"""`convert_robot`: a robot's URDF as MJCF, and next to it what MJCF does not keep of it: motors' limits, fixed links.

convert_robot("my_robot.urdf", "my_robot")      # my_robot/object.xml, meshes/, robot.json
"""

from __future__ import annotations

import os

from .base.description import ROBOT_CATEGORY
from .base.options import ConvertOptions, under_limits
from .base.outcome import ConversionOutcome
from .conversion import convert_object


@under_limits
def convert_robot(
    urdf: str | os.PathLike, out: str | os.PathLike, *, name: str | None = None, options: ConvertOptions | None = None
) -> ConversionOutcome:
    """Converts a robot as `convert_object` converts an object of category "agent", and writes `robot.json`.

    Args:
      out: folder for the result, replaced when everything went well.
      name: of the robot, default the URDF's, or the file's where that has none.

    Raises:
      InputError: naming the file and the element.
    """
    return convert_object(urdf, ROBOT_CATEGORY, out, model=name, options=options or ConvertOptions())
