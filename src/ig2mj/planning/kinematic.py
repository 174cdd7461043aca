"""`KinematicRung`: the motion of every primitive is planned and checked as in physics, then its result is set.

The programs of `ig2mj.planning.primitives` are followed without time: the base is where a way ends, the hand where its
way ends, and what the hand takes hold of goes along. What a placed object does when it is let go is physics for a
moment; everything else that a primitive makes true is set by the samplers of `ig2mj.sampling`, as on the symbolic rung.
Failures have the reasons of the physics rung, but for those of execution: nothing slips, and no time passes.

Worlds are carried out one after another, in one world of the scene with the robot. Axes: H hands of the robot.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.engine.snapshot import Snapshot
from ig2mj.geometry.host_rotations import quat_conjugate, quat_multiply, quat_rotate, quat_rotate_inverse, yaw_quat
from ig2mj.planning.arms import ArmBody
from ig2mj.planning.bodies import HoveringBody
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.kinematic_stage import KinematicStage, Pose
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.moves import Program
from ig2mj.planning.opened_wide import opened_wide
from ig2mj.planning.phases import Base, Phase, Until
from ig2mj.planning.primitives import primitive
from ig2mj.planning.problem import Problem, start_of
from ig2mj.planning.pushing import BEHIND, PRESS, borne_by
from ig2mj.planning.senses import Senses
from ig2mj.planning.starts import open_doors, scene_with_robot
from ig2mj.planning.steps import Outcome, PlanningError, Step
from ig2mj.planning.symbolic import SymbolicRung
from ig2mj.planning.world import PlannedWorld
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import RowSampler
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.pool import Pool

MOST_PROGRAMS = 60
"""Programs of one primitive, after which it fails with "timeout"."""

SETTLE = 2.0
"""Simulated s within which an object that was let go comes to rest."""


@dataclasses.dataclass
class _Robot:
    """Where the robot of one world is: its base (x, y in m, yaw in rad), its hands' frames, world frame, and what they
    hold, with its pose in the hand's frame. joints: of the arm that carries the hand; None: hands float."""

    xy: Float[np.ndarray, "2"]
    yaw: float
    hands: list[Pose]
    held: list[str]
    grasps: list[Pose | None]
    rise: float = 0.0
    joints: Float[np.ndarray, "J"] | None = None


@dataclasses.dataclass(eq=False)
class _KinematicWorld(PlannedWorld):
    """A world in which hands hold what the rung says."""

    robot: _Robot | None = None

    @property
    def senses(self) -> Senses:
        senses = super().senses
        assert self.robot is not None
        held = np.zeros_like(senses.held)
        for hand, name in enumerate(self.robot.held):
            if name:
                held[0, hand, self.index(name)] = True
        return dataclasses.replace(senses, held=held)


