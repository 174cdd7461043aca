"""`Episodes`: a planning problem's episodes in physics, in an environment, recorded where that is wanted.

    episodes = Episodes(problem, planner, numbers=range(10), record="runs.h5")
    with episodes:
        for number, result in episodes.solve():
            ...

A robot acts in the task's own action space, so that a recording of a success is a demonstration: it replays bit for
bit. A run ends when its goal holds. Episodes without success are incomplete runs, which metrics and exports leave out.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.registry import find_robot
from ig2mj.demos.environments import RecordedEnvironment, record
from ig2mj.envs.environment import Environment
from ig2mj.envs.planning_stage import EnvironmentStage, problem_env
from ig2mj.errors import EngineError
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.physics import CLEANING, PhysicsRung, check_robot, most_seconds
from ig2mj.planning.problem import Problem
from ig2mj.planning.results import row_of
from ig2mj.planning.solver import EpisodeResult, Watch, solve, unwatched
from ig2mj.planning.symbolic import symbolic_episodes
from ig2mj.planning.task_planner import TaskPlanner
from ig2mj.process import entry_point
from ig2mj.sampling.query import SceneQuery

SECONDS_PER_STEP, SECONDS_MORE = 120.0, 200.0
"""Simulated s of an episode's horizon: for each step of its plan, and more, as long as BEHAVIOR's activities last. A
step that cleans counts as long as it may last (`ig2mj.planning.physics.most_seconds`)."""

ON_WHEELS = 2
"""By how much longer episodes of robots with wheels last: an arm moves its hand at half a floating hand's speed."""

PLAN = "plan"
"""Attribute of a run: what was done, as JSON (`ig2mj.planning.results.row_of`), and the `number` of the episode."""


def horizon_for(steps: int, period: float = ACTION_PERIOD, cleaning: int = 0) -> int:
    """Agent steps that an episode with a plan of so many steps may take. `period`: s of one. `cleaning`: steps of the
    plan that clean."""
    cleans = cleaning * (most_seconds(CLEANING[0]) - SECONDS_PER_STEP)
    return math.ceil((SECONDS_PER_STEP * steps + cleans + SECONDS_MORE) / period)


@entry_point
class Episodes:
    """See the module's text; a context manager.

    Attributes:
      problem, planner: what is solved. numbers: of episodes, which have rows of the pool by their numbers.
      env: the environment, with a horizon that follows the longest plan. stage: its worlds.
    """

    def __init__(
        self,
        problem: Problem,
        planner: TaskPlanner,
        numbers: Sequence[int] = (0,),
        *,
        robot: str = "humanoid",
        worlds: int = 1,
        split: str = "held_out",
        seed: int = 0,
        doors_open: bool = True,
        grasping: str = "assisted",
        record: str | os.PathLike | None = None,
    ):
        """
        Args:
          robot: which robot acts. worlds: episodes that are solved side by side. split: of the start states.
          grasping: how hands hold (`ig2mj.make`). seed: of what is sampled.
          doors_open: doors between rooms that the problem does not name stand open.
          record: HDF5 file of a recording, replaced if it is there.

        Raises:
          PlanningError: the goal cannot become true, or the robot's motion cannot be planned. EngineError: a goal in
          place of an activity's own cannot be recorded. See also `ig2mj.make`.
        """
        if record is not None and problem.instead is not None:
            home = problem.scene.name
            raise EngineError(
                f"{problem.name}: a recording is of the activity's own goal (leave the goal out, or name the home "
                f"{home} and a goal)"
            )
        check_robot(robot)
        self.problem, self.planner = problem, planner
        self._seed, self._open, self._recorded = seed, doors_open, None
        rows = max([0, *numbers]) + 1
        self.numbers = [n for n in numbers if problem.own_goal or n < self._size(split, rows)]
        worlds = max(1, min(worlds, len(self.numbers)))
        horizon = self._horizon(split, rows) * (ON_WHEELS if find_robot(robot)[1].drives else 1)
        options: dict[str, Any] = {"rows": rows, "split": split, "horizon": horizon}
        options["grasping"] = grasping
        self.env: Environment = problem_env(problem, robot, worlds, **options)
        self._step = self.env.step
        if record is not None:
            self._recorded: RecordedEnvironment | None = _recorded(self.env, record)
            self._step = self._recorded.step
        self.stage = EnvironmentStage(self.env, self._step, ends=problem.instead is None)

    def _size(self, split: str, rows: int) -> int:
        pool = self.problem.pool(split, rows)
        return 0 if pool is None else pool.size

    def _horizon(self, split: str, rows: int) -> int:
        """Agent steps that the longest plan of all starts may take."""
        pool, longest = self.problem.pool(split, rows), 0
        numbers = self.numbers[:1] if pool is None else self.numbers
        for _, rung in symbolic_episodes(self.planner.domain, self.problem.scene, pool, numbers):
            steps = self.planner.plan(rung.facts(0)).steps
            cleaning = sum(step.primitive in CLEANING for step in steps)
            longest = max(longest, horizon_for(len(steps), cleaning=cleaning))
        return longest

    def solve(
        self,
        *,
        seconds: float = math.inf,
        watch: Watch = unwatched,
        begun: Callable[[Sequence[int], PhysicsRung], None] = lambda numbers, rung: None,
    ) -> Iterator[tuple[int, EpisodeResult]]:
        """Solves the episodes; numbers and results, those of worlds side by side together.

        Args:
          seconds: wall time of an episode after which no further step is begun. watch: see `ig2mj.planning.solve`.
          begun: called where episodes begin, with their numbers and what carries out their steps.
        """
        query, count = SceneQuery(self.env.scene), self.env.num_worlds
        motion, body = MotionPlanner(self.env.scene), body_of(self.env.scene, self.stage.controller)
        for first in range(0, len(self.numbers), count):
            chosen = self.numbers[first : first + count]
            padded = [*chosen, *[chosen[0]] * (count - len(chosen))]
            rows = np.zeros(count, np.int32) if self.problem.own_goal else np.array(padded, np.int32)
            self.stage.start(rows, self.problem.named if self._open else None)
            if self._recorded is not None:
                self._recorded.begin_runs(self.stage.state, rows, range(len(chosen)))
            rung = PhysicsRung(self.stage, self._seed, padded, query, motion, body)
            begun(chosen, rung)
            ended = lambda world, result, chosen=chosen: self._ended(world, chosen[world], result)  # noqa: E731
            results = solve(self.planner, rung, seconds=seconds, watch=watch, worlds=range(len(chosen)), ended=ended)
            yield from zip(chosen, results, strict=True)

    def _ended(self, world: int, number: int, result: EpisodeResult) -> None:
        if self._recorded is not None:
            plan = json.dumps({"number": number, **row_of(result)})
            self._recorded.end_run(world, success=result.success, complete=result.success, **{PLAN: plan})

    def close(self) -> None:
        """Ends the recording; may be called twice."""
        if self._recorded is not None:
            self._recorded.close()

    def __enter__(self) -> Episodes:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _recorded(env: Environment, file: str | os.PathLike) -> RecordedEnvironment:
    return record(env, file, past_success=True)
