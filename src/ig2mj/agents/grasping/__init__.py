"""Assistive grasping: what a hand can take hold of, when it does, and when it lets go."""

from ig2mj.agents.grasping.grasp import MODES, Grasping, GraspState
from ig2mj.agents.hand_rays import HandRays

__all__ = ["MODES", "GraspState", "Grasping", "HandRays"]
