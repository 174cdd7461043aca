"""`solve`: carries out plans in worlds until the goal holds, with a new plan after every step."""

from __future__ import annotations

import collections
import dataclasses
import math
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ig2mj.planning.rung import Rung
from ig2mj.planning.steps import PLACE, Outcome, PlanningError, Step
from ig2mj.planning.task_planner import TaskPlan, TaskPlanner
from ig2mj.predicates.explain import value_of
from ig2mj.predicates.logic import Atom
from ig2mj.predicates.quality import quality
from ig2mj.sampling.conditions import Condition

MOST_STEPS, EXTRA_STEPS = 4, 20
"""An episode ends after so many times the steps of its first plan, and so many more."""


@dataclasses.dataclass(frozen=True)
class StepRecord:
    """A step that was carried out, and the wall time in seconds that it took with its planning."""

    step: Step
    outcome: Outcome
    seconds: float


@dataclasses.dataclass(frozen=True)
class EpisodeResult:
    """Result of one episode.

    Attributes:
      success: the goal holds at the end. q: partial credit (`ig2mj.predicates.quality.quality`).
      steps: in order. replans: plans that are not the rest of the plan before. planned: steps of the first plan.
      seconds: wall time. time: simulated seconds. ended: why it ended without success, in words, else "".
    """

    success: bool
    q: float
    steps: tuple[StepRecord, ...]
    replans: int
    planned: int
    seconds: float
    time: float
    ended: str = ""


def brings_out(step: Step) -> bool:
    """Whether a step puts a container onto the floor for what is to be in it. Each time counts as a failure: where that
    does not last, as something falls out when the container is carried back, it is left where it is."""
    serves = step.serves
    own = serves is not None and serves.predicate == "inside" and serves.arguments[-1] == step.arguments[0]
    return own and step.primitive == "place_on_floor"


Watch = Callable[[int, TaskPlan, Sequence[StepRecord]], None]
"""Called with each new plan: number of the world, the plan, the steps before it."""


def unwatched(world: int, plan: TaskPlan, records: Sequence[StepRecord]) -> None:
    """A `Watch` that does nothing."""


@dataclasses.dataclass
class _Episode:
    start: dict[Atom, bool]
    began: float
    plan: TaskPlan | None = None
    planned: int = 0
    replans: int = 0
    records: list[StepRecord] = dataclasses.field(default_factory=list)
    failed: collections.Counter[Condition] = dataclasses.field(default_factory=collections.Counter)
    failed_steps: collections.Counter[str] = dataclasses.field(default_factory=collections.Counter)
    stuck: set[Condition] = dataclasses.field(default_factory=set)
    since: float = 0.0
    result: EpisodeResult | None = None

    def learn(self, step: Step, outcome: Outcome) -> None:
        """Remembers what failed, and what failed in the world as it is now: a step that succeeds changes it."""
        if outcome.done:
            if step.primitive not in ("navigate_to", "release"):
                self.stuck.clear()
            if step.primitive in PLACE.values():
                self._forget_places_in(step.arguments[0])
            if brings_out(step):
                self.failed_steps[str(step)] += 1
            return
        self.failed_steps[str(step)] += 1
        if step.serves is not None:
            self.failed[step.serves] += 1
            self.stuck.add(step.serves)

    def _forget_places_in(self, name: str) -> None:
        """What had no place in a container may have one where that has been put."""
        for text in [t for t in self.failed_steps if t.startswith("place_inside ") and t.endswith(f" {name}")]:
            del self.failed_steps[text]


def solve(
    planner: TaskPlanner,
    rung: Rung,
    *,
    seconds: float = math.inf,
    watch: Watch = unwatched,
    worlds: Sequence[int] | None = None,
    ended: Callable[[int, EpisodeResult], None] = lambda world, result: None,
) -> list[EpisodeResult]:
    """Solves one episode in each world of a rung.

    Args:
      seconds: wall time after which no further step is begun. watch: called with each new plan, and at the end.
      worlds: the first ones of a rung in which there is something to solve; None: all.
      ended: called with number and result of a world whose episode is over, while others go on.

    Raises:
      PlanningError: the goal cannot become true in some world's start.
    """
    solving = Solving(planner, rung, seconds=seconds, watch=watch, worlds=worlds, ended=ended)
    while not solving.done:
        solving.take(rung.advance())
    return solving.results


