"""`PlannedBatch`: many worlds of an environment on any engine, each with a plan of its own.

    env = problem_env(problem, worlds=1024, rows=1024, engine="warp")
    with PlannedBatch(env, processes=60) as batch:
        episodes = batch.run(range(2048))

All worlds take an agent step together, in one call. Programs of all worlds are followed in one batch on the host
(`ig2mj.planning.execution`). A world whose program has ended is copied to the process that plans for it, holds still
until the answer is there, and delays no other world. Copies of several worlds leave the device together
(`Engine.gather`), in batches of `GATHERED`, so that nothing is compiled again. They are handed over, and answers are
read, while the worlds take the next step.

Axes: W worlds.
"""

from __future__ import annotations

import concurrent.futures
import dataclasses
import functools
import json
import multiprocessing
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future
from multiprocessing.connection import Connection
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.base import GATHERED
from ig2mj.engine.packed_rows import PackedRows
from ig2mj.engine.snapshot import Snapshot
from ig2mj.envs.environment import Environment
from ig2mj.envs.planning_processes import PlanningProcesses
from ig2mj.envs.planning_stage import EnvironmentStage
from ig2mj.envs.state import EnvState
from ig2mj.errors import Ig2mjError
from ig2mj.planning import execution
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.phases import Programs
from ig2mj.planning.physics import check_robot
from ig2mj.planning.senses import Senses, sensed, senses_of
from ig2mj.planning.solver import EpisodeResult
from ig2mj.process.worker_threads import WorkerThreads

SETTING_OUT = 0.004
"""s for which a step has the interpreter for itself, so that the device begins it at once."""

REFILL = 16
"""Share of the worlds, one in so many, whose episodes are over before they begin others: one call resets them all."""


@dataclasses.dataclass(frozen=True)
class PlannedEpisode:
    """Result of an episode.

    Attributes:
      number: of the episode. success: its goal held at the end. q: partial credit, 1 for a success; None: the planner
        had not judged it when it ended. ended: why without success, in words. seconds: simulated s.
    """

    number: int
    success: bool
    q: float | None
    ended: str
    seconds: float


@dataclasses.dataclass(frozen=True)
class Results:
    """What is read of all worlds after an agent step.

    Attributes:
      senses: of the robot. terminated: its goal ended the episode. truncated: the horizon or a guard did.
    """

    senses: Senses
    terminated: Bool[np.ndarray, "W"]
    truncated: Bool[np.ndarray, "W"]


@dataclasses.dataclass
class Spent:
    """Wall time of a run, by what it was spent on.

    Attributes:
      stepping: s in the environment's step, until its results are on the host. following: s in which programs are
        followed, and answers read while the environment does not step. copying: s in which worlds are copied, handed
        over, and answers read after the environment's step has ended.
        blocked: s in which no world had a program.
      world_steps: agent steps of all worlds. waited: of these, those in which a world held still for its planner.
      planned: processor s of all processes. programs: that were planned.
    """

    stepping: float = 0.0
    following: float = 0.0
    copying: float = 0.0
    blocked: float = 0.0
    world_steps: int = 0
    waited: int = 0
    planned: float = 0.0
    programs: int = 0

    def figures(self) -> dict[str, float]:
        """As JSON, with `planning_share`: share of wall time that is not the environment's stepping, and
        `waiting_share`: share of all worlds' agent steps in which they held still for their planners."""
        wall = self.stepping + self.following + self.copying + self.blocked
        shares = {
            "planning_share": round(1.0 - self.stepping / wall, 4) if wall else 0.0,
            "waiting_share": round(self.waited / self.world_steps, 4) if self.world_steps else 0.0,
        }
        return {**{name: round(value, 3) for name, value in dataclasses.asdict(self).items()}, **shares}


