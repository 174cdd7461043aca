"""`ig2mj evaluate ... --axes`: a policy on episode files, as a table, as JSON and as a page."""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from ig2mj.errors import InputError
from ig2mj.learn.axes import ActOf, AxisResult, evaluate_axes, result_of
from ig2mj.learn.episodes import ALL, COUNT, Episodes, find_episodes, parse_axes


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


def play_axes(
    title: str,
    episodes: Episodes,
    axes: Sequence[str],
    count: int,
    act_of: ActOf,
    options: Mapping[str, Any],
    *,
    json: bool,
    out: pathlib.Path | None,
    page: pathlib.Path | None,
    about: Mapping[str, Any],
) -> int:
    """Plays, prints and writes. Returns the exit status: 1 where a policy server ended it before the last episode."""
    import json as form

    from ig2mj.process.progress import progress

    with progress(f"evaluating {title}") as report:
        results = evaluate_axes(episodes, axes, count, act_of, options, report)
    found = {**about, "episode_file": episodes.header["hash"], **result_of(results)}
    error = results[-1].error
    if error is not None:
        found["error"] = str(error)
        print(f"error: {error}", file=sys.stderr)
    if out is not None:
        out.write_text(form.dumps(found) + "\n", encoding="utf-8")
    if page is not None:
        from ig2mj.viewer.axes_page import write_page

        write_page(page, title, episodes, results, act_of, options)
    if json:
        print(form.dumps(found))
    else:
        _print(title, results)
    return 1 if error is not None else 0


def _print(title: str, results: Sequence[AxisResult]) -> None:
    from ig2mj.cli.common.printing import make_table, stdout_console

    nominal = results[0].as_dict()["success_rate"]
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
