"""Robots: their bodies, their controllers and assistive grasping. Everything at run time is pure and batched."""

from ig2mj.agents.base import Controller, Robot
from ig2mj.agents.fetch import Fetch
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.agents.humanoid import Humanoid
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.agents.urdf import UrdfRobot
from ig2mj.process.public_names import offer_modules

__all__ = ["Controller", "Fetch", "FloatingHand", "Humanoid", "Robot", "TurtleBot", "UrdfRobot"]

offer_modules(__name__)
