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
from .base.options import ConvertOptions
from .base.outcome import Outcome
from .bodies.kinematics import link_poses
from .conversion import convert_object
from .reading.urdf import read_urdf

ROBOT_FILE = "robot.json"

FORMAT_VERSION = 1

CATEGORY = "agent"


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
    poses, moving = link_poses(source), {source.base: source.base}
    joints = {joint.child: joint for joint in source.joints.values()}

    def mover(link: str) -> str:
        if link not in moving:
            joint = joints[link]
            moving[link] = mover(joint.parent) if joint.type == "fixed" else link
        return moving[link]

    frames = {}
    for link in source.links:
        pose = np.linalg.inv(poses[mover(link)]) @ poses[link]
        frames[link] = {"on": mover(link), "pos": pose[:3, 3].round(9).tolist(), "axes": pose[:3, :3].round(9).tolist()}
    return {
        "format_version": FORMAT_VERSION,
        "name": source.model,
        "base": source.base,
        "joints": [
            {
                "name": joint.name,
                "type": joint.type,
                "parent": mover(joint.parent),
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
