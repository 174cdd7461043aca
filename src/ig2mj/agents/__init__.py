"""Robots: their bodies, their controllers and assistive grasping. Everything at run time is pure and batched."""

from ig2mj.agents.base import Controller, Robot
from ig2mj.agents.floating_hand import FloatingHand

__all__ = ["Controller", "FloatingHand", "Robot"]
