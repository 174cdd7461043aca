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
import time
from collections import deque
from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError
from ig2mj.learn.checkpoints import Checkpoints
from ig2mj.learn.collect import NativeCollector, Play, TrainingEnv, begin, collect_fn
from ig2mj.learn.log import Log
from ig2mj.learn.perception import Perception

EPISODES = (100, 2000)
"""Return and success are told of so many of the last episodes: of as many as there are worlds, within these limits."""


@runtime_checkable
class Algorithm(Protocol):
    """What the loop asks of an algorithm; all methods but the properties are pure."""

    name: str
    perception: Perception
    action_size: int
    config: Any
    actor: Any
    hint: Any

    @property
    def length(self) -> int: ...

    def warm_up(self, resumed: bool) -> int: ...

    def init(self, key: Array) -> Any: ...

    def memory(self, num_worlds: int) -> Any: ...

    def noise(self, num_worlds: int) -> Any: ...

    def act(self, learner: Any, noise: Any, seen: Any, key: Array, told: Any = None) -> tuple[Array, Any, Any]: ...

    def learn(
        self, learner: Any, memory: Any, rollout: Any, key: Array, progress: Array, ready: Array
    ) -> tuple[Any, Any, dict[str, Array]]: ...


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
    """What happened since the last report, and in the last episodes."""

    began: float
    episodes: int
    last: deque[dict[str, float]] = dataclasses.field(default_factory=deque)
    steps: float = 0.0
    updates: float = 0.0
    spent: float = 0.0
    losses: dict[str, float] = dataclasses.field(default_factory=dict)

    def add(self, sums: Mapping[str, float]) -> None:
        self.last.append(dict(sums))
        while len(self.last) > 1 and sum(s["episodes"] for s in list(self.last)[1:]) >= self.episodes:
            self.last.popleft()

    def mean(self) -> dict[str, float | None]:
        """Of the last episodes by name; per step, what is counted per step."""
        total = {name: sum(s[name] for s in self.last) for name in self.last[-1]}
        episodes, steps = total.pop("episodes"), total.pop("steps")
        found: dict[str, float | None] = {}
        for name, value in total.items():
            count = steps if name.startswith("reward") else episodes
            found[name] = value / count if count else None
        return found


def train(
    env: TrainingEnv, algorithm: Algorithm, run: Run, depends: Mapping[str, Any] | None = None, learner: Any = None
) -> Result:
    """Trains.

    Args:
      depends: what makes the run what it is; a checkpoint of another is refused.
      learner: what to begin with; None: untrained.

    Raises:
      Ig2mjError: a loss is not finite, or nothing can be resumed.
    """
    depends = {**(depends or {}), "algorithm": algorithm.name, "settings": dataclasses.asdict(algorithm.config)}
    key = jax.random.PRNGKey(run.seed)
    first_key, key = jax.random.split(key)
    learner = algorithm.init(first_key) if learner is None else learner
    memory, play = algorithm.memory(env.num_worlds), begin(env, algorithm.noise(env.num_worlds), run.seed)
    checkpoints = Checkpoints(run.out) if run.out is not None else None
    log = Log(run.out, quiet=run.quiet)
    clock, iteration, env_steps, resumed = 0.0, 0, 0, False
    if run.resume:
        if checkpoints is None:
            raise Ig2mjError("--resume needs --out, the folder of the run")
        tree = {"learner": learner, "key": key, **({"memory": memory} if run.save_buffer else {})}
        found = checkpoints.newest(tree, {**depends, "save_buffer": run.save_buffer})
        if found is not None:
            tree, meta = found
            learner, key, memory = tree["learner"], tree["key"], tree.get("memory", memory)
            clock, iteration, env_steps = meta["seconds"], meta["iteration"], meta["env_steps"]
            play = begin(env, algorithm.noise(env.num_worlds), run.seed + iteration)  # not the same starts again
            resumed = True
            log.forget_after(clock)
    elif checkpoints is not None and checkpoints.numbers():
        raise Ig2mjError(f"{run.out} holds a run already: take --resume to go on with it, or another --out")

    step = _Iteration(env, algorithm, run.programs)
    waiting = 2 if resumed and run.save_buffer else algorithm.warm_up(resumed)
    window, budget = _Window(time.monotonic(), int(np.clip(env.num_worlds, *EPISODES))), run.minutes * 60
    logged = saved = time.monotonic()
    compile_s = simulator = math.nan
    zero = logged  # when the clock was 0
    row: dict[str, Any] = {}

    def save(learner: Any) -> None:
        if checkpoints is not None:
            tree = {"learner": learner, "key": key, **({"memory": memory} if run.save_buffer else {})}
            meta = {"seconds": clock, "iteration": iteration, "env_steps": env_steps}
            checkpoints.save(iteration, tree, {**meta, "depends": {**depends, "save_buffer": run.save_buffer}})

    for done in range(10**12):
        began = time.monotonic()
        key, now = jax.random.split(key)
        progress = min(clock / budget, 1.0)
        if run.iterations is not None:
            progress = max(progress, iteration / run.iterations)
        learner, memory, play, sums, losses, spent = step(learner, memory, play, now, progress, done >= waiting)
        took = time.monotonic() - began
        if done == 0:
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
        window.updates += losses.pop("updates") if done else 0
        window.losses = losses
        solved = run.until is not None and _solved(window, run.until)
        stopped = "solved" if solved else "time" if clock >= budget else None
        if run.iterations is not None and iteration >= run.iterations:
            stopped = "iterations"
        now_s = time.monotonic()
        if now_s - logged >= run.log_every or stopped:
            passed = max(now_s - window.began, 1e-9)
            row = _row(window, passed, clock, iteration, env_steps, compile_s)
            log.row(row)
            logged, window = now_s, _Window(now_s, window.episodes, window.last)
        if now_s - saved >= run.checkpoint_every or stopped:
            save(learner)
            saved = time.monotonic()
        if stopped:
            log.close()
            return Result(learner, row, iteration, compile_s, stopped)
    raise AssertionError


