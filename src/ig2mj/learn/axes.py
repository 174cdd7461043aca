"""`evaluate_axes`: success and q of an agent on the episodes of a file, axis by axis, next to the nominal case.

Environments play as many axes as they can (`ig2mj.learn.stages`). Episodes are played in batches of as many as there
are worlds; a store has the results of those that are over (`ig2mj.cluster.journal`), so that an evaluation that was cut
off can go on with the next batch.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.journal import Journal, MemoryStore
from ig2mj.engine.registry import made_together
from ig2mj.envs.actor import Actor
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.rollout import Act, Played, play
from ig2mj.errors import PolicyServerError
from ig2mj.learn.episodes import ALL, EpisodePart, Episodes
from ig2mj.learn.evaluate import wilson
from ig2mj.learn.stages import Stage, stages
from ig2mj.process.gc_pause import Traced, compile_together

ActOf = Callable[[Environment], Act]
"""The agent of an environment, which is asked for once and plays all of its axes."""


@dataclasses.dataclass(frozen=True)
class AxisResult:
    """Of the episodes of one axis that were played to their end, in the file's order.

    Attributes:
      success, q: of each episode. numbers: theirs, in the file; (): the first ones.
    """

    axis: str
    success: Sequence[bool]
    q: Sequence[float]
    numbers: Sequence[int] = ()

    def as_dict(self) -> dict[str, Any]:
        """Rates with the limits of 95 % intervals: Wilson's of success, the normal one of the mean of q."""
        count = len(self.success)
        if not count:
            return {"success_rate": None, "success_low": None, "success_high": None, "q": None, "episodes": 0}
        low, high = wilson(sum(self.success), count)
        mean, half = float(np.mean(self.q)), 1.96 * float(np.std(self.q)) / math.sqrt(count)
        return {
            "success_rate": round(sum(self.success) / count, 4),
            "success_low": round(low, 4),
            "success_high": round(high, 4),
            "q": round(mean, 4),
            "q_low": round(max(mean - half, 0.0), 4),
            "q_high": round(min(mean + half, 1.0), 4),
            "episodes": count,
        }

    @property
    def failures(self) -> list[tuple[int, float]]:
        """Number and q of episodes without success."""
        numbers = self.numbers or range(len(self.success))
        return [(k, q) for k, done, q in zip(numbers, self.success, self.q, strict=True) if not done]


@dataclasses.dataclass(frozen=True)
class Evaluation:
    """What was measured.

    Attributes:
      results: of each axis of which an episode was played to its end, in the order of the axes.
      error: what ended it before the last episode, of a policy server. interrupted: by Ctrl-C.
    """

    results: list[AxisResult]
    error: PolicyServerError | None = None
    interrupted: bool = False


@dataclasses.dataclass(frozen=True)
class Batch:
    """Episodes that are played side by side. Attributes: part: that they belong to. first: row of the first."""

    axis: str
    part: EpisodePart
    first: int
    count: int

    @property
    def name(self) -> str:
        """In stores."""
        return f"{self.axis}.{self.part.home or 'own'}.{self.first:07d}"

    @property
    def numbers(self) -> tuple[int, ...]:
        """Of its episodes, in the file."""
        return self.part.numbers[self.first : self.first + self.count]


def batches_of(axis: str, part: EpisodePart, worlds: int) -> list[Batch]:
    """The episodes of a part in batches, of which the last may be smaller."""
    count = len(part.numbers)
    return [Batch(axis, part, first, min(worlds, count - first)) for first in range(0, count, min(worlds, count))]


class Ledger:
    """The batches of an evaluation, and what is known of them. Attributes: axes, store, total: number of batches."""

    def __init__(self, episodes: Episodes, axes: Sequence[str], count: int, worlds: int, store: MemoryStore | Journal):
        """`count`: episodes of each axis."""
        self.axes, self.store, self._worlds = tuple(axes), store, worlds
        parts = {axis: episodes.parts(axis, count) for axis in axes}
        self._batches = {
            axis: [b for part in own for b in batches_of(axis, part, worlds)] for axis, own in parts.items()
        }
        self.total = sum(map(len, self._batches.values()))

    @property
    def share(self) -> float:
        """Of the batches that are over."""
        return sum(self._over(b) for every in self._batches.values() for b in every) / self.total

    def pending(self, stage: Stage) -> list[Batch]:
        """Of a stage, those that are not over."""
        every = [b for axis in stage.axes for b in batches_of(axis, stage.part, self._worlds)]
        return [b for b in every if not self._over(b)]

    def put(self, batch: Batch, played: Played) -> None:
        """Adds one that is over."""
        self.store.put(batch.name, json.dumps({"success": played.success, "q": played.q}).encode())

    def complete(self) -> list[AxisResult]:
        """Of the axes whose batches are all over."""
        return [self._result(axis) for axis, every in self._batches.items() if all(map(self._over, every))]

    def begun(self, batch: Batch | None = None, played: Played | None = None) -> list[AxisResult]:
        """Of the axes of which a batch is over. `batch`: one that was cut off, with the episodes that were over."""
        found = []
        for axis, every in self._batches.items():
            if batch is not None and played is not None and axis == batch.axis:
                found.append(self._result(axis, _ends(batch, played.success, played.q)))
            elif any(map(self._over, every)):
                found.append(self._result(axis))
        return found

    def _over(self, batch: Batch) -> bool:
        return batch.name in self.store.names()

    def _result(self, axis: str, more: Mapping[int, tuple[bool, float]] | None = None) -> AxisResult:
        known: dict[int, tuple[bool, float]] = {}
        for batch in filter(self._over, self._batches[axis]):
            known |= _ends(batch, **json.loads(self.store.get(batch.name)))
        known |= more or {}
        numbers = sorted(known)
        return AxisResult(axis, [known[k][0] for k in numbers], [known[k][1] for k in numbers], numbers)


