"""`PrimitiveEnv`: an environment whose actions are primitives, for RL over skills and for language models.

    env = ig2mj.make("activity/installing_a_modem", action_space="primitives")
    observation, info = env.reset(seed=0)
    observation, reward, terminated, truncated, info = env.step(env.action_of("grasp", "modem_0"))
    observation, reward, *_ = env.step({"name": "grasp", "arguments": {"object": "modem_0"}})

A step is a whole primitive of `ig2mj.planning`, which the robot carries out in physics, or whose effect is set on the
symbolic rung. It is one Gymnasium environment with one world.

Axes: F facts.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from jaxtyping import Int8

from ig2mj.agents.registry import make_robot
from ig2mj.envs.planning_stage import EnvironmentStage, problem_env
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.grounding import ground_steps, named_things, substances_to_move
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.problem import Problem, problem_of
from ig2mj.planning.rung import Rung
from ig2mj.planning.steps import PlanningError, Step, make_step
from ig2mj.planning.symbolic import symbolic_episodes
from ig2mj.planning.words import step_of
from ig2mj.predicates.explain import value_of
from ig2mj.predicates.logic import Atom
from ig2mj.predicates.quality import quality
from ig2mj.process import entry_point
from ig2mj.sampling.query import SceneQuery
from ig2mj.tasks.added_objects import object_texts
from ig2mj.tasks.own_goal import split_goal_name

HORIZON = 60
"""Primitives of an episode: the longest plans of BEHAVIOR-100 have 53."""

RUNGS = ("physics", "symbolic")

Request = int | np.integer | Step | Mapping[str, Any]
"""An action: a number of `PrimitiveEnv.actions`, a step, or a function call (`ig2mj.planning.words.tools`)."""


@entry_point
class PrimitiveEnv(gymnasium.Env):
    """See the module's text.

    Attributes:
      problem: what is to be reached. actions: the discrete actions: primitives with objects that the problem names, and
        with tools, taps and sources of heat and cold. fact_names: of the observation's F entries.
      action_space: Discrete, numbers of `actions`; `step` takes other requests, too. observation_space: MultiBinary(F).
      reward: of a step is by how much q grows (`ig2mj.predicates.quality`), so that the return of an episode is its q.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        name: str,
        *,
        robot: str = "humanoid",
        rung: str = "physics",
        split: str = "train",
        pool_size: int = 16,
        horizon: int = HORIZON,
        objects: str | os.PathLike | Sequence[str | os.PathLike] = (),
    ):
        """
        Args:
          name: as of `ig2mj.make`: "activity/NAME", "goal/HOME GOAL", or an activity of the paper.
          rung: "physics" or "symbolic": what carries out the primitives. split, pool_size: start states.
          horizon: primitives of an episode.
          objects: of a goal in a home: what is added to it, and its substances (`load_scene`).

        Raises:
          UnknownNameError: no such activity, rung or robot. PlanningError: motion of the robot cannot be planned, or
          there are objects for an activity, which has its own.
        """
        if rung not in RUNGS:
            raise UnknownNameError("rung", rung, RUNGS)
        if horizon < 1 or pool_size < 1:
            raise EngineError(f"horizon={horizon}, pool_size={pool_size}: at least 1 each")
        self.problem: Problem = problem_of(*(split_goal_name(name) or (name,)), objects=object_texts(objects))
        self._robot, self._kind, self._split, self._horizon = robot, rung, split, horizon
        self.domain = Domain.of_robot(self.problem.model, make_robot(robot))
        if self.domain.hands < 1:
            raise PlanningError(f"{robot} has no hands: it cannot change a household (take a robot with hands)")
        self._pool = self.problem.pool(split, pool_size)
        self._size = 1 if self._pool is None else min(pool_size, self._pool.size)
        self._stage: EnvironmentStage | None = None
        self._query: SceneQuery | None = None
        if rung == "physics":
            self._stage = EnvironmentStage(problem_env(self.problem, robot, rows=self._size, split=split), ends=False)
            self._query = SceneQuery(self._stage.scene)
        things = self._things = named_things(self.domain, self.problem)
        self.actions: tuple[Step, ...] = tuple(ground_steps(self.domain, self.problem))
        self._atoms = self._observed(things)
        held = [f"(held {n})" for n in things if not self.domain.fixed(n)]
        self.fact_names: tuple[str, ...] = (*(f"({' '.join((a.predicate, *a.arguments))})" for a in self._atoms), *held)
        self.action_space = gymnasium.spaces.Discrete(len(self.actions))
        self.observation_space = gymnasium.spaces.MultiBinary(len(self.fact_names))
        self._rung: Rung | None = None
        self._start: dict[Atom, bool] = {}
        self._count, self._q = 0, 0.0

    # What is seen.

    def _observed(self, things: Sequence[str]) -> tuple[Atom, ...]:
        """Atoms of the goal, then states of the things, and what they contain."""
        ability = {"open": "openable", "toggled_on": "toggleable", "soaked": "soakable", "sliced": "sliceable"}
        ability |= {"dusty": "dustyable", "stained": "stainable", "cooked": "cookable", "frozen": "freezable"}
        states = [
            Atom(predicate, (n,))
            for n, (predicate, word) in itertools.product(things, ability.items())
            if self.domain.has(n, word)
        ]
        liquids = substances_to_move(self.domain, self.problem)
        contents = [Atom("contains", pair) for pair in itertools.product(filter(self.domain.contains, things), liquids)]
        return tuple(dict.fromkeys([*self.problem.goal.atoms, *states, *contents]))

    def _observation(self, facts: Facts) -> Int8[np.ndarray, "F"]:
        truth = facts.truth(self._atoms)
        held = [n in facts.held for n in self._things if not self.domain.fixed(n)]
        return np.array([*(truth[a] for a in self._atoms), *held], np.int8)

    # Gymnasium.

    @property
    def facts(self) -> Facts:
        """What holds now. Raises EngineError: no episode has begun."""
        if self._rung is None:
            raise EngineError("no episode has begun: reset() first")
        return self._rung.facts(0)

    def action_of(self, primitive: str, *arguments: str) -> int:
        """Number of an action. Raises UnknownNameError: it is none of `actions` (`step` takes it as a Step)."""
        step = make_step(primitive, arguments)
        if step not in self.actions:
            raise UnknownNameError("action", str(step), [*map(str, self.actions)])
        return self.actions.index(step)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Int8[np.ndarray, "F"], dict[str, Any]]:
        """Begins an episode.

        Args:
          options: {"row": n} takes this start state in place of one drawn by the seed.
        """
        super().reset(seed=seed)
        row = int((options or {}).get("row", self.np_random.integers(self._size)))
        if not 0 <= row < self._size:
            raise EngineError(f"row {row}: there are {self._size} start states")
        stream = int(self.np_random.integers(2**31))
        if self._stage is None:
            ((_, self._rung),) = symbolic_episodes(self.domain, self.problem.scene, self._pool, [row], stream)
        else:
            self._stage.start(np.array([0 if self._pool is None else row]), self.problem.named)
            body = self._rung.body if isinstance(self._rung, PhysicsRung) else None
            self._rung = PhysicsRung(self._stage, stream, row, self._query, body=body)
        facts = self.facts
        self._start = facts.truth(self.problem.goal.atoms)
        self._count, self._q = 0, 0.0
        return self._observation(facts), self._info(facts)

    def step(self, action: Request) -> tuple[Int8[np.ndarray, "F"], float, bool, bool, dict[str, Any]]:
        """Carries out a primitive. A primitive that fails is no error: `info["reason"]` says why, as in `Outcome`.

        Raises:
          UnknownNameError: a request names what the scene lacks. PlanningError: it lacks arguments.
        """
        request = self._request(action)
        if self._rung is None:
            raise EngineError("no episode has begun: reset() first")
        self._rung.begin(0, request)
        outcome = self._rung.advance()[0]
        self._count += 1
        facts = self.facts
        info = self._info(facts) | {
            "reason": outcome.reason,
            "detail": outcome.detail,
            "time": outcome.time,
        }
        reward, self._q = info["q"] - self._q, info["q"]
        over = self._count >= self._horizon and not info["success"]
        return self._observation(facts), float(reward), info["success"], over, info

    def _request(self, action: Request) -> Step:
        if isinstance(action, Step):
            step = action
        elif isinstance(action, Mapping):
            if "name" not in action:
                raise PlanningError('a function call is {"name": ..., "arguments": {...}}')
            step = step_of(action["name"], action.get("arguments", {}))
        else:
            if not 0 <= int(action) < len(self.actions):
                raise EngineError(f"action {action}: there are {len(self.actions)}")
            step = self.actions[int(action)]
        self.domain.check(step)
        return step

    def _info(self, facts: Facts) -> dict[str, Any]:
        truth = facts.truth(self.problem.goal.atoms)
        success = bool(value_of(self.problem.goal.ground, truth))
        q = 1.0 if success else quality(self.problem.goal.ground, self._start, truth)
        return {"success": success, "q": q, "held": facts.held}

    def describe(self) -> str:
        """What of the observation holds now, as text for a language model: one fact a line."""
        observed = self._observation(self.facts)
        return "\n".join(name for name, value in zip(self.fact_names, observed, strict=True) if value)
