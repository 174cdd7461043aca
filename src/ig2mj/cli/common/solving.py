"""The table of steps that fills while `ig2mj solve` runs, and the figures at its end."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from ig2mj.cli.common.printing import make_table, stdout_console

if TYPE_CHECKING:
    from ig2mj.planning.problem import Problem
    from ig2mj.planning.solver import EpisodeResult, StepRecord
    from ig2mj.planning.task_planner import TaskPlan, TaskPlanner
    from ig2mj.simulation import Simulation
    from ig2mj.viewer.video import VideoWriter
    from ig2mj.worlds.pool import Pool

AHEAD = 8
"""Steps of the plan that are shown before they are carried out."""


VIDEO_SIZE, FRAMES_PER_SECOND = (640, 480), 10
"""Pixels and 1/s of videos: one frame for each agent step."""


@dataclasses.dataclass(frozen=True)
class Options:
    """How episodes are solved: arguments of `ig2mj solve`."""

    robot: str
    worlds: int
    symbolic: bool
    doors_open: bool
    seed: int
    seconds: float
    record: pathlib.Path | None
    video: pathlib.Path | None


def solved(
    problem: Problem,
    planner: TaskPlanner,
    pool: Pool | None,
    numbers: Sequence[int],
    options: Options,
    table: StepTable,
) -> Iterator[tuple[int, EpisodeResult]]:
    """Solves episodes; their numbers and results, each as soon as it is there."""
    from ig2mj.planning.solver import solve
    from ig2mj.planning.symbolic import symbolic_episodes

    limits: dict[str, Any] = {"seconds": options.seconds, "watch": table.watch}
    if options.symbolic:
        for number, rung in symbolic_episodes(planner.domain, problem.scene, pool, numbers, options.seed):
            table.begin(number)
            yield number, solve(planner, rung, **limits)[0]
        return
    from ig2mj.simulation.solving import batched_episodes, simulated_episodes

    start = (problem, options.robot, pool, numbers)
    if options.worlds > 1:
        for chosen, rung in batched_episodes(*start, options.worlds, options.seed, options.doors_open):
            table.begin(chosen[0])
            yield from zip(chosen, solve(planner, rung, **limits), strict=True)
        return
    with contextlib.ExitStack() as files:
        film = recorder = None
        for number, rung, simulation in simulated_episodes(*start, options.seed, options.doors_open):
            table.begin(number)
            if options.record is not None and recorder is None:
                recorder = files.enter_context(simulation.record(options.record))
            if options.video is not None and film is None:
                film = files.enter_context(_film(options.video))
            if film is not None:
                rung.watch = _filming(film, simulation)
            yield number, solve(planner, rung, **limits)[0]


def _film(file: pathlib.Path) -> VideoWriter:
    from ig2mj.viewer.video import VideoWriter

    return VideoWriter(file, *VIDEO_SIZE, FRAMES_PER_SECOND)


def _filming(film: VideoWriter, simulation: Simulation) -> Callable[[], None]:
    """Adds a frame, seen from behind the robot and above."""
    import numpy as np

    from ig2mj.viewer.offscreen import FreeView

    def add() -> None:
        agent = simulation.view.agent
        x, y, z = (float(v) for v in np.asarray(agent.base_pos)[0, 0])
        camera = FreeView(lookat=(x, y, z), distance=3.0, azimuth=60.0, elevation=-45.0)
        film.add(simulation.render(camera, width=VIDEO_SIZE[0], height=VIDEO_SIZE[1]))

    return add


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

    def begin(self, number: int) -> None:
        """An episode begins."""
        self._heading = f"{self._title}: episode {number}"

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