class PlannedBatch:
    """See the module's text; a context manager.

    Attributes:
      env: the environment. stage: its worlds. body: how programs move the robot. planners: who plans.
      spent: of all runs. stepped: has a message where a step has ended.
    """

    def __init__(self, env: Environment, processes: int = 0, seed: int = 0):
        """
        Args:
          env: with a goal; its action has every number of the robot's. processes: that plan; 0: this one plans, and all
            worlds wait. seed: of random streams.

        Raises:
          PlanningError: motion of the robot cannot be planned. EngineError: as of `EnvironmentStage`.
        """
        check_robot(env.robot)
        self.env, self.spent = env, Spent()
        self.stage = EnvironmentStage(env)
        self.body = body_of(env.scene, self.stage.controller, 0)
        self.planners = PlanningProcesses(env, processes, seed)
        self._stepper = WorkerThreads(1, "steps")
        self.stepped, self._tell = multiprocessing.Pipe(duplex=False)
        self._every = np.arange(env.num_worlds, dtype=np.int32)
        self._packed = PackedRows(lambda *read: read)
        self._read_of: tuple[EnvState, Results] | None = None

    def run(
        self,
        numbers: Iterable[int],
        watch: Callable[[PlannedEpisode], None] = lambda episode: None,
        until: float = float("inf"),
    ) -> list[PlannedEpisode]:
        """Plays an episode of each number, W at a time: the next ones begin when all of these are over.

        Args:
          numbers: of episodes: row modulo the pool's size, and random stream. watch: called after each.
          until: s of wall time after which episodes that are not over count as ended.
        """
        left, found, end = list(numbers), list[PlannedEpisode](), time.monotonic() + until
        size = self.env.core.starts.pool.size
        while left and time.monotonic() < end:
            now, left = left[: self.env.num_worlds], left[self.env.num_worlds :]
            padded = [*now, *[now[0]] * (self.env.num_worlds - len(now))]
            self.stage.start(np.array([n % size for n in padded], np.int32))
            found += _Episodes(self, watch, end).play(dict(enumerate(now)))
        return found

    def stream(
        self,
        episodes: int,
        seed: int = 0,
        watch: Callable[[PlannedEpisode], None] = lambda episode: None,
        until: float = float("inf"),
    ) -> list[PlannedEpisode]:
        """Plays episodes from random rows of the pool; worlds begin another one while others go on.

        Args:
          episodes: that are to end. seed: of the rows. watch, until: see `run`.
        """
        self.stage.observe(self.env.reset(seed))
        first = {world: world for world in range(min(self.env.num_worlds, episodes))}
        return _Episodes(self, watch, time.monotonic() + until).play(first, episodes)

    def warm_up(self) -> None:
        """Compiles what a run needs, and waits until all processes can plan. Its time is not counted."""
        self.stage.observe(self.env.reset(0))
        count = self.env.num_worlds
        world = self.stage.state.batch.world
        for size in (s for s in GATHERED if s <= max(count, 1)):
            self.env.core.engine.gather(world.physics, world.states, range(size))()
        self.stage.act(np.zeros((count, self.body.size), np.float32))
        self.stage.observe(self.env.reset(self.stage.state, np.ones(count, bool)))
        every = range(min(count, self.planners.count))
        self.keep(every, self.gather(every))
        for number in every:
            self.planners.begin(number, number)
        while self.planners.asked:
            for _ in self.planners.answers(wait=None):
                pass
        self.planners.seconds = 0.0

    def gather(self, worlds: Sequence[int]) -> Callable[[], tuple[Snapshot, Any]]:
        """Begins to copy some worlds to the host; see `Engine.gather`."""
        world = self.stage.state.batch.world
        return self.env.core.engine.gather(world.physics, world.states, worlds)

    def keep(self, worlds: Sequence[int], copies: Callable[[], tuple[Snapshot, Any]]) -> None:
        """Hands copies of some worlds, which `gather` began, to who plans for them."""
        physics, states = copies()
        self.planners.keep(worlds, physics, jax.tree.leaves(states))

    def begin_step(self, action: Float[np.ndarray, "W n"]) -> Future[float]:
        """Begins an agent step of all worlds, in a thread: the call of a program returns when the device has decided
        its last branch. The result is when the worlds were there, s of `time.perf_counter`; `stepped` has a message
        then."""
        return self._stepper.submit(self._stepped, action)

    def _stepped(self, action: Float[np.ndarray, "W n"]) -> float:
        try:
            self.stage.act(action)
            self.results()
            return time.perf_counter()
        finally:
            self._tell.send_bytes(b"\0")

    def results(self) -> Results:
        """Of the worlds as they are now; copied once for each state, as one array."""
        state = self.stage.state
        if self._read_of is None or self._read_of[0] is not state:
            read = sensed(state.batch.world.view, self.body.friction is not None), state.terminated, state.truncated
            arrays, terminated, truncated = self._packed.begin(self._every, *read)()
            senses = senses_of(arrays, self.stage.agent, self.body.hands, self.body.friction)
            self._read_of = state, Results(senses, terminated, truncated)
        return self._read_of[1]

    def close(self) -> None:
        """Ends the processes that plan, and the thread that steps; may be called twice."""
        self._stepper.__exit__(None)
        self.planners.close()
        self.stepped.close()
        self._tell.close()

    def __enter__(self) -> PlannedBatch:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class _Episodes:
    """Episodes that are under way."""

    def __init__(self, batch: PlannedBatch, watch: Callable[[PlannedEpisode], None], end: float):
        self.batch, self.stage, self.planners, self.spent = batch, batch.stage, batch.planners, batch.spent
        self.env, self.watch, self.end = batch.env, watch, end
        count = batch.env.num_worlds
        self.carry = execution.begin([[]] * count)
        self.numbers: dict[int, int] = {}  # of the worlds whose episodes go on
        self.over: list[int] = []  # worlds whose episodes are over
        self.stopped: list[int] = []  # of these, the ones whose programs still go on
        self.fresh: dict[int, Programs] = {}  # of worlds whose programs begin with the next step
        self.leaving: list[_Leaving] = []  # copies that have not been handed over
        self.steps, self.begun = np.zeros(count, int), np.zeros(count, int)
        self.results: dict[int, EpisodeResult | Ig2mjError] = {}
        self.found: list[PlannedEpisode] = []

    def play(self, first: Mapping[int, int], episodes: int = 0) -> list[PlannedEpisode]:
        """Until all are over. `first`: numbers by world. `episodes`: worlds begin others until so many have begun."""
        begun = len(first)
        while self.planners.asked:  # of episodes that were over before their planner had answered
            for _ in self.planners.answers(wait=None):
                pass
        self._begin(first)
        while self.numbers:
            if time.monotonic() >= self.end:
                for world in list(self.numbers):
                    self._ended(world, False, "the time limit passed")
                break
            if self._answers():
                self._step()
            room = max(1, self.env.num_worlds // REFILL)
            waiting = self._waiting()
            free = [w for w in self.over if w not in waiting]
            if begun < episodes and (len(free) >= room or not self.numbers):
                new = {world: begun + k for k, world in enumerate(free[: episodes - begun])}
                self.over = [w for w in self.over if w not in new]
                began = time.perf_counter()
                mask = np.isin(np.arange(self.env.num_worlds), list(new))
                self.stage.observe(self.env.reset(self.stage.state, mask))
                self.spent.stepping += time.perf_counter() - began
                self._begin(new)
                begun += len(new)
        return self.found

    def _begin(self, numbers: Mapping[int, int]) -> None:
        began = time.perf_counter()
        worlds = sorted(numbers)
        self.numbers |= numbers
        self.carry = execution.begin_some(self.carry, {world: [] for world in worlds})
        for world in worlds:
            self.results.pop(world, None)
            self.steps[world] = 0
        self._leave(worlds, [functools.partial(self.planners.begin, world, numbers[world]) for world in worlds])
        self.spent.copying += time.perf_counter() - began

    def _leave(self, worlds: Sequence[int], ask: Sequence[Callable[[], None]]) -> None:
        """Copies worlds for their planners. `ask`: requests of these worlds, made when the copies are handed over."""
        if worlds:
            self.leaving.append(_Leaving(worlds, self.batch.gather(worlds), ask))

    def _hand_over(self) -> None:
        for each in self.leaving:
            self.batch.keep(each.worlds, each.copies)
            for ask in each.ask:
                ask()
        self.leaving.clear()

    def _waiting(self) -> set[int]:
        """Worlds whose planners have been asked, or are about to be."""
        return self.planners.asked.union(*(each.worlds for each in self.leaving))

    def _ended(self, world: int, success: bool, why: str) -> None:
        number, result = self.numbers.pop(world), self.results.get(world)
        q = 1.0 if success else result.q if isinstance(result, EpisodeResult) else None
        seconds = float(self.steps[world] * self.env.period)
        episode = PlannedEpisode(number, success, q, "" if success else why, seconds)
        self.over.append(world)
        self.stopped.append(world)
        self.fresh.pop(world, None)
        self.found.append(episode)
        self.watch(episode)

    def _answers(self) -> bool:
        """Begins programs that have come, and takes answers where no step would; whether a step can be taken: some
        world has a program."""
        began = time.perf_counter()
        if self.planners.here or not self.carry.running.any():
            self._hand_over()
        self.spent.copying += time.perf_counter() - began
        began = time.perf_counter()
        idle = all(world in self.planners.asked for world in self.numbers)
        if idle or self.planners.here:
            self._take(None if idle else 0.0)
        self._set_programs()
        took = time.perf_counter() - began
        self.spent.blocked, self.spent.following = (
            self.spent.blocked + took * idle,
            self.spent.following + took * (not idle),
        )
        return bool(self.carry.running.any())

    def _take(self, wait: float | None, unless: Connection | None = None) -> None:
        """Takes answers that are there. `wait`, `unless`: see `PlanningProcesses.answers`."""
        before = self.planners.seconds
        for world, answer in self.planners.answers(wait, unless):
            if world not in self.numbers:
                continue
            if isinstance(answer, Programs):
                self.spent.programs += 1
                self.fresh[world] = answer
                self.begun[world] = self.steps[world]
                continue
            self.results[world] = answer
            success = isinstance(answer, EpisodeResult) and answer.success
            self._ended(world, success, answer.ended if isinstance(answer, EpisodeResult) else str(answer))
        self.spent.planned += self.planners.seconds - before

    def _set_programs(self) -> None:
        """Begins programs, and stops those of worlds whose episodes are over, in one change for all worlds."""
        changed = dict.fromkeys(self.stopped, Programs.pack([[]])) | self.fresh
        if changed:
            self.carry = execution.begin_packed(self.carry, list(changed), Programs.together(list(changed.values())))
        self.stopped.clear()
        self.fresh.clear()

    def _step(self) -> None:
        """An agent step of all worlds, and requests for those whose programs have ended."""
        spent, stage, began = self.spent, self.stage, time.perf_counter()
        action, self.carry = execution.advance_sensed(self.batch.body, self.carry, self.batch.results().senses)
        spent.following += time.perf_counter() - began
        began = time.perf_counter()
        self.steps += 1
        spent.world_steps += len(self.numbers)
        spent.waited += len(self._waiting() & self.numbers.keys())
        step = self.batch.begin_step(action)
        concurrent.futures.wait([step], SETTING_OUT)
        self._hand_over()
        while self.planners.asked and not self.planners.here and not step.done():
            self._take(None, self.batch.stepped)
        stepped = step.result()
        while self.batch.stepped.poll():  # also of steps that were interrupted
            self.batch.stepped.recv_bytes()
        spent.stepping += stepped - began
        results = self.batch.results()
        for world in np.flatnonzero(results.terminated | results.truncated).tolist():
            if world in self.numbers:
                success = bool(results.terminated[world])
                self._ended(world, success, "" if success else stage.ended(world) or "")
        busy = self.planners.asked | self.fresh.keys()
        ended = [w for w in np.flatnonzero(~self.carry.running).tolist() if w in self.numbers and w not in busy]
        seconds = (self.steps - self.begun) * self.env.period
        asks = [functools.partial(self.planners.go_on, w, self.carry.reason(w), float(seconds[w])) for w in ended]
        self._leave(ended, asks)
        spent.copying += time.perf_counter() - stepped


@dataclasses.dataclass(frozen=True)
class _Leaving:
    """Worlds that are on their way to the host, and requests that are made when they are there."""

    worlds: Sequence[int]
    copies: Callable[[], tuple[Snapshot, Any]]
    ask: Sequence[Callable[[], None]]


def line_of(episode: PlannedEpisode) -> str:
    """An episode as a line of JSON."""
    return json.dumps(dataclasses.asdict(episode))