class _Iteration:
    """A rollout and what is learned from it: one program on a pure engine, else the parts in turn."""

    def __init__(self, env: TrainingEnv, algorithm: Algorithm, programs: int):
        self._whole = None
        if env.pure and programs == 1:

            def whole(learner: Any, memory: Any, play: Play, key: Array, progress: Array, ready: Array) -> Any:
                play_key, learn_key = jax.random.split(key)
                play, rollout, sums = collect_fn(
                    env, algorithm.perception, algorithm.act, algorithm.hint, learner, play, play_key, algorithm.length
                )
                learner, memory, losses = algorithm.learn(learner, memory, rollout, learn_key, progress, ready)
                return learner, memory, play, sums, {**losses, "all_finite": _finite(learner)}

            self._whole = jax.jit(whole, donate_argnums=(0, 1, 2))
            return

        def learn(learner: Any, memory: Any, rollout: Any, key: Array, progress: Array, ready: Array) -> Any:
            learner, memory, losses = algorithm.learn(learner, memory, rollout, key, progress, ready)
            return learner, memory, {**losses, "all_finite": _finite(learner)}

        def collect(learner: Any, play: Play, key: Array) -> Any:
            return collect_fn(
                env, algorithm.perception, algorithm.act, algorithm.hint, learner, play, key, algorithm.length
            )

        self._learn = jax.jit(learn, donate_argnums=(0, 1))
        if env.pure:
            program = jax.jit(collect, donate_argnums=1)

            def timed(learner: Any, play: Play, key: Array) -> Any:
                began = time.perf_counter()
                found = jax.block_until_ready(program(learner, play, key))
                return *found, time.perf_counter() - began

            self._collect = timed
        else:
            native = NativeCollector(env, algorithm.perception, algorithm.act, algorithm.hint)
            self._collect = lambda learner, play, key: native(learner, play, key, algorithm.length)

    def __call__(
        self, learner: Any, memory: Any, play: Play, key: Array, progress: float, ready: bool
    ) -> tuple[Any, Any, Play, dict[str, float], dict[str, float], float | None]:
        share, go = jnp.float32(progress), jnp.bool_(ready)
        if self._whole is not None:
            learner, memory, play, sums, losses = self._whole(learner, memory, play, key, share, go)
            spent = None
        else:
            play_key, learn_key = jax.random.split(key)
            play, rollout, sums, spent = self._collect(learner, play, play_key)
            learner, memory, losses = self._learn(learner, memory, rollout, learn_key, share, go)
        sums, losses = jax.device_get((sums, losses))
        return learner, memory, play, _floats(sums), _floats(losses), spent


def _finite(tree: Any) -> Array:
    floats = [a for a in jax.tree.leaves(tree) if jnp.issubdtype(a.dtype, jnp.floating)]
    return jnp.stack([jnp.isfinite(a).all() for a in floats]).all()


def _floats(tree: Mapping[str, Any]) -> dict[str, float]:
    return {name: float(np.asarray(value)) for name, value in tree.items()}


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
    episodes = sum(s["episodes"] for s in window.last)
    return episodes >= window.episodes and sum(s["success"] for s in window.last) >= until * episodes


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
