"""`PlanningAway`: plans for worlds that another process steps, from copies of them.

    planning = PlanningAway(scene, model, initial, goal)
    answer = planning.begin(world, number, copy)           # a program, or the result of an episode
    answer = planning.go_on(world, copy, reason, seconds)  # after the program has ended

Whoever steps the worlds follows the programs (`ig2mj.planning.execution`) and sends a copy of a world when its program
has ended. Between two such calls nothing is known of the world, and nothing else is needed. The copy is loaded into a
world of the native engine, so worlds may be those of any engine.

A copy is of one world, so that no array has a world axis of its own.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np

from ig2mj.agents.base import Controller
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import PhysicsView
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.moves import Program
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.solver import EpisodeResult, Solving
from ig2mj.planning.steps import Outcome
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates

Answer = Program | EpisodeResult
"""The next program of a world, or the result of its episode."""


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True, eq=False)
class WorldCopy:
    """A world at one time, in numpy arrays; a pytree.

    Attributes:
      physics: of it. states: leaves of its extended states, each with a world axis of length 1.
    """

    physics: Snapshot
    states: list[np.ndarray]


class LoadedStage:
    """One world in the state that was loaded last; see `ig2mj.planning.stage.Stage`."""

    agent, num_worlds = 0, 1

    def __init__(self, scene: Scene, model: StateModel, initial: ExtendedStates, by_friction: bool = False):
        """`scene`: with its robots. `model`, `initial`: of its states. `by_friction`: see `Stage`."""
        self.by_friction = by_friction
        self.scene, self.model = scene, model
        robot: Any = scene.agents[0]
        self.controller: Controller = robot.controller(scene.tables, 0)
        self._query = SceneQuery(scene)
        self._leaves = jax.tree.structure(initial)
        self._states = jax.tree.map(lambda a: np.asarray(a), initial)

    @property
    def view(self) -> PhysicsView:
        return self._query.view

    @property
    def states(self) -> ExtendedStates:
        return self._states

    def snapshot(self, world: int) -> Snapshot:
        """See `Stage.snapshot`."""
        return self._query.save()

    def act(self, action: np.ndarray) -> None:
        raise AssertionError("worlds are stepped somewhere else")

    def ended(self, world: int) -> str | None:
        """See `Stage.ended`."""
        return None

    def load(self, copy: WorldCopy) -> None:
        """Goes to the state of a copy."""
        self._query.load(copy.physics)
        self._states = jax.tree.unflatten(self._leaves, copy.states)


class PlanningAway:
    """See the module's text. It keeps the plan and the primitive of every world for which `begin` was called."""

    def __init__(
        self,
        scene: Scene,
        model: StateModel,
        initial: ExtendedStates,
        goal: CompiledExpression,
        seed: int = 0,
        by_friction: bool = False,
    ):
        """
        Args:
          scene: with the robot. model, initial: of its states, initial ones with a world axis. goal: compiled for it.
          seed: of random streams. by_friction: see `Stage`.
        """
        self._stage = LoadedStage(scene, model, initial, by_friction)
        self._query, self._motion = SceneQuery(scene), MotionPlanner(scene)
        self._body = body_of(scene, self._stage.controller, self._stage.agent)  # of an arm, it is compiled once
        self._goal, self._seed = goal, seed
        self._worlds: dict[int, tuple[PhysicsRung, Solving]] = {}
        self._results: dict[int, EpisodeResult] = {}

    def begin(self, world: int, number: int, copy: WorldCopy) -> Answer:
        """An episode begins in a world. `number`: of the episode, for its random streams.

        Raises:
          PlanningError: the goal cannot become true.
        """
        self._stage.load(copy)
        rung = PhysicsRung(self._stage, self._seed, [number], self._query, self._motion, self._body)
        self._results.pop(world, None)
        planner = TaskPlanner(rung.domain, self._goal)
        ended = lambda _, result, world=world: self._results.__setitem__(world, result)  # noqa: E731
        solving = Solving(planner, rung, worlds=(0,), ended=ended)
        self._worlds[world] = rung, solving
        return self._answer(world, {})

    def go_on(self, world: int, copy: WorldCopy, reason: str, seconds: float) -> Answer:
        """A world's program has ended. Arguments as of `PhysicsRung.proceed`."""
        self._stage.load(copy)
        rung, _ = self._worlds[world]
        return self._answer(world, rung.proceed(0, reason, seconds))

    def _answer(self, world: int, outcomes: dict[int, Outcome]) -> Answer:
        """Primitives begin, until one has a program."""
        rung, solving = self._worlds[world]
        outcomes = outcomes or rung.take_ended()
        while outcomes and world not in self._results:
            solving.take(outcomes)
            outcomes = rung.take_ended()
        if world in self._results:
            del self._worlds[world]
            return self._results.pop(world)
        return rung.program(0)
