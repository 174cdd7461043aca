"""`ig2mj evaluate ... --axes`: a policy on episode files, as a table, as JSON and as a page."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from ig2mj.cli.common.jobs import opened, where_of
from ig2mj.errors import InputError
from ig2mj.learn.axes import ActOf, AxisResult, evaluate_axes, result_of
from ig2mj.learn.episodes import ALL, COUNT, NOMINAL, Episodes, find_episodes, parse_axes


def chosen_episodes(task: str, given: pathlib.Path | None) -> Episodes:
    """The episodes of a file, or those that ship for a task. Raises InputError, UnknownNameError."""
    episodes = Episodes.load(find_episodes(task if given is None else given))
    if episodes.header["task"] != task:
        fix = f"`ig2mj episodes make {task} --out FILE` writes those of {task}"
        raise InputError(given or task, f"has episodes of {episodes.header['task']}, not of {task}", fix=fix)
    return episodes


def check_episodes(axes: str, count: int | None, episodes: Episodes) -> tuple[tuple[str, ...], int]:
    """Names of axes, and episodes of each; a line on stderr where the file has fewer than asked for."""
    names, requested = parse_axes(axes), COUNT if count is None else count
    if axes.strip() == ALL:  # those that the file has
        names = tuple(name for name in names if name in episodes.axes)
    if requested > episodes.count:
        print(f"warning: --episodes {requested}: the file has {episodes.count} episodes", file=sys.stderr)
    return names, min(requested, episodes.count)


@dataclasses.dataclass(frozen=True)
class Output:
    """Where results go. Attributes: json: they are printed as JSON. out: file for JSON, of finished axes while others
    are played. page: file for a page. resume: an interrupted evaluation with the same `out` goes on."""

    json: bool = False
    out: pathlib.Path | None = None
    page: pathlib.Path | None = None
    resume: bool = False


def play_axes(
    title: str,
    episodes: Episodes,
    axes: Sequence[str],
    count: int,
    act_of: ActOf,
    options: Mapping[str, Any],
    output: Output,
    about: Mapping[str, Any],
) -> int:
    """Plays, prints and writes. Returns the exit status: 1 where a policy server ended it before the last episode.

    Raises:
      KeyboardInterrupt: after Ctrl-C, once what was measured so far is printed. InputError: an evaluation with the same
        output was interrupted and is not to go on, or had other settings. ClusterError: one is under way.
    """
    import json as form

    from ig2mj.process.progress import progress

    known = {**about, "episode_file": episodes.header["hash"]}

    def write(found: Mapping[str, Any]) -> None:
        if output.out is not None:
            output.out.write_text(form.dumps({**known, **found}) + "\n", encoding="utf-8")

    def finished(results: Sequence[AxisResult]) -> None:
        of = result_of(results)
        write({**of, "unfinished": [axis for axis in axes if axis not in of["axes"]]})

    with contextlib.ExitStack() as stack:
        journal = None
        if output.out is not None:
            settings = {name: _plain(value) for name, value in options.items()}
            request = {"command": "evaluate --axes", "axes": list(axes), "episodes": count, **known, **settings}
            journal = stack.enter_context(opened(output.out, request, where_of(1, None, output.resume)))
        with progress(f"evaluating {title}") as report:
            done = evaluate_axes(episodes, axes, count, act_of, options, report, journal, finished)
        if journal is not None and not done.interrupted and done.error is None:
            journal.finish()
    found = result_of(done.results)
    if done.error is not None:
        found["error"] = str(done.error)
        print(f"error: {done.error}", file=sys.stderr)
    if not done.interrupted:
        write(found)
    if output.page is not None and not done.interrupted:
        from ig2mj.viewer.axes_page import write_page

        write_page(output.page, title, episodes, done.results, act_of, options)
    if output.json:
        print(form.dumps({**known, **found}))
    else:
        _print(title, done.results)
    if done.interrupted:
        again = "the same command with --resume continues" if output.out else "--out FILE would keep them for --resume"
        print(f"{sum(len(r.success) for r in done.results)} episodes are over; {again}", file=sys.stderr)
        raise KeyboardInterrupt
    return 1 if done.error is not None else 0


def _plain(value: Any) -> Any:
    """A setting for the request of a journal."""
    if isinstance(value, str | int | float | bool | None):
        return value
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else str(value)


def _print(title: str, results: Sequence[AxisResult]) -> None:
    from ig2mj.cli.common.printing import make_table, stdout_console

    nominal = next((r.as_dict()["success_rate"] for r in results if r.axis == NOMINAL), None)
    rows = []
    for result in results:
        found = result.as_dict()
        if not found["episodes"]:
            rows.append((result.axis, "-", "-", "-", "-", "0"))
            continue
        less = "" if nominal is None else f"{100 * (found['success_rate'] - nominal):+.1f}"
        interval = f"{found['success_low']:.1%} to {found['success_high']:.1%}"
        q = f"{found['q']:.3f} ({found['q_low']:.3f} to {found['q_high']:.3f})"
        rows.append((result.axis, f"{found['success_rate']:.1%}", interval, less, q, str(found["episodes"])))
    columns = ("axis", "success", "95 % interval", "to nominal, %", "q (95 %)", "episodes")
    stdout_console().print(make_table(title, columns, rows))
