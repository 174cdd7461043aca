"""The table of steps that fills while `ig2mj solve` runs, and the figures at its end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from ig2mj.cli.common.printing import make_table, stdout_console

if TYPE_CHECKING:
    from ig2mj.planning.solver import EpisodeResult, StepRecord
    from ig2mj.planning.task_planner import TaskPlan

AHEAD = 8
"""Steps of the plan that are shown before they are carried out."""


class StepTable:
    """Steps of the present episode: those carried out, and the plan's next ones; on stderr, if that is a terminal."""

    def __init__(self, title: str, silent: bool = False):
        """`silent`: shows nothing."""
        console = Console(stderr=True)
        self._title, self._on = title, console.is_terminal and not silent
        self._live = Live(console=console, auto_refresh=False, transient=True) if self._on else None
        self._heading = ""

    def __enter__(self) -> StepTable:
        if self._live is not None:
            self._live.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        if self._live is not None:
            self._live.__exit__(*error)

    def begin(self, number: int, count: int) -> None:
        """An episode begins."""
        self._heading = f"{self._title}: episode {number + 1} of {count}"

    def watch(self, world: int, plan: TaskPlan, records: Sequence[StepRecord]) -> None:
        """As `ig2mj.planning.solver.Watch`."""
        if self._live is None or world:
            return
        rows = rows_of(records)
        rows += [
            (len(records) + k + 1, s.primitive, " ".join(s.arguments), "now" if not k else "", "")
            for k, s in enumerate(plan.steps[:AHEAD])
        ]
        more = len(plan.steps) - AHEAD
        table = make_table(self._heading, COLUMNS, rows, self._live.console.width)
        self._live.update(Group(table, Text(f"and {more} more steps" if more > 0 else "")), refresh=True)


COLUMNS = (">", "primitive", "arguments", "status", ">seconds")


def rows_of(records: Sequence[StepRecord]) -> list[tuple]:
    """Rows of `COLUMNS` for steps that were carried out."""
    return [
        (k + 1, r.step.primitive, " ".join(r.step.arguments), r.outcome.reason or "done", f"{r.seconds:.1f}")
        for k, r in enumerate(records)
    ]


def print_result(title: str, result: EpisodeResult) -> None:
    """The steps of one episode, with the reasons of failures."""
    console = stdout_console()
    console.print(make_table(title, COLUMNS, rows_of(result.steps), console.width))
    for record in result.steps:
        if not record.outcome.done:
            print(f"{record.step}: {record.outcome.reason}: {record.outcome.detail}")
    if result.ended:
        print(f"ended: {result.ended}")


def print_figures(figures: dict[str, Any]) -> None:
    """The figures of `ig2mj.planning.solver.summary` in words."""
    print(
        f"{figures['success_rate']:.0%} of {figures['episodes']} episodes reach the goal; q {figures['q']:.2f}, "
        f"{figures['replans']:.1f} new plans an episode, {figures['seconds']:.1f} s"
    )
    rows = [
        (primitive, reason, count)
        for primitive, reasons in figures["failures"].items()
        for reason, count in sorted(reasons.items(), key=lambda item: -item[1])
    ]
    if rows:
        stdout_console().print(make_table("failures", ("primitive", "reason", ">times"), rows))