class KinematicRung:
    """Primitives whose motion is planned and checked as in physics, and whose result is set; no time passes.

    Its methods: `ig2mj.planning.rung.Rung`.

    Attributes:
      domain: constants, as primitives see them. body: how programs move the robot.
    """

    name = "kinematic"

    def __init__(
        self,
        domain: Domain,
        stage: KinematicStage,
        sampler: RowSampler,
        starts: Sequence[tuple[Snapshot, ExtendedStates]],
        seed: int = 0,
        first: int = 0,
        query: SceneQuery | None = None,
        planner: MotionPlanner | None = None,
    ):
        """
        Args:
          domain: of the bare scene. stage: of the scene with the robot.
          sampler, starts, seed, first: see `SymbolicRung`.
          query: a world of the scene with the robot to sample spots in; None: a new one. planner: of that scene.

        Raises:
          PlanningError: the robot has no hands that planned motion can move.
        """
        body = body_of(stage.scene, stage.controller)
        if not isinstance(body, HoveringBody | ArmBody):
            name = stage.scene.tables.agent_names[0]
            raise PlanningError(f"motion of the hands of robot '{name}' cannot be planned (the humanoid's can)")
        self.body, self.domain = body, Domain(stage.model, len(body.hands), body.lifts)
        self._stage, self._seed, self._first = stage, seed, first
        self._query = query or SceneQuery(stage.scene)
        self._planner = planner or MotionPlanner(stage.scene)
        self._symbolic = SymbolicRung(domain, sampler, starts, seed, first)
        self._sampler = sampler
        self._bare = domain
        self._steps: list[Step | None] = [None] * len(starts)
        self._count = [0] * len(starts)
        stage.load(*starts[0])
        agent = stage.view.agent
        self._height = float(np.asarray(agent.base_pos)[0, 0, 2])
        self._rest = [
            (np.asarray(agent.hand_pos)[0, h].astype(float), np.asarray(agent.hand_quat)[0, h].astype(float))
            for h in body.hands
        ]
        self._origin = np.asarray(agent.base_pos)[0, 0].astype(float), np.asarray(agent.base_quat)[0, 0].astype(float)
        self._arm_names: list[str] = []
        self._arm_start: Float[np.ndarray, "J"] | None = None
        if isinstance(body, ArmBody):
            self._arm_names = [stage.scene.tables.agent_joint_names[j] for j in body.model.joints]
            self._arm_start = np.asarray(agent.joint_pos)[0, body.model.joints].astype(float)
        self._robots = [self._at_start() for _ in starts]

    def _at_start(self) -> _Robot:
        pos, quat = self._origin
        count = len(self.body.hands)
        yaw = float(np.arctan2(2 * quat[0] * quat[3], 1 - 2 * quat[3] ** 2))
        joints = None if self._arm_start is None else self._arm_start.copy()
        return _Robot(pos[:2].copy(), yaw, list(self._rest), [""] * count, [None] * count, joints=joints)

    @property
    def num_worlds(self) -> int:
        return len(self._steps)

    def facts(self, world: int) -> Facts:
        return self._symbolic.facts(world)

    def begin(self, world: int, step: Step) -> None:
        self._steps[world] = self.domain.meant(step)

    def ended(self, world: int) -> str | None:
        return None

    def advance(self) -> dict[int, Outcome]:
        return {w: self._carry_out(w, step) for w, step in enumerate(self._steps) if step is not None}

    def _carry_out(self, world: int, step: Step) -> Outcome:
        self._steps[world] = None
        self._count[world] += 1
        began = time.process_time()
        if lacking := self._symbolic.lacking(world, step):
            return Outcome("no_grasp", lacking)
        self._show(world)
        planned = self._planned(world)
        running, reason = primitive(planned, step), None
        outcome = Outcome("timeout", f"{MOST_PROGRAMS} motions were not enough")
        for _ in range(MOST_PROGRAMS):
            try:
                program = next(running) if reason is None else running.send(reason)
            except StopIteration as end:
                outcome = end.value
                break
            reason = self._follow(world, program, step)
        running.close()
        return dataclasses.replace(outcome, planning=time.process_time() - began)

    def _planned(self, world: int) -> _KinematicWorld:
        """A world as primitives see it."""
        rng = np.random.default_rng([self._seed, self._first + world, self._count[world]])
        planned = _KinematicWorld(self._stage, self.body, self.domain, self._planner, self._query, 0, rng)
        planned.robot = self._robots[world]
        return planned

    def _show(self, world: int) -> None:
        """Puts the household and the robot where they are in a world."""
        robot = self._robots[world]
        self._stage.load(*self._symbolic.state(world))
        held = [
            (name, _of(robot.hands[h], grasp))
            for h, (name, grasp) in enumerate(zip(robot.held, robot.grasps, strict=True))
            if name and grasp is not None
        ]
        arm = None if robot.joints is None else (self._arm_names, robot.joints)
        self._stage.put(self._base(robot), robot.hands, held, arm)

    def _base(self, robot: _Robot) -> Pose:
        return np.array([*robot.xy, self._height + robot.rise]), yaw_quat(robot.yaw)

    def _follow(self, world: int, program: Program, step: Step) -> str:
        """What a program does; the reason why it failed."""
        reason, acts = "", False
        for phase in self.body.prepared(program):
            self._move_base(world, phase)
            if phase.hand >= 0:
                acts = True
                reason = self._move_hand(world, phase, step) or reason
        if acts and not reason and not step.primitive.startswith("place_") and step.adds:
            wrong = [a for a in step.adds if self.facts(world).holds(a.predicate, *a.arguments) != a.value]
            if wrong and self._symbolic.make_true(world, step) is not None:
                reason = "not_true_after"
            elif wrong and step.primitive == "open":
                self._open_wide(world, step.object)
        self._show(world)
        return reason

    def _move_base(self, world: int, phase: Phase) -> None:
        """Base, hands and what they hold go along."""
        robot = self._robots[world]
        xy, yaw = robot.xy, robot.yaw
        if phase.base in (Base.DRIVE, Base.SHIFT):
            xy = np.array(phase.xy)
        if phase.base in (Base.TURN, Base.SHIFT):
            yaw = phase.yaw
        before = self._base(robot)
        robot.xy, robot.yaw = xy, yaw
        robot.rise = robot.rise if phase.rise is None else phase.rise
        robot.hands = [_of(self._base(robot), _in(before, hand)) for hand in robot.hands]

    def _move_hand(self, world: int, phase: Phase, step: Step) -> str:
        robot, hand = self._robots[world], phase.hand
        base, before = self._base(robot), robot.hands[hand][0]
        if phase.reset:
            robot.hands[hand] = _of(base, _in(self._origin, self._rest[hand]))
        if phase.pos is not None or phase.quat is not None:
            pos, quat = robot.hands[hand]
            grip = pos + quat_rotate(quat, self.body.grips[hand])
            if phase.quat is not None:
                quat = np.array(phase.quat) if not phase.in_body else quat_multiply(base[1], np.array(phase.quat))
            if phase.pos is not None:
                grip = np.array(phase.pos) if not phase.in_body else base[0] + quat_rotate(base[1], np.array(phase.pos))
            if robot.joints is not None and (lost := self._carry_hand(robot, grip, quat, phase)):
                return lost
            if robot.joints is None:
                robot.hands[hand] = grip - quat_rotate(quat, self.body.grips[hand]), quat
        if phase.until == Until.HELD:
            return self._take(world, hand, phase.object, step)
        if phase.until == Until.THERE and phase.object >= 0:
            self._push(world, phase.object, robot.hands[hand][0] - before)
        for other in range(len(robot.hands)) if phase.both else (hand,):
            if other != hand:
                pos, quat = robot.hands[other]
                robot.hands[other] = pos + robot.hands[hand][0] - before, quat
            if phase.close is False and robot.held[other]:
                self._let_go(world, other)
        return ""

    def _carry_hand(self, robot: _Robot, grip: np.ndarray, quat: np.ndarray, phase: Phase) -> str:
        """Moves the arm so that its hand's grasp point comes to a pose of the world; the reason why it does not."""
        body = self.body
        assert isinstance(body, ArmBody) and robot.joints is not None
        base = self._base(robot)
        goal, turn = _in(base, (np.asarray(grip, float), np.asarray(quat, float)))
        ways = body.model.follow(robot.joints, goal[None], turn[None])
        found = body.model.solve(goal, turn, robot.joints) if ways is None else ways[-1:]
        if not len(found):
            return phase.after and "no_path"
        robot.joints = np.asarray(found[0], float)
        point, own = body.model.hand(robot.joints[None])
        at, turned = _of(base, (point[0], own[0]))
        robot.hands[phase.hand] = at - quat_rotate(turned, body.grips[phase.hand]), turned
        return ""

    def _take(self, world: int, hand: int, index: int, step: Step) -> str:
        """Takes an object; of one that is fixed, a joint is opened, unless the step is to close it."""
        robot, tables = self._robots[world], self.domain.model.tables
        name = tables.object_names[index]
        if self.domain.fixed(name):
            if step.primitive == "close" and step.object == name:
                failed = self._symbolic.make_true(world, step, [Condition("open", (name,), False)])
                return "" if failed is None else "not_true_after"
            pos, quat = robot.hands[hand]
            self._open_wide(world, name, pos + quat_rotate(quat, self.body.grips[hand]))
            return "" if self.facts(world).holds("open", name) else "not_true_after"
        query = self._symbolic.show(world)
        pos, quat = (np.asarray(a)[0, index].astype(float) for a in (query.view.object_pos, query.view.object_quat))
        robot.held[hand], robot.grasps[hand] = name, _in(robot.hands[hand], (pos, quat))
        if robot.held.count(name) == 1:
            self._symbolic.hold(world, name)
        return ""

    def _push(self, world: int, index: int, stroke: Float[np.ndarray, "3"]) -> None:
        """Moves an object, and what it bears, by the part of a hand's stroke (m, world frame) that it is to go.
        Everything comes to rest."""
        query, planned = self._symbolic.show(world), self._planned(world)
        length = float(np.linalg.norm(stroke))
        way = max(length - BEHIND - PRESS, 0.0) / max(length, 1e-9) * stroke * (1.0, 1.0, 0.0)
        name = self.domain.model.tables.object_names[index]
        for other in (name, *borne_by(planned, name)):
            k = self._bare.index(other)
            pos, quat = (np.asarray(a)[0, k].astype(float) for a in (query.view.object_pos, query.view.object_quat))
            query.place(k, pos + way, quat)
        query.settle(SETTLE)
        self._symbolic.put(world, query.save())

    def _open_wide(self, world: int, name: str, hand: Float[np.ndarray, "3"] | None = None) -> None:
        """Opens what a hand is at (None: what has been opened) as wide as a hand does, if it stays so."""
        physics = opened_wide(self._symbolic.show(world), self._bare.index(name), hand)
        if physics is not None:
            self._symbolic.put(world, physics)

    def _let_go(self, world: int, hand: int) -> None:
        """Lets go of what a hand holds; it comes to rest."""
        robot = self._robots[world]
        name, grasp = robot.held[hand], robot.grasps[hand]
        assert grasp is not None
        robot.held[hand], robot.grasps[hand] = "", None
        if name in robot.held:  # another hand holds it still
            return
        query = self._symbolic.show(world)
        query.place(self.domain.index(name), *_of(robot.hands[hand], grasp))
        query.settle(SETTLE)
        self._symbolic.let_go(world, name, query.save())


