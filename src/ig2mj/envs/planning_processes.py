"""`PlanningProcesses`: processes that plan for the worlds of an environment, while the environment steps them.

    with PlanningProcesses(env, 60) as planners:
        planners.keep([world], physics, states)
        planners.begin(world, number)
        for world, answer in planners.answers():
            ...

Each world belongs to one process, which keeps its plan (`ig2mj.planning.away`). Processes make the scene for
themselves, on the native engine, with one thread and without a GPU. Copies of worlds are in memory that all share
(`ig2mj.envs.shared_copies`); programs come back as arrays.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import multiprocessing
import multiprocessing.connection
import os
import signal
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.cluster.reporting import ONE_THREAD
from ig2mj.engine.snapshot import Snapshot
from ig2mj.envs.config import EnvConfig
from ig2mj.envs.environment import Environment
from ig2mj.envs.registry import make
from ig2mj.envs.shared_copies import SharedCopies
from ig2mj.errors import EngineError, Ig2mjError
from ig2mj.planning.away import PlanningAway, WorldCopy
from ig2mj.planning.phases import Programs
from ig2mj.planning.solver import EpisodeResult

TOGETHER = 8
"""Requests that a process gets at once, at most: a step of many worlds takes as long as it plans for some of them."""

NICENESS = 10
"""By which processes that plan give way to the one that steps the worlds: all worlds wait for that one."""

PackedAnswer = Programs | EpisodeResult | Ig2mjError
"""The next program of a world, the result of its episode, or why there is neither."""


def planning_of(env: Environment, seed: int = 0) -> PlanningAway:
    """What plans for copies of an environment's worlds, in this process. Raises EngineError: it has no goal."""
    rules = env.core.rules
    if rules is None or rules.goal is None:
        raise EngineError(f"{env.task.name} has no goal to plan for")
    friction = env.core.grasping is None
    return PlanningAway(env.scene, rules.model, rules.initial, rules.goal, seed, friction)


