"""`play`: episodes of an environment, and how they ended.

Axis: W worlds.
"""

from __future__ import annotations

import collections
import dataclasses
import math
import time
from collections.abc import Callable, Sequence

import jax
import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.engine.view import Array
from ig2mj.envs.actor import STEPS, Actor, Tally, ending, resting
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import PolicyServerError
from ig2mj.predicates.quality import quality
from ig2mj.process import entry_point

Act = Callable[[EnvState], Array]
"""Actions [W, n] from the state of all worlds."""

Start = Callable[[np.ndarray], EnvState]
"""The state at the start of episodes, from W rows of the environment's pool."""

Watch = Callable[[EnvState], None]
"""Called with the state at the start of episodes and after every step."""


@dataclasses.dataclass(frozen=True)
class Played:
    """Results of episodes, in the order in which they ended, or of the pool's rows where those were played in order.

    Attributes:
      success: how it ended. outcomes: the same of what the task measures, by name
        (`ig2mj.tasks.objective.Objective.outcomes`). total: its return.
      steps: agent steps that were taken in all worlds together.
      steps_per_second: of them on the wall, without the first step, which compiles.
      metrics: `Environment.metrics` of all episodes together. state: of all worlds at the end.
      q: partial credit (`ig2mj.predicates.quality`), where episodes were played in order. failed: what ended an
        evaluation before its last episode; the other attributes are of the episodes that were over then.
    """

    success: list[bool]
    outcomes: dict[str, list[bool]]
    total: list[float]
    steps: int
    steps_per_second: float
    metrics: dict[str, int]
    state: EnvState
    q: list[float] = dataclasses.field(default_factory=list)
    failed: PolicyServerError | None = None


@entry_point
def play(
    env: Environment,
    act: Act,
    episodes: int,
    seed: int = 0,
    in_order: bool = False,
    watch: Watch | None = None,
    first: int = 0,
    report: ProgressCallback = no_progress,
    seeds: Sequence[int] | None = None,
    start: Start | None = None,
) -> Played:
    """Plays episodes.

    Args:
      act: who acts. seed: of the start states that are drawn.
      in_order: begin with the rows of the environment's pool, each once; again from the first where there are fewer.
        Where an episode is over actions are zero until all are.
      first: of these rows. seeds: of the episode that begins with each row, in place of `seed`. start: makes the state
        of all worlds at the start of episodes of these rows, in place of `Environment.start_from`.
      report: called after every step with a share of the episodes (0 to 1) and 1.
    """
    if in_order:
        return _in_order(env, act, episodes, seed if seeds is None else seeds, watch, first, report, start)
    return _drawn(env, act, episodes, seed, watch, report)


def _drawn(
    env: Environment, act: Act, episodes: int, seed: int, watch: Watch | None, report: ProgressCallback
) -> Played:
    state = env.reset(seed)
    pace = Pace(watch)
    pace.look(state)
    names = env.objective.outcomes
    success, total, outcomes = [], [], {name: [] for name in names}
    running, steps = np.zeros(env.num_worlds), 0
    most = env.task.horizon * max(1, math.ceil(episodes / env.num_worlds))
    while len(total) < episodes:
        state = env.step_autoreset(state, act(state))
        running += np.asarray(state.reward)
        steps += env.num_worlds
        pace.stepped(env.num_worlds)
        pace.look(state)
        done = np.asarray(state.done)
        ends = {name: np.asarray(state.info[name]) for name in ("success", *names)}
        for world in np.flatnonzero(done)[: episodes - len(total)]:
            total.append(float(running[world]))
            success.append(bool(ends["success"][world]))
            for name in names:
                outcomes[name].append(bool(ends[name][world]))
        running[done] = 0.0
        step = int(np.asarray(state.info["steps"]).max())
        words = f"{len(total)} of {episodes} episodes, step {step} of at most {env.task.horizon}"
        report(max(len(total) / episodes, min(steps / env.num_worlds / most, 1.0)), 1, words)
    return Played(success, outcomes, total, steps, pace.steps_per_second(), env.metrics(state), state)


