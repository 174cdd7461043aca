"""`train`: the loop around an algorithm: iterations until the time is over, checkpoints, reports, a guard.

On a pure engine an iteration (a rollout, and all updates on it) is one compiled program, or two where that is asked
for. On the native engine the same loop calls the compiled policy, the environment and the compiled learner in turn.

The clock of a run is wall time without the first iteration, which is stated as `compile_s`; a resumed run goes on with
the clock of its checkpoint. The first iterations only play (`warm_up`): what they take is the simulator's share later
on, since inside one program the two cannot be told apart; with two programs both are measured.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.cluster.team import Team
from ig2mj.errors import Ig2mjError
from ig2mj.learn.checkpoints import TAKEN, Checkpoints, newest, only_run, same, whole
from ig2mj.learn.collect import TrainingEnv
from ig2mj.learn.iteration import Algorithm, ManyDevices, OneDevice
from ig2mj.learn.log import Log

EPISODES = (100, 500)
"""Return and success are told of so many of the last episodes: of as many as there are worlds, within these limits."""


@dataclasses.dataclass(frozen=True)
class Run:
    """A run.

    Attributes:
      minutes: of the run's clock. iterations: at most so many; None: until the time is over.
      seed: of everything random. out: folder of reports and checkpoints; None: nothing is kept.
      resume: go on from the newest checkpoint in `out`. save_buffer: checkpoints hold the replay buffer, too.
      checkpoint_every, log_every: seconds. until: stop once so large a share of the last episodes succeeds.
      programs: 1 or 2: of an iteration on a pure engine.
      quiet: nothing on the terminal.
    """

    minutes: float = 10.0
    iterations: int | None = None
    seed: int = 0
    out: str | pathlib.Path | None = None
    resume: bool = False
    save_buffer: bool = False
    checkpoint_every: float = 60.0
    log_every: float = 5.0
    until: float | None = None
    programs: int = 1
    quiet: bool = False


@dataclasses.dataclass
class Result:
    """How a run ended. `row`: the last report. `stopped`: "time", "iterations" or "solved"."""

    learner: Any
    row: dict[str, Any]
    iteration: int
    compile_s: float
    stopped: str


@dataclasses.dataclass
class _Window:
    """What happened since the last report, and in the last episodes.

    `last` reaches back over `episodes` episodes and `least` steps of all worlds together: over less than an episode's
    horizon those that end are mostly the short ones, and those succeed.
    """

    began: float
    episodes: int
    least: float
    last: deque[dict[str, float]] = dataclasses.field(default_factory=deque)
    steps: float = 0.0
    updates: float = 0.0
    spent: float = 0.0
    losses: dict[str, float] = dataclasses.field(default_factory=dict)

    def add(self, sums: Mapping[str, float]) -> None:
        self.last.append(dict(sums))
        episodes, steps = (sum(s[name] for s in self.last) for name in ("episodes", "steps"))
        while len(self.last) > 1:
            episodes, steps = episodes - self.last[0]["episodes"], steps - self.last[0]["steps"]
            if episodes < self.episodes or steps < self.least:
                break
            self.last.popleft()

    def mean(self) -> dict[str, float | None]:
        """Of the last episodes by name; per step, what is counted per step."""
        total = {name: sum(s[name] for s in self.last) for name in self.last[-1]}
        episodes, steps = total.pop("episodes"), total.pop("steps")
        found: dict[str, float | None] = {}
        for name, value in total.items():
            count = steps if name.startswith("reward") else episodes if steps >= self.least else 0
            found[name] = value / count if count else None
        return found


def train(
    env: TrainingEnv,
    algorithm: Algorithm,
    run: Run,
    depends: Mapping[str, Any] | None = None,
    learner: Any = None,
    devices: Sequence[Any] = (),
    team: Team | None = None,
    kept: Callable[[Any, dict[str, Any]], None] | None = None,
    compiled: Callable[[], None] | None = None,
) -> Result:
    """Trains.

    Args:
      depends: what makes the run what it is; a checkpoint of another is refused.
      learner: what to begin with; None: untrained.
      devices: where several are to share the work; `env` is then one device's part of the worlds, and the algorithm
        knows the axis (`iteration.ManyDevices`).
      team: the processes whose devices they are; the first one reads and writes the run's folder. None: this one alone.
      kept: called by the first process after every checkpoint with what was learned and the last report.
      compiled: called once, when everything is compiled and before the clock begins.

    Raises:
      Ig2mjError: a loss is not finite, nothing can be resumed, or another run has the folder.
    """
    team = team or Team()
    with only_run(run.out if team.first else None):
        return _train(env, algorithm, run, depends, learner, devices, team, kept, compiled)


def _train(
    env: TrainingEnv,
    algorithm: Algorithm,
    run: Run,
    depends: Mapping[str, Any] | None,
    learner: Any,
    devices: Sequence[Any],
    team: Team,
    kept: Callable[[Any, dict[str, Any]], None] | None,
    compiled: Callable[[], None] | None,
) -> Result:
    depends = {**(depends or {}), "algorithm": algorithm.name, "settings": dataclasses.asdict(algorithm.config)}
    key = jax.random.PRNGKey(run.seed)
    first_key, key = jax.random.split(key)
    learner = algorithm.init(first_key) if learner is None else learner
    step: Any = ManyDevices(env, algorithm, devices, team) if devices else OneDevice(env, algorithm, run.programs)
    memory = step.memory()
    checkpoints = Checkpoints(run.out) if run.out is not None else None
    log = Log(run.out if team.first else None, quiet=run.quiet or not team.first)
    clock, iteration, env_steps, resumed = 0.0, 0, 0, False
    if run.resume:
        if checkpoints is None:
            raise Ig2mjError("--resume needs --out, the folder of the run")
        tree = {"learner": learner, "key": key, **({"memory": memory} if run.save_buffer else {})}
        found = newest(checkpoints, tree, {**depends, "save_buffer": run.save_buffer}, team)
        if found is not None:
            tree, meta = found
            learner, key, memory = tree["learner"], tree["key"], tree.get("memory", memory)
            clock, iteration, env_steps = meta["seconds"], meta["iteration"], meta["env_steps"]
            resumed = True
            log.forget_after(clock)
        elif team.first and not run.quiet:
            # A scheduler that starts a killed job again needs it to go on; but the folder may be a typo.
            print(f"{run.out}: there is no checkpoint to resume, so the run begins", file=sys.stderr)
    elif team.barrier("is the folder free", checkpoints is not None and bool(checkpoints.numbers())):
        raise Ig2mjError(f"{run.out} {TAKEN}")

    learner, memory = step.place(same(learner, team), memory)
    with team.turns():
        play = step.begin(run.seed + iteration)  # a resumed run has other starts
    least = float(getattr(getattr(env, "task", env), "horizon", 0)) * step.num_worlds
    waiting = 2 if resumed and run.save_buffer else algorithm.warm_up(resumed)
    window, budget = _Window(time.monotonic(), int(np.clip(step.num_worlds, *EPISODES)), least), run.minutes * 60
    logged, saved = time.monotonic(), clock
    compile_s = simulator = math.nan
    zero = logged  # when the clock was 0
    row: dict[str, Any] = {}

    def save(learner: Any) -> None:
        if checkpoints is not None:
            tree = {"learner": learner, "key": key, **({"memory": whole(memory, team)} if run.save_buffer else {})}
            if not team.first:
                return
            meta = {"seconds": clock, "iteration": iteration, "env_steps": env_steps}
            checkpoints.save(iteration, tree, {**meta, "depends": {**depends, "save_buffer": run.save_buffer}})

    for done in range(10**12):
        began = time.monotonic()
        key, now = jax.random.split(key)
        progress = min(clock / budget, 1.0)
        if run.iterations is not None:
            progress = max(progress, iteration / run.iterations)
        learner, memory, play, sums, losses, spent = step(learner, memory, play, now, progress, done >= waiting, clock)
        told = losses.pop("clock")
        took = time.monotonic() - began
        if done == 0:
            if compiled is not None:
                compiled()
            compile_s, logged = took, time.monotonic()
            window.began, zero = logged, logged - clock
        else:
            clock = time.monotonic() - zero
            if done < waiting:
                simulator = min(took, simulator) if simulator == simulator else took
            window.spent += spent if spent is not None else min(simulator, took)
        iteration += 1
        env_steps += int(sums["steps"])
        _guard(losses, checkpoints)
        window.add(sums)
        window.steps += sums["steps"] if done else 0
        window.updates += losses.pop("updates") * (done > 0)
        window.losses = losses
        solved = run.until is not None and _solved(window, run.until)
        if team.count == 1:
            told = clock
        stopped = "solved" if solved else "time" if told >= budget else None
        if run.iterations is not None and iteration >= run.iterations:
            stopped = "iterations"
        now_s = time.monotonic()
        if now_s - logged >= run.log_every or stopped:
            passed = max(now_s - window.began, 1e-9)
            row = _row(window, passed, clock, iteration, env_steps, compile_s)
            log.row(row)
            logged, window = now_s, _Window(now_s, window.episodes, least, window.last)
        if told - saved >= run.checkpoint_every or stopped:
            save(learner)
            saved = told
            if kept is not None and team.first:
                kept(learner, {"seconds": clock, "env_steps": env_steps, **row})
            team.barrier(f"saved {iteration}")
        if stopped:
            log.close()
            return Result(learner, row, iteration, compile_s, stopped)
    raise AssertionError


def _guard(losses: dict[str, float], checkpoints: Checkpoints | None) -> None:
    """Raises Ig2mjError for numbers that are lost."""
    lost = [name for name, value in losses.items() if not math.isfinite(value)]
    whole = losses.pop("all_finite")
    if not lost and whole:
        return
    what = f"the loss {lost[0]} is {losses[lost[0]]}" if lost else "a weight of a network is not finite"
    numbers = checkpoints.numbers() if checkpoints is not None else []
    where = f"the last good checkpoint is {checkpoints.folder / str(numbers[-1])}" if checkpoints and numbers else ""
    raise Ig2mjError(f"training stopped: {what}" + (f"; {where}" if where else "; there is no checkpoint yet"))


def _solved(window: _Window, until: float) -> bool:
    episodes, steps = (sum(s[name] for s in window.last) for name in ("episodes", "steps"))
    enough = episodes >= window.episodes and steps >= window.least
    return enough and sum(s["success"] for s in window.last) >= until * episodes


def _row(
    window: _Window, passed: float, clock: float, iteration: int, env_steps: int, compile_s: float
) -> dict[str, Any]:
    simulator = min(window.spent / passed, 1.0) if window.spent == window.spent else None
    return {
        "seconds": clock,
        "iteration": iteration,
        "env_steps": env_steps,
        **window.mean(),
        "steps_per_second": window.steps / passed,
        "updates_per_second": window.updates / passed,
        "simulator_share": simulator,
        "learner_share": None if simulator is None else 1 - simulator,
        **window.losses,
        "compile_s": compile_s,
    }
