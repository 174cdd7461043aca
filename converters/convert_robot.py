"""`convert_robot`: a robot's URDF as MJCF, and beside it what MJCF does not keep of it: motors' limits, fixed links.

convert_robot("my_robot.urdf", "my_robot")      # my_robot/object.xml, meshes/, robot.json
"""

from __future__ import annotations

import json
import os
import pathlib
from typing import Any

import numpy as np

from .base.description import ObjectModel
from .base.options import ConvertOptions, under_limits
from .base.outcome import Outcome
from .bodies.kinematics import link_poses
from .conversion import convert_object
from .reading.urdf import read_urdf

ROBOT_FILE = "robot.json"

FORMAT_VERSION = 1

CATEGORY = "agent"


@under_limits
def convert_robot(
    urdf: str | os.PathLike, out: str | os.PathLike, *, name: str | None = None, options: ConvertOptions | None = None
) -> Outcome:
    """Converts a robot as `convert_object` converts an object, and writes `robot.json`.

    Args:
      out: folder for the result, replaced when everything went well. name: of the robot, default the file's.

    Raises:
      InputError: naming the file and the element.
    """
    options = options or ConvertOptions()
    file = pathlib.Path(urdf)
    outcome = convert_object(file, CATEGORY, out, model=name, options=options)
    source = read_urdf(
        file, CATEGORY, name or file.stem, mesh_root=options.mesh_root, package_path=options.package_path
    )
    (pathlib.Path(out) / ROBOT_FILE).write_text(json.dumps(_described(source), indent=1), encoding="utf-8")
    return outcome


def _described(source: ObjectModel) -> dict[str, Any]:
    """Joints that move with their motors' limits (N m or N, rad/s or m/s), and where links are that are fixed to
    others: position (m) and quaternion (w-x-y-z) in the link that moves them."""
    poses = link_poses(source)
    joints = {joint.child: joint for joint in source.joints.values()}
    moving: dict[str, str] = {}
    for link in poses:  # parents come before their children
        joint = joints.get(link)
        moving[link] = moving[joint.parent] if joint is not None and joint.type == "fixed" else link

    frames = {}
    for link in source.links:
        pose = np.linalg.inv(poses[moving[link]]) @ poses[link]
        place = {"pos": pose[:3, 3].round(9).tolist(), "axes": pose[:3, :3].round(9).tolist()}
        frames[link] = {"on": moving[link], **place}
    return {
        "format_version": FORMAT_VERSION,
        "name": source.model,
        "base": source.base,
        "joints": [
            {
                "name": joint.name,
                "type": joint.type,
                "parent": moving[joint.parent],
                "child": joint.child,
                "effort": joint.effort or 0.0,
                "velocity": joint.velocity or 0.0,
                "mimics": None if joint.mimic is None else joint.mimic.joint,
            }
            for joint in source.joints.values()
            if joint.type != "fixed"
        ],
        "frames": frames,
    }