def _in_order(
    env: Environment,
    act: Act,
    episodes: int,
    seed: int | Sequence[int],
    watch: Watch | None,
    begin: int,
    report: ProgressCallback,
    start: Start | None,
) -> Played:
    size, worlds = env.core.starts.pool.size, env.num_worlds
    tallies, pace, state, metrics = list[Tally](), Pace(watch), None, collections.Counter[str]()
    begun, failed, together = list[np.ndarray](), None, None
    if isinstance(act, Actor) and env.pure and watch is None:
        together = act
        env.following = lambda state: [together.traced(state, env.objective.outcomes)]
    for first in range(0, episodes, worlds):
        rows = (begin + first + np.arange(worlds)) % size
        if start is not None:
            state = start(rows)
        else:
            state = env.start_from(rows, seed if isinstance(seed, int) else [seed[int(row)] for row in rows])
        env.following = None  # compiled once
        pace.look(state)
        tally = Tally.begun(state, env.objective.outcomes)
        begun.append(np.asarray(state.status.literals))
        try:
            while tally.going.any():
                before = int(tally.steps)
                if together is not None:
                    state, tally = together.several(state, tally, STEPS if pace.begun else 1)
                else:
                    state = env.step(state, resting(act(state), tally.going))
                    tally = tally.after(jax.device_get(ending(state, env.objective.outcomes)))
                pace.stepped(worlds * (int(tally.steps) - before))
                pace.look(state)
                over = min(first + worlds - int(np.asarray(tally.going).sum()), episodes)
                step = int(tally.steps)
                share = min((first + min(step / env.task.horizon, 1.0) * worlds) / episodes, 1.0)
                words = f"{over} of {episodes} episodes, step {step} of at most {env.task.horizon}"
                report(max(share, over / episodes), 1, words)
        except PolicyServerError as e:
            failed = e
        tallies.append(jax.device_get(tally))
        metrics.update(env.metrics(state))
        if failed is not None:
            break

    over = np.concatenate([~np.asarray(tally.going) for tally in tallies])[:episodes]

    def joined(of: Callable[[Tally], Array]) -> list:
        return np.concatenate([of(tally) for tally in tallies])[:episodes][over].tolist()

    assert state is not None
    outcomes = {name: joined(lambda t, name=name: t.outcomes[name]) for name in env.objective.outcomes}
    steps = worlds * sum(int(tally.steps) for tally in tallies)
    pace_now = pace.steps_per_second()
    success, total = joined(lambda t: t.success), joined(lambda t: t.total)
    q = _qualities(env, np.concatenate(begun)[:episodes][over], np.array(joined(lambda t: t.literals)), success)
    return Played(success, outcomes, total, steps, pace_now, dict(metrics), state, q, failed)


def _qualities(env: Environment, begun: np.ndarray, ended: np.ndarray, success: Sequence[bool]) -> list[float]:
    """q of episodes, from the truth of the goal's literals at the start and at the end; 1 where the task was done, and
    0 elsewhere where the task has no goal expression."""
    rules = env.core.rules
    goal = None if rules is None else rules.goal
    found = []
    for k, done in enumerate(success):
        if done or goal is None:
            found.append(float(done))
        else:
            truths = (dict(zip(goal.atoms, map(bool, literals[k]), strict=True)) for literals in (begun, ended))
            found.append(quality(goal.ground, *truths))
    return found


class Pace:
    """Agent steps per second, without the first step, which compiles, and without the time of the `watch` function."""

    def __init__(self, watch: Watch | None = None) -> None:
        self._steps, self._began, self._watch = 0, math.nan, watch
        self._watched = 0.0

    def look(self, state: EnvState) -> None:
        """Passes a state to the `watch` function, whose time does not count."""
        if self._watch is None:
            return
        began = time.monotonic()
        self._watch(state)
        if self.begun:
            self._watched += time.monotonic() - began

    @property
    def begun(self) -> bool:
        """A step was taken."""
        return not math.isnan(self._began)

    def stepped(self, worlds: int) -> None:
        """After a step of so many worlds, or steps of fewer, whose results are there."""
        if self.begun:
            self._steps += worlds
        else:
            self._began = time.monotonic()

    def steps_per_second(self) -> float:
        """0 where there was one step at most."""
        return self._steps / (time.monotonic() - self._began - self._watched) if self._steps else 0.0
