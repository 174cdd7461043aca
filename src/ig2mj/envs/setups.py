"""Parts of an environment by kind of task: home with robots, start states, objective, actions."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Callable

import numpy as np

from ig2mj.agents.base import ACTION_PERIOD, Controller, Robot
from ig2mj.agents.registry import ROBOTS, find_robot, make_robot
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.envs.environment import Companions
from ig2mj.errors import EngineError
from ig2mj.planning.problem import start_of
from ig2mj.planning.starts import start_place
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.tasks.actions import ActionMap, hand_actions, robot_actions, whole_actions
from ig2mj.tasks.activity_objective import ActivityObjective
from ig2mj.tasks.bddl.goal import conditions
from ig2mj.tasks.bddl.objective import BddlObjective
from ig2mj.tasks.bddl.task import BddlTask, activity_pool
from ig2mj.tasks.custom.code import blamed
from ig2mj.tasks.homes import AnyTask, check_inside
from ig2mj.tasks.model_choices import ModelChoices, VariedObjective, widened
from ig2mj.tasks.navigation.companions import wanderers
from ig2mj.tasks.navigation.objective import NavigationObjective
from ig2mj.tasks.navigation.reach_starts import make_reach_starts, standing_spot
from ig2mj.tasks.navigation.starts import make_starts
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.objective import Objective
from ig2mj.tasks.pools import bare_scene, check_pool, pool_of, start_states
from ig2mj.tasks.standing import standing_place
from ig2mj.tasks.task import Task, place_robot, role_of
from ig2mj.worlds.model_swaps import ModelSwaps
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.rules import Rules

RELAXED_STAINS = 0.75
"""Fraction of the stains that may stay with relaxed thresholds (appendix of the paper)."""


@dataclasses.dataclass(frozen=True)
class Control:
    """How the robot that acts is driven: `whole_actions` and `period` of `ig2mj.make`."""

    whole: bool = False
    period: float = ACTION_PERIOD

    def of(self, robot: TaskRobot) -> Control:
        """The same for a robot that tasks give every number of its controller."""
        return dataclasses.replace(self, whole=self.whole or robot.own_actions)

    def controller(self, robot: Robot, scene: Scene) -> Controller:
        """Of the scene's first robot."""
        return robot.controller(scene.tables, 0, self.period)

    def actions(self, controller: Controller, of_task: Callable[[], ActionMap]) -> ActionMap:
        """Every number of the controller's, or those that the task moves."""
        return whole_actions(controller.action_names, controller.action_high) if self.whole else of_task()


@dataclasses.dataclass(frozen=True, eq=False)
class EnvSetup:
    """See the module's text.

    Attributes:
      scene: with its robots; the first is the one that acts. rules: with the task's goal, if it has one.
      pool: gives the start states, which may take minutes. controllers: of all robots. mittens: objects that mitten
        grasping holds. companions: see `Environment`. hands: numbers of the acting hands among all hands of the scene;
        None: all of the first robot. swaps: objects whose models differ between episodes.
    """

    scene: Scene
    rules: Rules
    pool: Callable[[], Pool]
    controllers: tuple[Controller, ...]
    objective: Objective
    actions: ActionMap
    mittens: tuple[str, ...] = ()
    companions: Companions | None = None
    hands: tuple[int, ...] | None = None
    swaps: ModelSwaps | None = None

    @property
    def acting_hands(self) -> tuple[int, ...]:
        """Numbers of the acting hands among all hands of the scene."""
        every = np.flatnonzero(self.scene.tables.hand_agent == 0)
        return tuple(int(hand) for hand in every) if self.hands is None else self.hands


def check_able(task: AnyTask, name: str, body: TaskRobot) -> None:
    """Whether a robot has the drive and the hands that a task takes.

    Raises:
      EngineError: it has not.
    """
    if isinstance(task, Task):
        role_of(task, name, body)
        return
    others = f"({', '.join(task.robots)} can)"
    if isinstance(task, NavigationTask) and not body.drives and (task.goal != "reach" or not body.own_actions):
        raise EngineError(f"robot '{name}' does not drive: it cannot do {task.name} {others}")
    if not body.hand_count and not (isinstance(task, NavigationTask) and task.goal == "point"):
        raise EngineError(f"robot '{name}' has no hand: it cannot do {task.name} {others}")


