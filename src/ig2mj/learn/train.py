"""`train`: the loop around an algorithm: iterations until the time is over, checkpoints, reports, a guard.

On a pure engine an iteration (a rollout, and all updates on it) is one compiled program, or two where that is asked
for. On the native engine the same loop calls the compiled policy, the environment and the compiled learner in turn.

The clock of a run is wall time without compilation and the first iteration, which are stated as `compile_s`; a resumed
run goes on with the clock of its checkpoint. The first iterations only play (`warm_up`): what they take is the
simulator's share later on, since inside one program the two cannot be separated; with two programs both are measured.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import pathlib
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.cluster.team import Team
from ig2mj.errors import Ig2mjError
from ig2mj.learn.checkpoints import TAKEN, Checkpoints, newest, only_run, same, whole
from ig2mj.learn.collect import TrainingEnv, horizon_of
from ig2mj.learn.iteration import Algorithm, OneDevice, SeveralHomes
from ig2mj.learn.log import Log
from ig2mj.learn.progress import EPISODES, Window
from ig2mj.learn.settings import old_names_work
from ig2mj.learn.several_devices import ManyDevices
from ig2mj.process import entry_point
from ig2mj.process.gc_pause import Compiled, PendingCall
from ig2mj.tasks.custom.code import shown


@old_names_work
@dataclasses.dataclass(frozen=True)
class Run:
    """A run.

    Attributes:
      minutes: of the run's clock. iterations: at most so many; None: until the time is over.
      seed: of everything random. out: folder of reports and checkpoints; None: nothing is kept.
      resume: go on from the newest checkpoint in `out`. save_buffer: checkpoints hold the replay buffer, too.
      checkpoint_every, log_every: seconds. stop_at_success: stop once so large a share of the last episodes succeeds.
      programs: 1 or 2: of an iteration on a pure engine.
      homes_in_turn: of several homes an iteration steps one (`ig2mj.learn.iteration.SeveralHomes`).
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
    stop_at_success: float | None = None
    programs: int = 1
    homes_in_turn: bool = True
    quiet: bool = False


@dataclasses.dataclass
class Result:
    """How a run ended. `row`: the last report. `stopped`: "time", "iterations" or "solved"."""

    learner: Any
    row: dict[str, Any]
    iteration: int
    compile_s: float
    stopped: str