def _of(frame: Pose, pose: Pose) -> Pose:
    """A pose that is given in a frame, in the frame's parent."""
    return frame[0] + quat_rotate(frame[1], pose[0]), quat_multiply(frame[1], pose[1])


def _in(frame: Pose, pose: Pose) -> Pose:
    """A pose, seen from a frame with the same parent."""
    return quat_rotate_inverse(frame[1], pose[0] - frame[0]), quat_multiply(quat_conjugate(frame[1]), pose[1])


def kinematic_episodes(
    domain: Domain,
    problem: Problem,
    pool: Pool | None,
    numbers: Sequence[int],
    robot: str = "humanoid",
    seed: int = 0,
    doors_open: bool = True,
) -> Iterator[tuple[int, KinematicRung]]:
    """Rungs of one world each, one after another, with the number of each episode.

    Args:
      pool: start states; an episode without a row of its own is left out. None: the scene at rest.
      numbers: of the episodes. robot: which one. seed: see `SymbolicRung`.
      doors_open: doors between rooms that the problem does not name stand open.

    Raises:
      As `scene_with_robot`; PlanningError: the robot's hands cannot be moved by planned motion.
    """
    scene = scene_with_robot(problem, robot, pool)
    sampler, stage, query = make_sampler(problem.scene), KinematicStage(scene), SceneQuery(scene)
    planner = MotionPlanner(scene)
    write = open_doors(problem.scene, problem.named) if doors_open else None
    own = sampler.start
    for number in numbers:
        if pool is not None and number >= pool.size:
            continue
        physics, states = own if pool is None else start_of(pool, number)
        if write is not None:
            sampler.query.load(physics)
            sampler.query.write(write)
            sampler.query.settle(SETTLE)
            physics = sampler.query.save()
        yield number, KinematicRung(domain, stage, sampler, [(physics, states)], seed, number, query, planner)