def able_robots(task: AnyTask) -> list[str]:
    """Names of the robots of the registry that can do a task; those that it is made for first."""
    able = list(task.robots)
    for name in ROBOTS:
        if name not in able:
            with contextlib.suppress(EngineError):
                check_able(task, name, make_robot(name))
                able.append(name)
    return able


def setup_activity(
    task: Task,
    robot: str | TaskRobot,
    grasping: str,
    pool: Pool | None,
    split: str,
    count: int | None,
    relaxed_thresholds: bool,
    control: Control,
    tried: Callable[[EnvSetup], object] = lambda setup: None,
    chosen: ModelChoices | None = None,
) -> EnvSetup:
    """The setup of an activity.

    Args:
      count: rows of the pool. tried: called with a setup whose robot stands anywhere, before start states are sampled
        to find where it stands. chosen: models of its objects, which differ. The others: of `ig2mj.make`.
    """
    if pool is not None:
        check_pool(task, pool)
    name, body = find_robot(robot)
    role = role_of(task, name, body)
    if role.pos is None:
        if pool is None and not start_states(task, split).rows_at_hand:
            anywhere = dataclasses.replace(task, robots={name: dataclasses.replace(role, pos=(0.0, 0.0))})
            tried(_placed_activity(anywhere, robot, grasping, lambda: pool_of(task), relaxed_thresholds, control))
        rows = pool if pool is not None else pool_of(task, split, count)
        x, y, yaw = _standing(task, rows)
        task = dataclasses.replace(task, robots={name: dataclasses.replace(role, pos=(x, y), yaw=yaw)})

    def starts() -> Pool:
        return pool if pool is not None else pool_of(task, split, count)

    setup = _placed_activity(task, robot, grasping, starts, relaxed_thresholds, control, chosen)
    check_inside(task.name, setup.scene)
    return setup


def _standing(task: Task, rows: Pool) -> tuple[float, float, float]:
    """Where a robot starts: x, y (m) and degrees; in a home without a map of its floor where its geometry has room."""
    bare = bare_scene(task)
    if bare.rooms is not None and bare.rooms.traversable is not None:
        return standing_place(task.home, task.objects, task.objects_of_interest, rows)
    query = SceneQuery(bare)
    query.load(start_of(rows, 0)[0])
    near = [name for name in task.objects_of_interest if name in bare.object_names]
    return (*start_place(bare, query.view, near), 0.0)


def _placed_activity(
    task: Task,
    robot: str | TaskRobot,
    grasping: str,
    starts: Callable[[], Pool],
    relaxed_thresholds: bool,
    control: Control,
    chosen: ModelChoices | None = None,
) -> EnvSetup:
    """Of an activity that says where its robot starts. Arguments as of `setup_activity`; `starts`: gives its pool."""
    base = task
    if chosen is not None:
        task = dataclasses.replace(chosen.task, robots=task.robots)
    name = find_robot(robot)[0]
    task, body = place_robot(task, robot, drives=control.whole)
    control = control.of(body)
    scene = load_scene(task.home, agents=[body], objects=task.objects)
    with blamed(task.code, "goal"):
        rules = rules_of(task, scene, relaxed_thresholds)
    controller = control.controller(body, scene)
    with blamed(task.code, "distances"):
        if chosen is None:
            objective = ActivityObjective(task, name, scene, rules.model)
        else:
            own = dataclasses.replace(chosen, task=task)
            objective = VariedObjective(own, name, scene, rules.model)
    mittens = task.objects_of_interest[:1]
    if chosen is not None and mittens and mittens[0] in chosen.roles:
        at = chosen.roles.index(mittens[0])
        mittens = tuple(dict.fromkeys(names[at] for names in chosen.names))
    return EnvSetup(
        scene,
        rules,
        starts if chosen is None else lambda: widened(starts(), bare_scene(base), scene),
        (controller,),
        objective,
        control.actions(
            controller,
            lambda: hand_actions(
                controller.action_names,
                body.hand_controls,
                task.acts(name).hands,
                closing=grasping != "mitten",
                period=control.period,
            ),
        ),
        mittens,
        hands=tuple(int(hand) for hand in objective.reward.hands),
        swaps=objective.swaps if isinstance(objective, VariedObjective) else None,
    )


