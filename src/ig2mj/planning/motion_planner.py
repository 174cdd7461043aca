"""`MotionPlanner`: paths of a robot's base, hands and arm.

    planner = MotionPlanner(simulation.scene)
    plan = planner.plan_base(simulation.view, (1.0, -2.0))
    plan.points            # [N, 2] m, the first is where the robot is
    plan.reason            # "" or why there is no path

Axes: N points of a path, h and w cells of the map along y and x.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.host_rotations import quat_conjugate, quat_multiply, quat_rotate
from ig2mj.install_hint import pip_install_extra
from ig2mj.planning.arm_links import JOINT_SAMPLES, ArmWay, LinkSpheres
from ig2mj.planning.arms import ArmBody
from ig2mj.planning.bodies import Body, HoveringBody
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.clearance import Obstacles, PlacedPieces
from ig2mj.planning.footprint import BaseFootprint
from ig2mj.planning.free_floor import NEAR_GOAL, FreeFloor, Point
from ig2mj.planning.hand_collision import HandCollision
from ig2mj.planning.hand_way import HandWay
from ig2mj.planning.occupancy import Occupancy, door_objects
from ig2mj.planning.rrt_connect import is_installed
from ig2mj.planning.senses import grip_of, sense
from ig2mj.planning.steps import PlanningError
from ig2mj.scene.scene import Scene

FLOORS_KEPT = 8
"""Free floors that are kept with their fields."""

HAND_CHECKS = 4000
"""States of a hand that RRT-Connect looks at before it gives up."""


@dataclasses.dataclass(frozen=True, eq=False)
class BasePlan:
    """A path over the floor, or why there is none.

    Attributes:
      points: [N, 2] m, world frame; the first is the robot's position. yaw: rad, at the end; None: any.
      length: m. reason: "" for a path, "no_base": the goal is not free, "no_path": no path leads there.
      detail: the reason in words. doors: shut doors without which there would be a path.
    """

    points: Float[np.ndarray, "N 2"]
    yaw: float | None = None
    length: float = 0.0
    reason: str = ""
    detail: str = ""
    doors: tuple[str, ...] = ()


@dataclasses.dataclass(frozen=True, eq=False)
class HandPlan:
    """A path of a hand, or why there is none.

    Attributes:
      points: [N, 3] m, world frame, of the hand's grasp point; the first is where it is.
      quats: [N, 4] w-x-y-z, world frame, of the palm at each point; it turns evenly in between.
      length: m. reason: "" for a path, "no_base": the goal is out of the hand's reach from where the base stands,
        "no_grasp": the hand does not fit there, "no_path": no path leads there.
      detail: the reason in words. method: "straight", "via" or "rrt_connect".
    """

    points: Float[np.ndarray, "N 3"]
    quats: Float[np.ndarray, "N 4"]
    length: float = 0.0
    reason: str = ""
    detail: str = ""
    method: str = ""


@dataclasses.dataclass(frozen=True, eq=False)
class ArmPlan:
    """A path of an arm, or why there is none.

    Attributes:
      joints: [N, J] rad or m, of the joints `names`, in straight lines; the first is where they are.
      names: of the joints, from the base to the hand, as the scene names them.
      reason: "" for a path, "no_base": no posture brings the hand there from where the base stands, "no_grasp": in none
        of them the arm has room, "no_path": no path leads there.
      detail: the reason in words. method: "straight" or "rrt_connect".
    """

    joints: Float[np.ndarray, "N J"]
    names: tuple[str, ...]
    reason: str = ""
    detail: str = ""
    method: str = ""


class MotionPlanner:
    """Plans for one robot of a scene, in any world of any batch of it.

    Attributes:
      scene: with the robot. agent: its number.
    """

    def __init__(self, scene: Scene, agent: int = 0):
        self.scene, self.agent = scene, agent
        self.occupancy = Occupancy(scene)
        self._pieces = PlacedPieces(scene)
        self._floors: list[FreeFloor] = []

    def floor(
        self,
        view: PhysicsView,
        footprint: BaseFootprint | None = None,
        without: Collection[int] = (),
        world: int = 0,
    ) -> FreeFloor:
        """Where the robot can stand, next to the scene's other robots, too.

        Args:
          footprint: None: that of the robot as it stands. without: objects that do not count, such as what it holds.
        """
        footprint = footprint or BaseFootprint.of_robot(self.scene, view, self.agent, world)
        held = np.flatnonzero(np.asarray(view.held)[world].any(0)) if np.asarray(view.held).size else np.zeros(0, int)
        others = [k for k in range(len(self.scene.agents)) if k != self.agent]
        free, spare = self.occupancy.free(view, footprint, {*without, *held.tolist()}, world, others)
        for kept in self._floors:
            if np.array_equal(kept.spare, spare):
                return kept
        floor = FreeFloor(self.occupancy, free, spare)
        self._floors = [floor, *self._floors[: FLOORS_KEPT - 1]]
        return floor

    def obstacles(self, view: PhysicsView, without: Collection[int] = (), world: int = 0) -> Obstacles:
        """What hands keep clear of: pieces of everything but some objects."""
        return Obstacles(self.scene, view, world, without, self._pieces)

    def plan_base(
        self,
        view: PhysicsView,
        goal: Point,
        *,
        yaw: float | None = None,
        footprint: BaseFootprint | None = None,
        without: Collection[int] = (),
        world: int = 0,
    ) -> BasePlan:
        """A path of the base from where the robot is to a point of the floor.

        Args:
          view: with a world axis; `world` of it is planned in. goal: x and y, m. yaw: rad, at the end; None: any.
          footprint, without: see `floor`.

        Returns:
          The path. `reason` is "no_base" where the goal is not free, and "no_path" where no path leads there; then
          `doors` names shut doors that are in the way.
        """
        start = np.asarray(view.agent.base_pos)[world, self.agent, :2].astype(float)
        floor = self.floor(view, footprint, without, world)
        here = start[None]
        end = floor.nearest(goal, NEAR_GOAL)
        if end is None:
            return BasePlan(here, reason="no_base", detail=f"({goal[0]:.2f}, {goal[1]:.2f}) m is not free floor")
        way = floor.way(start, goal)
        if way is None:
            return self._blocked(view, here, goal, footprint, without, world)
        length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        return BasePlan(way, yaw, length)

    @functools.cached_property
    def _any_body(self) -> Body:
        robot: Any = self.scene.agents[self.agent]
        return body_of(self.scene, robot.controller(self.scene.tables, self.agent), self.agent)

    @functools.cached_property
    def _body(self) -> HoveringBody:
        """How the robot moves its hands."""
        name, body = self.scene.tables.agent_names[self.agent], self._any_body
        if not len(body.hands):
            raise PlanningError(f"robot '{name}' has no hands")
        if not isinstance(body, HoveringBody):
            raise PlanningError(
                f"the hand of robot '{name}' is on an arm: plan_arm plans its motion (the humanoid's hands float)"
            )
        return body

    def plan_hand(
        self,
        view: PhysicsView,
        goal: Sequence[float] | np.ndarray,
        *,
        hand: int = 0,
        quat: Sequence[float] | np.ndarray | None = None,
        without: Collection[int] = (),
        world: int = 0,
        checks: int = HAND_CHECKS,
        seed: int = 1,
    ) -> HandPlan:
        """A path of a floating hand, and of what it holds, clear of everything else; the base stays where it is.

        The straight line is tried first, then paths over via points, then RRT-Connect (`pip install "ig2mj[plan]"`).
        Collisions are MuJoCo's. What the hand is near to at the start or at the goal does not count within 5 cm of it.

        Args:
          view: with a world axis; `world` of it is planned in. goal: x, y and z of the grasp point, m, world frame.
          hand: of the robot's hands. quat: orientation of the palm at the goal, w-x-y-z, world frame; None: as it is.
          without: numbers of objects that do not count, such as what the hand is about to take hold of.
          checks, seed: of RRT-Connect: states that are looked at before it gives up, and its random numbers.

        Returns:
          The path; `HandPlan.reason` says why there is none.

        Raises:
          PlanningError: the robot has no such hand, or it is on an arm.
        """
        body = self._body
        if not 0 <= hand < len(body.hands):
            name = self.scene.tables.agent_names[self.agent]
            raise PlanningError(f"robot '{name}' has hands 0 to {len(body.hands) - 1}, not {hand}")
        senses = sense(view, self.agent, body.hands)
        start = grip_of(senses, hand, body.grips[hand])[world].astype(float)
        turn = senses.hand_quat[world, hand].astype(float)
        end = np.asarray(goal, float)
        last = turn if quat is None else np.asarray(quat, float) / np.linalg.norm(np.asarray(quat, float))
        here = HandPlan(start[None], turn[None])
        said = f"({end[0]:.2f}, {end[1]:.2f}, {end[2]:.2f}) m"
        shoulder = quat_rotate(senses.base_quat[world], body.shoulders[hand]) + senses.base_pos[world]
        if np.linalg.norm(end - shoulder) > body.reach:
            return dataclasses.replace(here, reason="no_base", detail=f"{said} is out of the hand's reach")
        collision = HandCollision(self.scene, view, int(body.hands[hand]), body.grips[hand], without, world)
        way = HandWay(collision, start, turn, end, last)
        if blocking := way.blocking:
            names = ", ".join(sorted({self._name_of_geom(g) for g in blocking}))
            return dataclasses.replace(here, reason="no_grasp", detail=f"the hand does not fit at {said}: {names}")
        found, method = way.find(checks, seed)
        if found is None:
            hint = "" if is_installed() else f" (RRT-Connect might find one: {pip_install_extra('plan')})"
            return dataclasses.replace(here, reason="no_path", detail=f"the hand has no path to {said}{hint}")
        points, quats = found[:, :3], way.turned(found[:, 3])
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return HandPlan(points, quats, length, method=method)

    def _name_of_geom(self, geom: int) -> str:
        tables = self.scene.tables
        owner = int(tables.geom_object[geom])
        return tables.object_names[owner] if owner >= 0 else "the robot itself"

    @functools.cached_property
    def _links(self) -> LinkSpheres:
        body = self._any_body
        assert isinstance(body, ArmBody)
        return LinkSpheres(self.scene, self.agent, body.model, with_hand=True)

    def plan_arm(
        self,
        view: PhysicsView,
        goal: Sequence[float] | np.ndarray,
        *,
        quat: Sequence[float] | np.ndarray | None = None,
        without: Collection[int] = (),
        world: int = 0,
        samples: int = JOINT_SAMPLES,
        seed: int = 0,
    ) -> ArmPlan:
        """A path of an arm, and of its open hand, in the space of its joints; the base stays where it is.

        Inverse kinematics begin at several postures. The straight path to each posture is tried, then RRT-Connect.

        Args:
          view: with a world axis; `world` of it is planned in. goal: x, y and z of the grasp point, m, world frame.
          quat: orientation of the palm at the goal, w-x-y-z, world frame; None: as it is.
          without: numbers of objects that do not count, such as what the hand is about to take hold of.
          samples, seed: of RRT-Connect: postures that are sampled before it gives up, and its random numbers.

        Returns:
          The path; `ArmPlan.reason` says why there is none.

        Raises:
          PlanningError: the robot has no arm that is planned.
        """
        body, tables = self._any_body, self.scene.tables
        name = tables.agent_names[self.agent]
        if not isinstance(body, ArmBody):
            lacks = "float: plan_hand plans their motion" if isinstance(body, HoveringBody) else "are on no planned arm"
            raise PlanningError(f"the hands of robot '{name}' {lacks}")
        senses = sense(view, self.agent, body.hands)
        base = senses.base_pos[world].astype(float), senses.base_quat[world].astype(float)
        q = np.asarray(view.agent.joint_pos)[world, body.model.joints].astype(float)
        end = np.asarray(goal, float)
        last = senses.hand_quat[world, 0].astype(float) if quat is None else np.asarray(quat, float)
        own = np.asarray(quat_rotate(quat_conjugate(base[1]), end - base[0]), float)
        here = ArmPlan(q[None], tuple(tables.agent_joint_names[j] for j in body.model.joints))
        said = f"({end[0]:.2f}, {end[1]:.2f}, {end[2]:.2f}) m"
        goals = body.model.solve(own, np.asarray(quat_multiply(quat_conjugate(base[1]), last)), q)
        if not len(goals):
            return dataclasses.replace(here, reason="no_base", detail=f"no posture brings the hand to {said}")
        way = ArmWay(body.model, self._links, base, self.obstacles(view, without, world))
        goals = np.array([g for g in goals if way.is_clear(g[None])])
        if not len(goals):
            return dataclasses.replace(here, reason="no_grasp", detail=f"the arm has no room with its hand at {said}")
        found, method = way.find(q, goals, samples, seed)
        if found is None:
            return dataclasses.replace(here, reason="no_path", detail=f"the arm has no path to {said}")
        return dataclasses.replace(here, joints=found, method=method)

    def _blocked(
        self,
        view: PhysicsView,
        here: Float[np.ndarray, "1 2"],
        goal: Point,
        footprint: BaseFootprint | None,
        without: Collection[int],
        world: int,
    ) -> BasePlan:
        """What keeps the robot from its goal: shut doors, where there is a path without them."""
        doors = [int(d) for d in door_objects(self.scene.tables) if d not in without]
        said = f"no path leads to ({goal[0]:.2f}, {goal[1]:.2f}) m"
        way = self.floor(view, footprint, {*without, *doors}, world).way(here[0], goal) if doors else None
        if way is None:
            return BasePlan(here, reason="no_path", detail=said)
        names = self.scene.tables.object_names

        def bars(door: int) -> bool:
            floor = self.floor(view, footprint, {*without, *doors} - {door}, world)
            return floor.way(here[0], goal) is None

        shut = tuple(names[d] for d in ([d for d in doors if bars(d)] or doors))
        return BasePlan(here, reason="no_path", detail=f"{said}: {', '.join(shut)} shut", doors=shut)