class PlanningProcesses:
    """See the module's text; a context manager.

    Attributes:
      count: of the processes, at least 1. asked: worlds that wait for an answer.
      seconds: processor time that processes have planned, of all of them.
    """

    def __init__(self, env: Environment, processes: int, seed: int = 0):
        """
        Args:
          env: made by name. processes: how many; 0: this one, which then plans when answers are asked for.

        Raises:
          EngineError: the environment has no goal.
        """
        self._env, self._seed = env, seed
        self.count = max(processes, 1)
        self.asked: set[int] = set()
        self.seconds = 0.0
        self._here = planning_of(env, seed) if processes == 0 else None
        self._queue: list[tuple[Any, ...]] = []
        self._processes: list[Any] = []
        self._pipes: list[multiprocessing.connection.Connection] = []
        self._waiting = [collections.deque[tuple[Any, ...]]() for _ in range(processes)]  # requests by process
        self._pending = [0] * processes  # answers that a process still owes
        self._copies: SharedCopies | None = None

    @property
    def here(self) -> bool:
        """Whether this process plans, when answers are asked for."""
        return self._here is not None

    def keep(self, worlds: Sequence[int], physics: Snapshot, states: Sequence[np.ndarray]) -> None:
        """Takes copies of k worlds, from which their next requests are planned. The first call starts the processes.

        Args:
          worlds: none of which is in `asked`. physics, and leaves of the extended states: with an axis of k worlds.
        """
        if self._copies is None:
            self._copies = self._start(_first(physics, states))
        self._copies.put(worlds, physics, states)

    def _start(self, like: WorldCopy) -> SharedCopies:
        """Starts the processes. `like`: a copy of a world."""
        env, count = self._env, self._env.num_worlds
        if self._here is not None:
            return SharedCopies(like, count)
        config = dataclasses.replace(env.config, worlds=1, engine="native", engine_options={}, observations=())
        context, before = multiprocessing.get_context("spawn"), dict(os.environ)
        copies = SharedCopies(like, count, allocate=lambda size: context.RawArray("B", size))
        os.environ.update(ONE_THREAD)
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            for _ in range(self.count):
                own, other = context.Pipe()
                arguments = (other, env.task.name, config, self._seed, like, count, copies.memory)
                process = context.Process(target=_serve, args=arguments, daemon=True)
                process.start()
                other.close()
                self._processes.append(process)
                self._pipes.append(own)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            for name in ONE_THREAD:
                os.environ.pop(name)
            os.environ.update(before)
        return copies

    def begin(self, world: int, number: int) -> None:
        """Asks for the first program of an episode; see `PlanningAway.begin`. Its copy is kept."""
        self._ask(world, ("begin", world, number))

    def go_on(self, world: int, reason: str, seconds: float) -> None:
        """Asks for the next program; see `PlanningAway.go_on`. Its copy is kept."""
        self._ask(world, ("go_on", world, reason, seconds))

    def _ask(self, world: int, request: tuple[Any, ...]) -> None:
        self.asked.add(world)
        if self._here is not None:
            self._queue.append(request)
            return
        number = world % len(self._pipes)
        self._waiting[number].append(request)
        self._send(number)

    def _send(self, number: int) -> None:
        """Sends a process its next requests if it has answered all others: writing to a pipe that is full blocks.
        There are several of them, so that it goes on planning while the worlds take a step."""
        waiting = self._waiting[number]
        if waiting and not self._pending[number]:
            requests = [waiting.popleft() for _ in range(min(TOGETHER, len(waiting)))]
            self._pending[number] = len(requests)
            self._pipes[number].send(requests)

    def answers(
        self, wait: float | None = 0.0, unless: multiprocessing.connection.Connection | None = None
    ) -> Iterator[tuple[int, PackedAnswer]]:
        """Worlds and their answers that are there; an error of one of them is its answer.

        Args:
          wait: s until there is at least one, at most; None: however long it takes. unless: has a message that ends the
            wait.

        Raises:
          EngineError: a process has ended.
        """
        if self._here is not None:
            queue, self._queue = self._queue, []
            for request in queue:
                assert self._copies is not None
                yield self._took(_answer(self._here, self._copies, request))
            return
        others = () if unless is None else (unless,)
        ready = multiprocessing.connection.wait([*self._pipes, *others], wait if self.asked else 0.0)
        for number in (k for k, p in enumerate(self._pipes) if p in ready):
            for answer in self._received(number):
                yield self._took(answer)
            self._send(number)

    def _received(self, number: int) -> Iterator[tuple[int, Any, float]]:
        """Answers of a process that are there. Raises EngineError: it has ended."""
        try:
            while self._pending[number] and self._pipes[number].poll():
                answer = self._pipes[number].recv()
                self._pending[number] -= 1
                yield answer
        except EOFError:
            words = "a process that plans has ended (is there enough memory for so many?)"
            raise EngineError(words) from None

    def _took(self, answer: tuple[int, Any, float]) -> tuple[int, PackedAnswer]:
        world, found, seconds = answer
        self.asked.discard(world)
        self.seconds += seconds
        return world, found

    def close(self) -> None:
        """Ends the processes; may be called twice."""
        for pipe in self._pipes:
            pipe.close()
        for process in self._processes:
            process.join(timeout=2.0)
            if process.is_alive():
                process.terminate()
        self._processes, self._pipes = [], []

    def __enter__(self) -> PlanningProcesses:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def _first(physics: Snapshot, states: Sequence[np.ndarray]) -> WorldCopy:
    """A copy of the first of k worlds."""
    return WorldCopy(jax.tree.map(lambda a: np.array(a[0]), physics), [np.array(a[:1]) for a in states])


def _answer(planning: PlanningAway, copies: SharedCopies, request: tuple[Any, ...]) -> tuple[int, PackedAnswer, float]:
    """The number of the world, what it does next, and seconds of planning."""
    import time

    kind, world, *arguments = request
    began = time.process_time()
    try:
        copy = copies.get(world)
        if kind == "begin":
            (number,) = arguments
            plan = planning.begin(world, number, copy)
        else:
            reason, seconds = arguments
            plan = planning.go_on(world, copy, reason, seconds)
        found: PackedAnswer = plan if isinstance(plan, EpisodeResult) else Programs.pack([plan])
    except Ig2mjError as e:
        found = Ig2mjError(str(e))
    except Exception as e:  # a fault of one world ends its episode, not those of others
        found = Ig2mjError(f"{type(e).__name__}: {e}")
    return world, found, time.process_time() - began


def _serve(
    pipe: multiprocessing.connection.Connection,
    name: str,
    config: EnvConfig,
    seed: int,
    like: WorldCopy,
    worlds: int,
    memory: Any,
) -> None:
    """The work of a process, until the other end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    planning, copies = planning_of(make(name, config), seed), SharedCopies(like, worlds, memory)
    with contextlib.suppress(EOFError, OSError):
        while True:
            for request in pipe.recv():
                pipe.send(_answer(planning, copies, request))