def setup_navigation(
    task: NavigationTask, robot: str | TaskRobot, split: str, count: int | None, control: Control
) -> EnvSetup:
    """The setup of a navigation task. Arguments as of `ig2mj.make`; `count`: start states."""
    name, first = find_robot(robot)
    control = control.of(first)
    check_able(task, name, first)
    others = [TurtleBot(name=f"other_{k}") for k in range(task.others)]
    objects = (*task.objects, *task.added)
    bare = load_scene(task.home, objects=objects)
    if not first.drives:  # it reaches from where most floor is free
        first = first.at(*standing_spot(bare), 0.0)
    robots: list[Robot] = [first, *others]
    scene = load_scene(task.home, agents=robots, objects=objects)
    rules = Rules.of_scene(scene)
    starts = (make_starts if first.drives else make_reach_starts)(task, bare, scene, rules.initial, split, count)
    controllers = tuple(r.controller(scene.tables, k, control.period) for k, r in enumerate(robots))
    arm = task.goal in ("reach", "close")
    companions = None
    if others:
        low = np.concatenate([c.action_low for c in controllers[1:]])
        high = np.concatenate([c.action_high for c in controllers[1:]])
        companions = wanderers(low.astype(np.float32), high.astype(np.float32))
    return EnvSetup(
        scene,
        rules,
        lambda: starts.pool,
        controllers,
        NavigationObjective(task, scene, starts),
        control.actions(
            controllers[0],
            lambda: robot_actions(
                controllers[0].action_names, first.hand_controls, arm=arm, gripper=task.goal == "close"
            ),
        ),
        companions=companions,
    )


def setup_bddl(
    task: BddlTask, robot: str | TaskRobot, pool: Pool | None, split: str, count: int | None, control: Control
) -> EnvSetup:
    """The setup of an activity that BDDL defines. Arguments as of `ig2mj.make`; `count`: rows of the pool."""
    name, body = find_robot(robot)
    if isinstance(robot, str):
        check_able(task, name, body)
    rows = pool if pool is not None else activity_pool(task, split, count)
    named = tuple(dict.fromkeys(task.binding.objects.values()))
    x, y, _ = standing_place(task.home, (*task.binding.requested, *task.added), named, rows)
    body = body.at(x, y, 0.0)
    scene = load_scene(task.home, agents=[body], objects=(*task.binding.requested, *task.added))
    rules = Rules.of_scene(scene)
    goal = conditions(task.binding).compile_goal(rules.model)
    controller = control.controller(body, scene)
    objective = BddlObjective(task.objects_in(scene), goal, scene)
    actions = whole_actions(controller.action_names, controller.action_high)
    return EnvSetup(scene, rules.with_goal(goal), lambda: rows, (controller,), objective, actions)


def rules_of(task: Task, scene: Scene, relaxed_thresholds: bool = False) -> Rules:
    """The states' rules with the task's goal; `relaxed_thresholds`: see `ig2mj.make`."""
    rules = Rules.of_scene(scene)
    if relaxed_thresholds:
        p = rules.model.parameters
        force = np.where(np.isfinite(p.slice_force), 0.0, p.slice_force).astype(p.slice_force.dtype)
        stains = np.where(np.isfinite(p.stained_threshold), RELAXED_STAINS, p.stained_threshold)
        eased = dataclasses.replace(p, slice_force=force, stained_threshold=stains.astype(p.stained_threshold.dtype))
        rules = Rules(dataclasses.replace(rules.model, parameters=eased), initial=rules.initial)
    return rules.with_goal(task.goal or None)
