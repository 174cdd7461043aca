"""The bimanual humanoid of the paper's experiments (iGibson's BehaviorRobot)."""

from ig2mj.agents.humanoid.controller import HumanoidController, HumanoidState
from ig2mj.agents.humanoid.robot import Humanoid

__all__ = ["Humanoid", "HumanoidController", "HumanoidState"]
