"""`ig2mj plan --benchmark`: how often each primitive succeeds, over requests that are drawn in all homes."""

from __future__ import annotations

import json as json_module
import os
import pathlib
import statistics
from collections.abc import Mapping, Sequence
from typing import Any

Row = dict[str, Any]

TOGETHER = 8
"""Requests of one home that a process carries out, one after another."""

COLUMNS = (
    "primitive", ">asked", ">prepared", ">symbolic", ">has a solution", ">first try", ">with retries", ">median s",
    ">95 % s", "?failures",
)  # fmt: skip


def benchmark(
    rung: str,
    robot: str,
    numbers: Sequence[int],
    primitives: Sequence[str],
    seed: int,
    jobs: int,
    seconds: float,
    out: pathlib.Path | None,
    json: bool,
) -> int:
    """See `ig2mj plan --benchmark`; `numbers`: of the requests to each primitive.

    Raises:
      Ig2mjError, UnknownNameError: an argument is none.
    """
    from ig2mj.agents.registry import make_robot
    from ig2mj.cli.common.files import check_output
    from ig2mj.cli.common.jobs import follow, tell_failures
    from ig2mj.cli.common.printing import make_table, stdout_console
    from ig2mj.cluster.job_runner import Where, stream_jobs
    from ig2mj.cluster.jobs import JobSet
    from ig2mj.cluster.reporting import ONE_THREAD
    from ig2mj.cluster.versions import versions
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.planning.requests import MEASURED
    from ig2mj.planning.steps import PlanningError
    from ig2mj.process.settings import default_variables
    from ig2mj.simulation.requests import RUNGS

    if not numbers:
        raise Ig2mjError("--requests: at least one is needed")
    if min(numbers) < 0:
        raise Ig2mjError(f"--numbers {min(numbers)}: requests are numbered from 0")
    if not seconds > 0:
        raise Ig2mjError(f"--seconds {seconds:g}: must be above 0")
    if rung not in RUNGS:
        raise PlanningError(f"requests cannot be measured on the {rung} rung ({', '.join(RUNGS)} can)")
    for name in primitives:
        if name not in MEASURED:
            raise UnknownNameError("primitive", name, MEASURED)
    make_robot(robot)
    if out is not None:
        check_output(out)
    conditions = {"rung": rung, "robot": robot, "seed": seed, "doors": "open"}
    names = tuple(primitives) or MEASURED
    rows = [row for row in _read(out) if row["conditions"] == conditions]
    rows = [row for row in rows if row["primitive"] in names and row["number"] in numbers]
    work = _jobs({(row["primitive"], row["number"]) for row in rows}, names, numbers, conditions, seconds)
    if jobs != 1:
        default_variables(ONE_THREAD)
    job_set = JobSet("ig2mj.simulation.requests:measure", f"{len(numbers)} requests to each primitive, {rung}", work)
    made_by = {"conditions": conditions, "command": _command(), "commit": _commit(), "versions": versions()}
    failed: dict[str, str] = {}
    with follow(job_set.title) as progress:
        for result in stream_jobs(job_set, Where(jobs), progress=progress):
            if result.error:
                failed[result.name] = result.error
                continue
            new = [{**row, **made_by} for row in json_module.loads(result.result)]
            rows += new
            if out is not None:
                with out.open("a", encoding="utf-8") as stream:
                    stream.writelines(json_module.dumps(row) + "\n" for row in new)
    tell_failures(failed, len(work), "the same command")
    figures = {name: found for name in names if (found := primitive_figures(rows, name))}
    if json:
        print(json_module.dumps({"conditions": conditions, "primitives": figures}))
    else:
        console = stdout_console()
        shown = [figure_cells(name, found) for name, found in figures.items()]
        console.print(make_table(f"requests to primitives, {rung} rung", COLUMNS, shown, console.width))
    return 1 if failed else 0


