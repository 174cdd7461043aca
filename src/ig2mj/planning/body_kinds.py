"""Which class of `ig2mj.planning.bodies` moves a robot (`body_of`)."""

from __future__ import annotations

from ig2mj.agents.base import Controller
from ig2mj.planning.arm_kinds import arm_of
from ig2mj.planning.arms import ArmBody
from ig2mj.planning.bodies import Body, HoveringBody, WheeledBody
from ig2mj.planning.steps import PlanningError
from ig2mj.scene.scene import Scene


def body_of(scene: Scene, controller: Controller, agent: int = 0) -> Body:
    """How programs move a robot of a scene.

    Raises:
      PlanningError: its base neither hovers nor drives.
    """
    names = tuple(controller.action_names)
    if "body_x" in names:
        return HoveringBody(scene, controller, agent)
    if {"forward", "turn_left"} <= set(names):
        arm = arm_of(scene, controller, agent)
        return WheeledBody(scene, controller, agent) if arm is None else ArmBody(scene, controller, agent, *arm)
    name = scene.tables.agent_names[agent]
    raise PlanningError(f"robot '{name}' has no base that moves: primitives take one that drives or hovers")