class Solving:
    """Episodes that are being solved, where the caller advances the rung. Arguments and errors as of `solve`."""

    def __init__(
        self,
        planner: TaskPlanner,
        rung: Rung,
        *,
        seconds: float = math.inf,
        watch: Watch = unwatched,
        worlds: Sequence[int] | None = None,
        ended: Callable[[int, EpisodeResult], None] = lambda world, result: None,
    ):
        self._planner, self._rung, self._watch, self._ended = planner, rung, watch, ended
        self._end = time.monotonic() + seconds
        self._episodes: dict[int, _Episode] = {}
        for world in range(rung.num_worlds) if worlds is None else worlds:
            self.begin(world)

    def begin(self, world: int) -> None:
        """A new episode in a world, which is planned from what holds there now. Raises as `solve`."""
        episode = _Episode(self._rung.facts(world).truth(self._planner.goal.atoms), time.monotonic())
        self._episodes[world] = episode
        self._next(world, episode)

    @property
    def done(self) -> bool:
        """All episodes are over."""
        return all(e.result is not None for e in self._episodes.values())

    @property
    def results(self) -> list[EpisodeResult]:
        """Of the episodes that are over."""
        return [e.result for e in self._episodes.values() if e.result is not None]

    @property
    def planned(self) -> int:
        """Steps of the longest first plan."""
        return max((e.planned for e in self._episodes.values()), default=0)

    def take(self, outcomes: Mapping[int, Outcome]) -> None:
        """Continues the worlds whose primitives have ended."""
        for world, outcome in outcomes.items():
            episode = self._episodes[world]
            assert episode.plan is not None
            step = episode.plan.steps[0]
            episode.records.append(StepRecord(step, outcome, time.monotonic() - episode.since))
            episode.learn(step, outcome)
            self._next(world, episode)

    def _next(self, world: int, episode: _Episode) -> None:
        """Plans again, and begins the next step or ends the episode."""
        planner, rung = self._planner, self._rung
        episode.since = time.monotonic()
        facts = rung.facts(world)
        ended = ""
        last = episode.records[-1] if episode.records else None
        begun = last.step.serves if last is not None and last.outcome.done else None
        try:
            plan = planner.plan(facts, episode.failed, begun, episode.stuck, episode.failed_steps)
        except PlanningError as e:
            if episode.plan is None:
                raise
            plan, ended = episode.plan, str(e)
        else:
            before = None if episode.plan is None else episode.plan.steps[1:]
            episode.replans += before is not None and [*map(str, plan.steps)] != [*map(str, before)]
            episode.planned = episode.planned or len(plan.steps)
            episode.plan = plan
            self._watch(world, plan, episode.records)
            if plan.steps:
                ended = rung.ended(world) or _limit(episode, self._end)
                if not ended:
                    rung.begin(world, plan.steps[0])
                    return
            elif not plan.done:
                ended = f"{plan.missing[0]} failed {episode.failed[plan.missing[0]]} times"
        truth = facts.truth(planner.goal.atoms)
        success = value_of(planner.goal.ground, truth)
        episode.result = EpisodeResult(
            success=success,
            q=1.0 if success else quality(planner.goal.ground, episode.start, truth),
            steps=tuple(episode.records),
            replans=episode.replans,
            planned=episode.planned,
            seconds=time.monotonic() - episode.began,
            time=float(sum(r.outcome.time for r in episode.records)),
            ended="" if success else ended,
        )
        self._ended(world, episode.result)


def _limit(episode: _Episode, end: float) -> str:
    """The limit that the episode has reached, in words."""
    if time.monotonic() >= end:
        return "the time limit passed"
    if len(episode.records) >= MOST_STEPS * episode.planned + EXTRA_STEPS:
        return f"{len(episode.records)} steps were not enough"
    return ""


def summary(results: Sequence[EpisodeResult], seconds: float) -> dict:
    """The figures of a run, as `ig2mj solve --json` prints them: `success_rate`, `q`, `episodes`, `replans` (mean per
    episode), `seconds` (`seconds`: wall time of all), `failures` ({primitive: {reason: count}})."""
    failures: dict[str, collections.Counter[str]] = {}
    for result in results:
        for record in result.steps:
            if not record.outcome.done:
                failures.setdefault(record.step.primitive, collections.Counter())[record.outcome.reason] += 1

    def mean(values: list[float]) -> float | None:
        return float(np.mean(values)) if values else None

    return {
        "success_rate": mean([float(r.success) for r in results]),
        "q": mean([r.q for r in results]),
        "episodes": len(results),
        "replans": mean([float(r.replans) for r in results]),
        "seconds": round(seconds, 3),
        "failures": {name: dict(count) for name, count in failures.items()},
    }