def _ends(batch: Batch, success: Sequence[bool], q: Sequence[float]) -> dict[int, tuple[bool, float]]:
    """Success and q of the episodes of a batch, by number."""
    return dict(zip(batch.numbers, zip(success, q, strict=True), strict=False))


def evaluate_axes(
    episodes: Episodes,
    axes: Sequence[str],
    count: int,
    act_of: ActOf,
    options: Mapping[str, Any],
    report: ProgressCallback = no_progress,
    store: MemoryStore | Journal | None = None,
    finished: Callable[[list[AxisResult]], None] = lambda results: None,
) -> Evaluation:
    """Plays the first episodes of each axis.

    Args:
      axes: names. count: episodes of each. act_of: who acts. options: of `ig2mj.make`, "worlds" among them.
      report: called with the share of what is done, 1 and a text.
      store: of batches that are over; those that it has are not played again.
      finished: called with the results of the axes that are complete whenever a batch completes one.
    """
    ledger = Ledger(episodes, axes, count, options.get("worlds", 1), MemoryStore() if store is None else store)
    try:
        pending = [s for s in stages(episodes, axes, count, options.get("robot")) if ledger.pending(s)]
        for stage, env, act in _ready(pending, ledger, act_of, options):
            cut_off = _play_stage(stage, env, act, ledger, report, finished)
            if cut_off is not None:
                return Evaluation(ledger.begun(*cut_off), cut_off[1].failed)
            del env, act  # their memory, before the next environment is made
    except KeyboardInterrupt:
        return Evaluation(ledger.begun(), interrupted=True)
    return Evaluation(ledger.complete())


def _ready(
    pending: Sequence[Stage], ledger: Ledger, act_of: ActOf, options: Mapping[str, Any]
) -> Iterator[tuple[Stage, Environment, Act]]:
    """Stages with their environments and agents, whose memory is free when the next is asked for.

    Environments of pure engines are made before the first is played, their kernels loaded and their programs compiled
    side by side; those of a stage are traced while those of the stages before it are compiled. While a stage is played
    nothing is compiled: CUDA graphs are captured then.
    """
    waiting, made = list(pending), list[tuple[Stage, Environment, Act]]()

    def make_next() -> None:
        stage = waiting.pop(0)
        env = stage.environment(options)
        made.append((stage, env, act_of(env)))

    with made_together():
        while waiting and (not made or made[-1][1].pure):
            make_next()
    compile_together(program for stage, env, act in made for program in _programs(stage, env, act, ledger))
    while made or waiting:
        if not made:
            make_next()
        yield made.pop(0)


def _programs(stage: Stage, env: Environment, act: Act, ledger: Ledger) -> list[Traced]:
    """What plays the first batch of a stage, traced; empty where the engine runs what is compiled when it is called."""
    if not env.pure:
        return []
    batch = ledger.pending(stage)[0]
    if isinstance(act, Actor):
        env.following = lambda state: [act.traced(state, env.objective.outcomes)]
    programs = stage.programs(env, batch.axis, (batch.first + np.arange(env.num_worlds)).tolist())
    env.following = None
    return programs


def _play_stage(
    stage: Stage,
    env: Environment,
    act: Act,
    ledger: Ledger,
    report: ProgressCallback,
    finished: Callable[[list[AxisResult]], None],
) -> tuple[Batch, Played] | None:
    """Plays what is pending of a stage. Returns the batch that a policy server left; None: none."""
    for batch in ledger.pending(stage):
        before = ledger.share

        def forward(share: float, of: float | None, text: str = "", axis: str = batch.axis, n: float = before) -> None:
            report(n + share / ledger.total, of, f"{axis}: {text}")

        played = _played(stage, env, act, batch, forward)
        if played.failed is not None:
            return batch, played
        ledger.put(batch, played)
        complete = ledger.complete()
        if any(result.axis == batch.axis for result in complete):
            finished(complete)
    return None


def _played(stage: Stage, env: Environment, act: Act, batch: Batch, report: ProgressCallback) -> Played:
    """Plays a batch; worlds without an episode of it play others, which do not count."""

    def start(rows: np.ndarray) -> EnvState:
        return stage.start(env, batch.axis, (batch.first + np.arange(len(rows))).tolist())

    if isinstance(act, Actor):
        act = act.seeded(batch.first // env.num_worlds)
    return play(env, act, batch.count, in_order=True, report=report, start=start)


def result_of(results: Sequence[AxisResult]) -> dict[str, Any]:
    """For JSON: "axes" by name, the combination of all axes last."""
    last = sorted(results, key=lambda r: r.axis == ALL)
    return {"axes": {r.axis: r.as_dict() for r in last}}
