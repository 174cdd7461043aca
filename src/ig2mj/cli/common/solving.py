"""What `ig2mj solve` shows: a table of steps that fills while it runs, or lines without a terminal; then figures."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from ig2mj.cli.common.printing import make_table, stdout_console

if TYPE_CHECKING:
    from ig2mj.planning.physics import PhysicsRung
    from ig2mj.planning.solver import EpisodeResult, StepRecord
    from ig2mj.planning.task_planner import TaskPlan

AHEAD = 8
"""Steps of the plan that are shown before they are carried out."""

REFRESH = 0.3
"""s of wall time between two updates of the table while a step is carried out."""

COLUMNS = (">", "primitive", "arguments", "status", ">time", "?>planned in")


class StepTable:
    """Steps of episodes: those carried out, and the plan's next ones. On stderr: a table that fills, of the first world
    that is not done, or without a terminal one line for each step."""

    def __init__(self, title: str):
        self._console = Console(stderr=True, highlight=False)
        self._title, self._terminal = title, self._console.is_terminal
        self._live = Live(console=self._console, auto_refresh=False, transient=True) if self._terminal else None
        self._numbers: Sequence[int] = (0,)
        self._plans: dict[int, tuple[TaskPlan, Sequence[StepRecord]]] = {}
        self._rung: PhysicsRung | None = None
        self._shown, self._drawn = dict[int, int](), 0.0

    def __enter__(self) -> StepTable:
        if self._live is not None:
            self._live.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        if self._live is not None:
            self._live.__exit__(*error)

    def begin(self, numbers: Sequence[int], rung: PhysicsRung | None = None) -> None:
        """Episodes begin, one in each world. `rung`: what carries out their steps by actions."""
        self._numbers, self._rung, self._plans, self._shown = list(numbers), rung, {}, {}

    def watch(self, world: int, plan: TaskPlan, records: Sequence[StepRecord]) -> None:
        """As `ig2mj.planning.solver.Watch`."""
        self._plans[world] = plan, records
        if self._live is not None:
            self._draw()
            return
        for record in records[self._shown.get(world, 0) :]:
            self._shown[world] = self._shown.get(world, 0) + 1
            print(f"{self._name(world)}: {self._shown[world]}. {line_of(record)}", file=sys.stderr, flush=True)

    def tick(self) -> None:
        """An agent step has passed."""
        if self._live is not None and time.monotonic() > self._drawn + REFRESH:
            self._draw()

    def _name(self, world: int) -> str:
        return f"{self._title}, episode {self._numbers[world]}"

    def _draw(self) -> None:
        assert self._live is not None
        going = [w for w in sorted(self._plans) if self._plans[w][0].steps] or sorted(self._plans)
        if not going:
            return
        world = going[0]
        plan, records = self._plans[world]
        since = f"{self._rung.elapsed(world):.1f} s" if self._rung is not None else ""
        rows = rows_of(records)
        rows += [
            (len(records) + k + 1, s.primitive, " ".join(s.arguments), *(("now", since) if not k else ("", "")), "")
            for k, s in enumerate(plan.steps[:AHEAD])
        ]
        room = max(4, self._live.console.height - 5)
        table = make_table(self._name(world), COLUMNS, rows[-room:], self._live.console.width)
        more = len(plan.steps) - AHEAD
        notes = [f"and {more} more steps"] if more > 0 else []
        if len(self._numbers) > 1:
            done = sum(1 for plan, _ in self._plans.values() if not plan.steps)
            notes.append(f"{len(self._numbers)} episodes side by side, {done} done")
        self._live.update(Group(table, Text(", ".join(notes))), refresh=True)
        self._drawn = time.monotonic()


def rows_of(records: Sequence[StepRecord]) -> list[tuple]:
    """Rows of `COLUMNS` for steps that were carried out."""
    return [
        (
            k + 1,
            r.step.primitive,
            " ".join(r.step.arguments),
            r.outcome.reason or "done",
            f"{r.outcome.time:.1f} s",
            f"{r.seconds:.1f} s",
        )
        for k, r in enumerate(records)
    ]


def line_of(record: StepRecord) -> str:
    """A step as text, with the reason of a failure."""
    outcome = record.outcome
    how = f"{outcome.reason}: {outcome.detail}" if outcome.reason else "done"
    return f"{record.step}: {how} ({outcome.time:.1f} s)"


def print_result(title: str, result: EpisodeResult) -> None:
    """The steps of one episode, with the reasons of failures."""
    console = stdout_console()
    console.print(make_table(title, COLUMNS, rows_of(result.steps), console.width))
    for record in result.steps:
        if not record.outcome.done:
            print(f"{record.step}: {record.outcome.reason}: {record.outcome.detail}")
    if result.ended:
        print(f"ended: {result.ended}")


def print_figures(figures: Mapping[str, Any], results: Sequence[EpisodeResult]) -> None:
    """The figures of `ig2mj.planning.solver.summary` in words."""
    count = figures["episodes"]
    reach = "episode reaches" if count == 1 else "episodes reach"
    print(
        f"{sum(r.success for r in results)} of {count} {reach} the goal; "
        f"q {figures['q']:.2f}, {figures['replans']:.1f} new plans and "
        f"{sum(r.time for r in results) / count:.0f} s of simulated time an episode, {figures['seconds']:.1f} s in all"
    )
    rows = [
        (primitive, reason, count)
        for primitive, reasons in figures["failures"].items()
        for reason, count in sorted(reasons.items(), key=lambda item: -item[1])
    ]
    if rows:
        stdout_console().print(make_table("failures", ("primitive", "reason", ">times"), rows))