@entry_point
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
        knows the axis (`several_devices.ManyDevices`).
      team: the processes whose devices they are; the first one reads and writes the run's folder. None: this one alone.
      kept: called by the first process after every checkpoint with what was learned and the last report.
      compiled: called once, when everything is compiled and before the clock begins.

    Raises:
      Ig2mjError: a loss is not finite, nothing can be resumed, or another run has the folder.
    """
    team = team or Team()
    with only_run(run.out if team.first else None):
        training = _Training(env, algorithm, run, depends or {}, learner, devices, team)
        return training.until_stopped(kept or (lambda *_: None), compiled or (lambda: None))


class _Training:
    """A run: what is learned, and how far it is."""

    def __init__(
        self,
        env: TrainingEnv,
        algorithm: Algorithm,
        run: Run,
        depends: Mapping[str, Any],
        learner: Any,
        devices: Sequence[Any],
        team: Team,
    ):
        settings = dataclasses.asdict(algorithm.config)
        self.run, self.team = run, team
        code = getattr(getattr(env, "task", None), "code", None)
        self.file = None if code is None else code.file
        self.depends = {**depends, "algorithm": algorithm.name, "settings": settings, "save_buffer": run.save_buffer}
        first_key, self.key = jax.random.split(jax.random.PRNGKey(run.seed))
        self.untrained: PendingCall | None = None
        """Makes the learner, of which `learner` has only the shapes until then."""
        if learner is None:
            self.untrained = PendingCall(Compiled(algorithm.init), first_key)
            learner = self.untrained.returned
            if devices or run.resume:
                learner, self.untrained = self.untrained.result(), None
        self.learner = learner
        several = getattr(env, "envs", ())
        if several and devices:
            raise Ig2mjError("several homes are for one device (--devices 1)")
        self.step: Any = (
            SeveralHomes(env, algorithm, run.homes_in_turn)
            if several
            else ManyDevices(env, algorithm, devices, team)
            if devices
            else OneDevice(env, algorithm, run.programs)
        )
        self.buffer = self.step.buffer()
        self.checkpoints = Checkpoints(run.out) if run.out is not None else None
        self.log = Log(run.out if team.first else None, quiet=run.quiet or not team.first, minutes=run.minutes)
        self.clock, self.iteration, self.env_steps = 0.0, 0, 0
        resumed = self._resume() if run.resume else self._begin()
        self.waiting = 2 if resumed and run.save_buffer else algorithm.warm_up(resumed) * getattr(self.step, "turns", 1)
        """Of the iterations of this process the first that learns."""
        self.horizon = float(horizon_of(env))

    def _begin(self) -> bool:
        kept = self.checkpoints is not None and bool(self.checkpoints.numbers())
        if self.team.barrier("is the folder free", kept):
            raise Ig2mjError(f"{self.run.out} {TAKEN}")
        return False

    def _resume(self) -> bool:
        """Goes on from the newest checkpoint; False: there is none."""
        if self.checkpoints is None:
            raise Ig2mjError("--resume needs --out, the folder of the run")
        found = newest(self.checkpoints, self._tree(self.buffer), self.depends, self.team)
        if found is None:
            if self.team.first and not self.run.quiet:
                # A scheduler that starts a killed job again needs it to go on; but the folder may be a typo.
                print(f"{self.run.out}: there is no checkpoint to resume, so the run begins", file=sys.stderr)
            return False
        tree, meta = found
        self.learner, self.key, self.buffer = tree["learner"], tree["key"], tree.get("buffer", self.buffer)
        self.clock, self.iteration, self.env_steps = (meta[name] for name in ("seconds", "iteration", "env_steps"))
        self.log.forget_after(self.clock)
        return True

    def _tree(self, buffer: Any) -> dict[str, Any]:
        """What a checkpoint holds."""
        return {"learner": self.learner, "key": self.key, **({"buffer": buffer} if self.run.save_buffer else {})}

    def _save(self) -> None:
        """Writes a checkpoint; all processes of a team take part where it holds their replay buffers."""
        if self.checkpoints is None:
            return
        tree = self._tree(whole(self.buffer, self.team) if self.run.save_buffer else None)
        if self.team.first:
            meta = {"seconds": self.clock, "iteration": self.iteration, "env_steps": self.env_steps}
            self.checkpoints.save(self.iteration, tree, {**meta, "depends": self.depends})

    def until_stopped(self, kept: Callable[[Any, dict[str, Any]], None], compiled: Callable[[], None]) -> Result:
        """Iterations until the run is over; see `train`."""
        run, team, worlds = self.run, self.team, self.step.num_worlds
        beforehand = time.monotonic()
        if self.untrained is None:
            self.learner, self.buffer = self.step.place(same(self.learner, team), self.buffer)
        if isinstance(self.step, OneDevice | SeveralHomes):
            self.step.compile_beforehand(self.learner, self.buffer, self.key, run.seed + self.iteration)
        if self.untrained is not None:
            self.learner, self.untrained = same(self.untrained.result(), team), None
            self.learner, self.buffer = self.step.place(self.learner, self.buffer)
        beforehand = time.monotonic() - beforehand
        with team.turns():
            play = self.step.begin(run.seed + self.iteration)  # a resumed run has other starts
        zero = logged = time.monotonic()  # `zero`: when the clock was 0
        window = Window(logged, int(np.clip(worlds, *EPISODES)), self.horizon * worlds)
        saved, compile_s, simulator = self.clock, math.nan, math.nan
        row, counted = dict[str, Any](), 0
        for done in itertools.count():
            began = time.monotonic()
            play, sums, losses, spent = self._iterate(play, done >= self.waiting)
            clock = losses.pop("clock")
            now = time.monotonic()
            took = now - began
            if done == 0:
                compiled()
                compile_s, logged = beforehand + took, time.monotonic()
                window.began, zero = logged, logged - self.clock
            else:
                self.clock = time.monotonic() - zero
                if done < self.waiting:
                    simulator = min(took, simulator) if simulator == simulator else took
                window.spent += spent if spent is not None else min(simulator, took)
            _guard_rewards(sums, self.file)
            _guard(losses, self.checkpoints)
            window.add(sums)
            updates = losses.pop("updates")
            if done:
                window.steps, window.updates = window.steps + sums["steps"], window.updates + updates
            window.losses = losses
            clock = self.clock if team.count == 1 else clock
            stopped = self._stopped(window, clock)
            now = time.monotonic()
            if now - logged >= run.log_every or stopped:
                counters = {"seconds": self.clock, "iteration": self.iteration, "env_steps": self.env_steps}
                row = {**counters, **window.mean(), **window.rates(now), **losses, "compile_s": compile_s}
                self.log.row(row)
                counted = window.counted()
                logged, window = now, window.next(now)
            if clock - saved >= run.checkpoint_every or stopped:
                self._save()
                saved = clock
                if team.first:
                    kept(self.learner, {"seconds": self.clock, "env_steps": self.env_steps, "counted": counted, **row})
                team.barrier(f"saved {self.iteration}")
            if stopped:
                self.log.close()
                return Result(self.learner, row, self.iteration, compile_s, stopped)
        raise AssertionError

    def _iterate(self, play: Any, learns: bool) -> tuple[Any, dict[str, float], dict[str, float], float | None]:
        """One iteration; the worlds after it, sums over its episodes, losses, and the simulator's seconds if known."""
        self.key, now = jax.random.split(self.key)
        progress = min(self.clock / (self.run.minutes * 60), 1.0)
        if self.run.iterations is not None:
            progress = max(progress, self.iteration / self.run.iterations)
        self.learner, self.buffer, play, sums, losses, spent = self.step(
            self.learner, self.buffer, play, now, progress, learns, self.clock
        )
        self.iteration += 1
        self.env_steps += int(sums["steps"])
        return play, sums, losses, spent

    def _stopped(self, window: Window, clock: float) -> str | None:
        """Why the run is over: "iterations", "solved" or "time"; None: it goes on. `clock`: the team's."""
        if self.run.iterations is not None and self.iteration >= self.run.iterations:
            return "iterations"
        if self.run.stop_at_success is not None and window.solved(self.run.stop_at_success):
            return "solved"
        return "time" if clock >= self.run.minutes * 60 else None


def _guard_rewards(sums: dict[str, float], file: str | None) -> None:
    """Raises Ig2mjError where a term of the reward is not finite. `file`: of the task, where it is the user's."""
    for name, value in sums.items():
        if name.startswith("reward/") and not math.isfinite(value):
            where = "" if file is None else f"{shown(file)}: "
            term = name.removeprefix("reward/")
            raise Ig2mjError(f"{where}training stopped: the reward's term '{term}' is {value}, and must be finite")


def _guard(losses: dict[str, float], checkpoints: Checkpoints | None) -> None:
    """Raises Ig2mjError where a loss or a weight is not finite."""
    lost = [name for name, value in losses.items() if not math.isfinite(value)]
    whole = losses.pop("all_finite")
    if not lost and whole:
        return
    what = f"the loss {lost[0]} is {losses[lost[0]]}" if lost else "a weight of a network is not finite"
    numbers = checkpoints.numbers() if checkpoints is not None else []
    where = f"the last good checkpoint is {checkpoints.folder / str(numbers[-1])}" if checkpoints and numbers else ""
    raise Ig2mjError(f"training stopped: {what}" + (f"; {where}" if where else "; there is no checkpoint yet"))
