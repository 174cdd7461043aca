"""Robots of one's own, from a URDF that the converter has turned into MJCF (`ig2mj convert robot`)."""

from ig2mj.agents.urdf.controller import UrdfController, UrdfState
from ig2mj.agents.urdf.description import Description
from ig2mj.agents.urdf.layout import Layout
from ig2mj.agents.urdf.robot import UrdfRobot

__all__ = ["Description", "Layout", "UrdfController", "UrdfRobot", "UrdfState"]