def _jobs(
    known: set[tuple[str, int]],
    names: Sequence[str],
    numbers: Sequence[int],
    conditions: Mapping[str, Any],
    seconds: float,
) -> list[Any]:
    """Jobs for the requests that are missing, grouped by home."""
    from ig2mj.cluster.jobs import Job
    from ig2mj.simulation.requests import home_of

    seed = conditions["seed"]
    by_home: dict[str, list[tuple[str, int]]] = {}
    for number in numbers:
        for name in names:
            if (name, number) not in known:
                by_home.setdefault(home_of(name, number, seed), []).append((name, number))
    common = {"rung": conditions["rung"], "robot": conditions["robot"], "seed": seed, "seconds": seconds}
    return [
        Job(f"{home}/{k // TOGETHER:04d}", {**common, "home": home, "requests": asked[k : k + TOGETHER]})
        for home, asked in sorted(by_home.items())
        for k in range(0, len(asked), TOGETHER)
    ]


def primitive_figures(rows: Sequence[Row], primitive: str) -> Row:
    """Figures of one primitive; none where it was not asked.

    `asked`, `prepared`: requests. `symbolic`: prepared ones that the symbolic rung carries out; None: not every row
    says so. `feasible`: those that have a solution. `first_try`, `with_retries`: of the feasible ones, those that
    succeed. `planning`: median and 95th percentile, s of processor time. `failures`: counts of the reasons of feasible
    ones.
    """
    own = [row for row in rows if row["primitive"] == primitive]
    if not own:
        return {}
    prepared = [row for row in own if row["prepared"]]
    feasible = [row for row in prepared if row["solution"]]
    done = [row for row in feasible if not row["reason"]]
    reasons: dict[str, int] = {}
    for row in feasible:
        if row["reason"]:
            reasons[row["reason"]] = reasons.get(row["reason"], 0) + 1
    times = sorted(row["planning"] for row in prepared)
    last = times[min(int(0.95 * len(times)), len(times) - 1)] if times else None
    return {
        "asked": len(own),
        "prepared": len(prepared),
        "symbolic": sum(row["symbolic"] for row in prepared) if all("symbolic" in row for row in prepared) else None,
        "feasible": len(feasible),
        "first_try": sum(row["attempts"] == 1 for row in done),
        "with_retries": len(done),
        "planning": [statistics.median(times), last] if times else None,
        "failures": dict(sorted(reasons.items(), key=lambda item: -item[1])),
    }


def figure_cells(name: str, found: Row) -> tuple[str, ...]:
    """A row of `COLUMNS`."""
    prepared, feasible = found["prepared"], found["feasible"]
    median, last = found["planning"] or (0.0, 0.0)
    return (
        name,
        str(found["asked"]),
        str(prepared),
        "-" if not prepared or found.get("symbolic") is None else f"{100 * found['symbolic'] / prepared:.1f} %",
        f"{100 * feasible / prepared:.1f} %" if prepared else "-",
        f"{100 * found['first_try'] / feasible:.1f} %" if feasible else "-",
        f"{100 * found['with_retries'] / feasible:.1f} %" if feasible else "-",
        f"{median:.3f}",
        f"{last:.3f}",
        ", ".join(f"{reason} ({count})" for reason, count in found["failures"].items()),
    )


def _read(out: pathlib.Path | None) -> list[Row]:
    from ig2mj.errors import InputError

    if out is None or not out.exists():
        return []
    found = []
    for number, line in enumerate(out.read_text(encoding="utf-8").splitlines(), 1):
        try:
            row = json_module.loads(line)
        except ValueError:
            row = None
        if not isinstance(row, dict) or not {"conditions", "primitive", "number"} <= row.keys():
            raise InputError(out, "is not a result of a request", element=f"line {number}", fix="name another file")
        found.append(row)
    return found


def _command() -> str:
    import shlex
    import sys

    words = (pathlib.PurePath(word).name if "/" in word else word for word in sys.argv[1:])
    return shlex.join(["ig2mj", *words])


def _commit() -> str:
    """Of the checkout that this is, if it is one."""
    import subprocess

    root = pathlib.Path(__file__).resolve().parents[4]
    if (named := os.environ.get("IG2MJ_COMMIT")) or not (root / ".git").exists():
        return named or "unknown"
    command = ["git", "rev-parse", "--short", "HEAD"]
    try:
        return subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
