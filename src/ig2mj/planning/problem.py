"""`Problem`: a household, a goal in it, and start states.

problem_of("activity NAME")                                   the activity's goal and start states
problem_of("small_home", "(inside apple_0 fridge_0)")         a goal of one's own, from the scene's start
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.engine.snapshot import Snapshot
from ig2mj.errors import UnknownNameError
from ig2mj.knowledge.substances import substances
from ig2mj.planning.steps import PlanningError
from ig2mj.planning.supplies import RECEIVED
from ig2mj.predicates import logic
from ig2mj.predicates.compile import CompiledExpression, compile_expression
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.predicates.literals import AbilityWarning, names_of_objects
from ig2mj.predicates.logic import Expression
from ig2mj.predicates.parse import parse
from ig2mj.scene.paths import SHIPPED_HOMES
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.scene.substance_requests import substances_as_text
from ig2mj.states.model import StateModel
from ig2mj.states.substances.model import ALWAYS
from ig2mj.tasks.bddl.definitions import activity_names
from ig2mj.tasks.bddl.goal import conditions
from ig2mj.tasks.bddl.start import load_bound
from ig2mj.tasks.bddl.task import PREFIX, BddlTask, activity_pool, bddl_task
from ig2mj.tasks.homes import in_home
from ig2mj.tasks.own_goal import goal_task, split_goal_name
from ig2mj.tasks.pools import pool_of
from ig2mj.tasks.registry import TASKS, load_task
from ig2mj.tasks.task import Task
from ig2mj.worlds.pool import Pool


@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """A household, a goal in it, and start states; `problem_of` makes one.

    Attributes:
      name: of the activity, or of the scene. scene: without robots. model: of its states. goal: compiled for the scene.
      task: of the activity, or of a goal of one's own. objects: that are added to the home (`load_scene`).
      instead: a goal in place of the activity's; None: its own.
    """

    name: str
    scene: Scene
    model: StateModel
    goal: CompiledExpression
    task: Task | BddlTask
    objects: tuple[str, ...] = ()
    instead: str | None = None

    @property
    def own_goal(self) -> bool:
        """A home and a goal of one's own: there is one start, that of the scene."""
        return split_goal_name(self.task.name) is not None

    def goal_in(self, model: StateModel) -> CompiledExpression:
        """The goal for another scene of the same household, such as one with robots."""
        if isinstance(self.task, BddlTask) and self.instead is None:
            return conditions(self.task.binding).compile_goal(model)
        return _compiled(model, self.goal.source)

    @property
    def named(self) -> tuple[str, ...]:
        """Names of objects and rooms that its definition names."""
        goal = names_of_objects(self.goal.atoms, rooms=True)
        own = self.task.binding.objects.values() if isinstance(self.task, BddlTask) else ()
        return tuple(dict.fromkeys([*goal, *own]))

    def pool(self, split: str = "held_out", count: int = 1) -> Pool | None:
        """The activity's first start states, sampled where they are not kept yet; None: the scene's own start.

        Raises:
          UnknownNameError: no such split. EngineError: none can be sampled.
        """
        if self.own_goal:
            return None
        if isinstance(self.task, BddlTask):
            return activity_pool(self.task, split, count)
        return pool_of(self.task, split, count)


def problem_of(
    what: str,
    goal: str | None = None,
    objects: Sequence[str] = (),
    home: str | None = None,
    in_use: Sequence[str] = (),
) -> Problem:
    """The problem of an activity's name, or of a scene and a goal.

    Args:
      what: an activity of BEHAVIOR or of the paper, a home that ships, or a folder of a scene.
      goal: expression; None: that of the activity. Substances that it wants in or on objects are in use.
      objects: what is added to a home, and changed in it (`load_scene`).
      home: of an activity of BEHAVIOR, in place of its own; None: its own.
      in_use: substances that are in use in a scene whatever its goal wants; an activity has its own.

    Raises:
      UnknownNameError: no such activity, scene, object or predicate. PlanningError: a scene without a goal, or objects
      for an activity.
      ExpressionError: the goal is not an expression.
    """
    short = what.removeprefix(PREFIX)
    if objects and (short in activity_names() or short in TASKS):
        raise PlanningError(f"{short}: an activity has its own objects; add yours to a home, and give a goal")
    if short in activity_names():
        task = bddl_task(short)
        if home is not None:
            task = in_home(task, home)
            assert isinstance(task, BddlTask)
        scene = load_bound(task.binding)
        model = StateModel.of_manifest(scene.tables, scene.manifest)
        compiled = conditions(task.binding).compile_goal(model) if goal is None else _compiled(model, goal)
        return Problem(short, scene, model, compiled, task, task.binding.requested, goal)
    if short in TASKS:
        task = load_task(short)
        if not isinstance(task, Task):
            raise PlanningError(f"{short} has no goal expression to plan for (MotionPlanner.plan_base plans ways)")
        scene = load_scene(task.home, objects=task.objects)
        model = StateModel.of_manifest(scene.tables, scene.manifest)
        return Problem(short, scene, model, _compiled(model, goal or task.goal), task, task.objects, goal)
    if goal is None:
        try:
            load_scene(what)
        except Exception:
            raise UnknownNameError("activity", what, [*activity_names(), *TASKS]) from None
        raise PlanningError(f'{what} is a scene: give a goal, such as "(inside apple_0 fridge_0)"')
    objects = [*objects, *substances_as_text(list(dict.fromkeys([*in_use, *_filling(goal)])))]
    scene = load_scene(what, objects=objects)
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    own = scene.name if scene.folder.parent == SHIPPED_HOMES else scene.folder.resolve()
    return Problem(scene.name, scene, model, _compiled(model, goal), goal_task(own, goal), tuple(objects))


def _filling(goal: str) -> list[str]:
    """Substances that a goal wants in containers, or in or on objects. Raises ExpressionError, UnknownNameError as
    `compile_expression`."""
    found = [a.arguments[-1] for a in logic.atoms(parse(goal)) if a.predicate in RECEIVED]
    return list(dict.fromkeys(name for name in found if name in substances() and name not in ALWAYS))


def _compiled(model: StateModel, goal: str | Expression) -> CompiledExpression:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AbilityWarning)  # what cannot be true is refused when a plan is made
        return compile_expression(model, goal, questions=HostQueries.of(model))


def start_of(pool: Pool, number: int) -> tuple[Snapshot, Any]:
    """Physics without, and states with a world axis of length 1, of a row of a pool."""
    one = pool.rows(np.array([number]))
    return jax.tree.map(lambda a: np.asarray(a[0]), one.physics), one.states
