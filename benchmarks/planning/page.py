"""`docs/notes/planned_activities.md`: which activities are solved on which rung, from rows of `activities.py`.

    python -m benchmarks.planning.page --rows FOLDER     takes rows in, in place of what is known of their activities
    python -m benchmarks.planning.page --requests FILE   takes in rows of `ig2mj plan --benchmark --out FILE`
    python -m benchmarks.planning.page                   writes the page from what was taken in before

What is taken in is one line for each activity in benchmarks/results/planning/<rung>.jsonl, or physics_<robot>.jsonl for
another robot than the humanoid, one for each primitive in requests.jsonl, and one for each other agent or condition of
physics and each commit in comparisons.jsonl next to them: other commits' comparisons are of other activities.
"""

from __future__ import annotations

import argparse
import collections
import json
import pathlib
import statistics
from collections.abc import Iterable, Sequence
from typing import Any

from benchmarks.harness.paths import RESULTS, ROOT
from benchmarks.planning.activities import RUNGS, read_rows
from benchmarks.planning.worker import DEFAULTS
from ig2mj.cli.common.plan_benchmark import COLUMNS, figure_cells, primitive_figures
from ig2mj.planning.steps import PRIMITIVES, REASONS

FOLDER = RESULTS / "planning"
PAGE = ROOT / "docs" / "notes" / "planned_activities.md"
REQUESTS, COMPARISONS = "requests.jsonl", "comparisons.jsonl"
OTHER_ROBOTS = ("fetch",)
"""Robots other than the humanoid whose rows in physics are shown activity by activity."""
LANES = {rung: rung for rung in RUNGS} | {f"physics, {robot}": f"physics_{robot}" for robot in OTHER_ROBOTS}
"""What has a column of the page, and the name of its file of results."""
ENOUGH = 0.8
"""Share of starts with which an activity counts as solved."""
SHOWN = 2
"""Reasons of failure in a row of the page."""
LISTED = 4
"""Activities of a command that are named on the page."""

Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--rows", type=pathlib.Path, nargs="*", default=(), help="folders of `activities.py --out`")
    parser.add_argument(
        "--requests", type=pathlib.Path, nargs="*", default=(), help="files of `ig2mj plan --benchmark`"
    )
    parser.add_argument("--results", type=pathlib.Path, default=FOLDER)
    parser.add_argument("--page", type=pathlib.Path, default=PAGE)
    args = parser.parse_args()
    for rung in RUNGS:
        files = [file for folder in args.rows if (file := folder / f"{rung}.jsonl").is_file()]
        if files:
            rows = read_rows(files)
            by_lane: dict[str, list[Row]] = {}
            for row in rows:
                by_lane.setdefault(lane_of(row, rung), []).append(row)
            for lane, own in by_lane.items():
                if lane:
                    take_in(own, args.results / f"{LANES[lane]}.jsonl")
            if rung == "physics":
                kept_main = read_lines(args.results / f"{rung}.jsonl")
                take_in_comparisons(by_lane.get("", []), kept_main, args.results / COMPARISONS)
    if args.requests:
        take_in_requests([row for file in args.requests for row in read_lines(file)], args.results / REQUESTS)
    kept = {lane: read_lines(args.results / f"{file}.jsonl") for lane, file in LANES.items()}
    others = read_lines(args.results / REQUESTS), read_lines(args.results / COMPARISONS)
    args.page.write_text(page(kept, *others), encoding="utf-8")
    print(args.page)


# From rows of episodes to a line for each activity.


def take_in(rows: Sequence[Row], file: pathlib.Path) -> None:
    """Replaces the lines of the rows' activities."""
    known = {line["activity"]: line for line in read_lines(file)}
    by_activity: dict[str, list[Row]] = {}
    for row in rows:
        by_activity.setdefault(row["activity"], []).append(row)
    known |= {name: condensed(name, found) for name, found in by_activity.items()}
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(json.dumps(known[name]) + "\n" for name in sorted(known)), encoding="utf-8")


def read_lines(file: pathlib.Path) -> list[Row]:
    """Lines of a file of results; none where it is not there."""
    if not file.is_file():
        return []
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]


def condensed(name: str, rows: Sequence[Row]) -> Row:
    """The episodes of an activity as one line.

    Raises:
      ValueError: the rows are of more than one protocol.
    """
    conditions = {json.dumps(row["conditions"], sort_keys=True) for row in rows}
    if len(conditions) > 1:
        raise ValueError(f"{name}: rows of different conditions: {' and '.join(sorted(conditions))}")
    rows = sorted(rows, key=lambda row: row["start"])
    steps = [step for row in rows for step in row["steps"]]
    primitives = {}
    for primitive in dict.fromkeys(s["primitive"] for s in steps):
        own = [s for s in steps if s["primitive"] == primitive]
        done = [s for s in own if not s["reason"]]
        reasons = collections.Counter(s["reason"] for s in own if s["reason"])
        primitives[primitive] = {
            "tried": len(own),
            "first": sum(s["attempts"] == 1 for s in done),
            "done": len(done),
            "reasons": dict(reasons.most_common()),
        }
    return {
        "activity": name,
        "home": next((row["home"] for row in rows if row["home"]), ""),
        "conditions": rows[0]["conditions"],
        "starts": [row["start"] for row in rows],
        "success": [int(row["success"]) for row in rows],
        "q": [round(row["q"], 3) for row in rows],
        "planned": [row["planned"] for row in rows],
        "replans": [row["replans"] for row in rows],
        "time": [round(row["time"], 1) for row in rows],
        "processor": [row["processor"] for row in rows],
        "crashed": sum(row["crashed"] for row in rows),
        "ended": dict(collections.Counter(row["ended"] for row in rows if not row["success"]).most_common()),
        "primitives": primitives,
        "commits": sorted({row["commit"] for row in rows}),
        "commands": sorted({row["command"] for row in rows}),
        "dates": sorted({row["date"] for row in rows}),
        "versions": rows[-1]["versions"],
    }


def condition_of(row: Row) -> str:
    """By what a row differs from the main ones, which are the humanoid's, such as "--doors shut"; "" for a main one."""
    conditions = row["conditions"]
    found = {"robot": robot} if (robot := conditions.get("robot") or "humanoid") != "humanoid" else {}
    found |= {"doors": conditions["doors"]} if conditions.get("doors") == "shut" else {}
    found |= {name: conditions[name] for name in DEFAULTS if name in conditions}
    return " ".join(f"--{name} {value}" for name, value in found.items())


def lane_of(row: Row, rung: str) -> str:
    """The lane that a row belongs to; "" for one of another agent or condition."""
    condition = condition_of(row)
    if not condition:
        return rung
    lane = f"{rung}, {condition.removeprefix('--robot ')}"
    return lane if lane in LANES else ""


def take_in_comparisons(rows: Sequence[Row], main: Sequence[Row], file: pathlib.Path) -> None:
    """Replaces the lines of the rows' conditions at their commits. `main`: lines of the main rows, for those of the
    same starts."""
    known = {(line["condition"], *line["commits"]): line for line in read_lines(file)}
    solved = {
        (line["activity"], start): int(success)
        for line in main
        for start, success in zip(line["starts"], line["success"], strict=True)
    }
    for condition, commit in sorted({(condition_of(row), row["commit"]) for row in rows}):
        own = [row for row in rows if (condition_of(row), row["commit"]) == (condition, commit)]
        failed = collections.Counter(
            f"{step['primitive']}: {step['reason']}" for row in own for step in row["steps"] if step["reason"]
        )
        same = [solved[key] for row in own if (key := (row["activity"], row["start"])) in solved]
        known[condition, commit] = {
            "condition": condition,
            "activities": len({row["activity"] for row in own}),
            "starts": len(own),
            "solved": sum(row["success"] for row in own),
            "solved_activities": sorted({row["activity"] for row in own if row["success"]}),
            "q": round(statistics.mean(row["q"] for row in own), 3),
            "main_starts": len(same),
            "main_solved": sum(same),
            "crashed": sum(row["crashed"] for row in own),
            "failures": dict(failed.most_common(6)),
            "ended": dict(collections.Counter(r["ended"] for r in own if not r["success"]).most_common(3)),
            "commits": [commit],
            "commands": sorted({row["command"] for row in own}),
            "versions": own[-1]["versions"],
        }
    if known:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("".join(json.dumps(known[name]) + "\n" for name in sorted(known)), encoding="utf-8")


def take_in_requests(rows: Sequence[Row], file: pathlib.Path) -> None:
    """Replaces the lines of the rows' rungs and primitives."""
    known = {(line["conditions"]["rung"], line["primitive"]): line for line in read_lines(file)}
    for conditions in {json.dumps(row["conditions"], sort_keys=True) for row in rows}:
        own = [row for row in rows if json.dumps(row["conditions"], sort_keys=True) == conditions]
        for primitive in PRIMITIVES:
            if figures := primitive_figures(own, primitive):
                said = {key: sorted({row[key] for row in own}) for key in ("commit", "command")}
                line = {"primitive": primitive, "conditions": own[0]["conditions"], **figures}
                line |= {"commits": said["commit"], "commands": said["command"], "versions": own[-1]["versions"]}
                known[own[0]["conditions"]["rung"], primitive] = line
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("".join(json.dumps(known[key]) + "\n" for key in sorted(known)), encoding="utf-8")


# From lines to the page.


def page(kept: dict[str, list[Row]], requests: Sequence[Row] = (), comparisons: Sequence[Row] = ()) -> str:
    """The page's text."""
    kept = {rung: lines for rung, lines in kept.items() if lines}
    conditions = next((lines[0]["conditions"] for lines in kept.values()), {})
    lines = [
        "# BEHAVIOR's activities, planned and carried out",
        "",
        "Written by `python -m benchmarks.planning.page` from rows of `python -m benchmarks.planning.activities`;",
        f"not by hand. Start states: split `{conditions.get('split')}`. Robot: {conditions.get('robot')}, where no",
        "other is named, with assisted grasping and the simulator's state as observation. Doors between rooms that the",
        f"goal does not name are {conditions.get('doors')} at the start. Native engine, one thread. An episode is",
        "*solved* if the goal holds at its end; *q* is its partial credit ([planning](../guide/planning.md#results)).",
        "The rungs are *symbolic* (states are set), *kinematic* (motion is planned and checked, states are set) and",
        "*physics* (the robot acts).",
        "",
        "## Rungs",
        "",
        *_rungs(kept),
        "",
        "*demonstrations an hour*: solved episodes in an hour of one core's processor time, planning included.",
        "",
        "## Activities",
        "",
        "Solved starts of all, and mean q. *steps*: of the humanoid's first plan, median. *simulated*: seconds of its",
        "episodes in physics, median. *failures*: primitives of the humanoid that failed most often on the highest",
        "rung, with the reason and how often, or why episodes ended.",
        "",
        *_activities(kept),
        "",
        "## Primitives within the activities",
        "",
        "*first try*, *with retries*: share of the steps that end with success.",
        "",
        *_primitives(kept),
        "",
        *_requests(requests),
        *_comparisons(comparisons),
        "## Provenance",
        "",
        *_provenance(kept, requests),
        "",
    ]
    return "\n".join(lines)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """`head`: titles; ">" before one sets its column flush right."""
    titles = [h.removeprefix(">") for h in head]
    marks = ["--:" if h.startswith(">") else "---" for h in head]
    return [_line(titles), "|" + "|".join(marks) + "|", *map(_line, rows)]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _share(line: Row) -> float:
    return sum(line["success"]) / len(line["success"])


def _rungs(kept: dict[str, list[Row]]) -> list[str]:
    head = (
        "rung", ">activities", ">starts",
        f">solved in at least {100 * ENOUGH:.0f} % of starts", ">at least once",
        ">mean success", ">mean q", ">demonstrations an hour", ">crashed",
    )  # fmt: skip
    rows = []
    for rung, lines in _by_commit(kept):
        spent = sum(sum(line["processor"]) for line in lines)
        solved = sum(sum(line["success"]) for line in lines)
        rows.append(
            (
                rung,
                str(len(lines)),
                str(sum(len(line["starts"]) for line in lines)),
                str(sum(_share(line) >= ENOUGH for line in lines)),
                str(sum(any(line["success"]) for line in lines)),
                _percent(statistics.mean(map(_share, lines))),
                f"{statistics.mean(statistics.mean(line['q']) for line in lines):.3f}",
                f"{3600 * solved / spent:.0f}" if spent else "-",
                str(sum(line["crashed"] for line in lines)),
            )
        )
    return table(head, rows)


def _by_commit(kept: dict[str, list[Row]]) -> Iterable[tuple[str, list[Row]]]:
    """Rungs, and each of those with rows of several commits once more for every commit."""
    for rung, lines in kept.items():
        yield rung, lines
        commits = collections.Counter(", ".join(line["commits"]) for line in lines)
        if len(commits) > 1:
            for commit, _ in commits.most_common():
                yield f"{rung}, {commit}", [line for line in lines if ", ".join(line["commits"]) == commit]


def _activities(kept: dict[str, list[Row]]) -> list[str]:
    by_rung = {rung: {line["activity"]: line for line in lines} for rung, lines in kept.items()}
    names = sorted({name for lines in by_rung.values() for name in lines})
    head = ["activity", "home", ">steps"]
    for rung in kept:
        head += [f">{rung}", ">q"]
    head += [">simulated", "failures"]
    rows = []
    for name in names:
        lines = [by_rung[rung].get(name) for rung in kept]
        there = [line for line in lines if line is not None]
        own = [by_rung[rung][name] for rung in RUNGS if name in by_rung.get(rung, {})]
        planned = [n for line in own for n in line["planned"] if n]
        cells = [name, next((x["home"] for x in there if x["home"]), "-")]
        cells.append(f"{statistics.median(planned):g}" if planned else "-")
        for line in lines:
            if line is None:
                cells += ["-", "-"]
            else:
                cells += [f"{sum(line['success'])} of {len(line['success'])}", f"{statistics.mean(line['q']):.2f}"]
        physics = by_rung.get("physics", {}).get(name)
        times = [t for t in physics["time"] if t] if physics else []
        cells += [f"{statistics.median(times):.0f}" if times else "-", _failures((own or there)[-1])]
        rows.append(cells)
    return table(head, rows)


def _failures(line: Row) -> str:
    if all(line["success"]):
        return ""
    found = [
        (count, f"{primitive}: {reason} ({count})")
        for primitive, own in line["primitives"].items()
        for reason, count in own["reasons"].items()
    ]
    said = [text for _, text in sorted(found, key=lambda pair: -pair[0])[:SHOWN]]
    return "; ".join(said or list(line["ended"])[:1]).replace("|", "/")


def _primitives(kept: dict[str, list[Row]]) -> list[str]:
    reasons = list(REASONS)
    head = ["rung", "primitive", ">steps", ">first try", ">with retries", *(f">{reason}" for reason in reasons)]
    rows = []
    for rung, lines in kept.items():
        for primitive in PRIMITIVES:
            own = [line["primitives"][primitive] for line in lines if primitive in line["primitives"]]
            tried = sum(one["tried"] for one in own)
            if tried:
                counts = [sum(one["reasons"].get(reason, 0) for one in own) for reason in reasons]
                share = [_percent(sum(one[key] for one in own) / tried) for key in ("first", "done")]
                rows.append([rung, primitive, str(tried), *share, *(str(n) if n else "" for n in counts)])
    return table(head, rows)


def _requests(lines: Sequence[Row]) -> list[str]:
    """The section on requests; none where none were measured."""
    if not lines:
        return []
    asked = max(line["asked"] for line in lines)
    rows = []
    for line in sorted(
        lines, key=lambda x: (RUNGS.index(x["conditions"]["rung"]), list(PRIMITIVES).index(x["primitive"]))
    ):
        rows.append((line["conditions"]["rung"], *figure_cells(line["primitive"], line)))
    return [
        "## Primitives, asked by themselves",
        "",
        f"`ig2mj plan --benchmark`: {asked} requests to each primitive, drawn in all homes by a seed; infeasible ones",
        "are not left out. *prepared*: what must hold first could be made to hold (the object is in a hand, ...).",
        "*symbolic*: share of the prepared ones that the symbolic rung carries out. *has a solution*: of those that",
        "this rung carries out, or the symbolic one and hands could (docs/guide/planning.md). *first try* and *with",
        "retries*: of those. *median* and *95 %*: processor seconds of planning. *failures*: of those with a solution.",
        "",
        *table(("rung", *(c.replace("?", "") for c in COLUMNS)), rows),
        "",
    ]


def _comparisons(lines: Sequence[Row]) -> list[str]:
    """The section on other agents and conditions; none where none were measured."""
    if not lines:
        return []
    rows = []
    for line in lines:
        said = [f"{name} ({count})" for name, count in line["failures"].items()][: 2 * SHOWN]
        same = f"{line['main_solved']} of {line['main_starts']}" if line["main_starts"] else "-"
        cells = [f"`{line['condition']}`", ", ".join(line["commits"])]
        cells += [str(line["activities"]), str(line["starts"]), str(line["solved"]), same]
        rows.append([*cells, f"{line['q']:.2f}", "; ".join(said or list(line["ended"])[:1]).replace("|", "/")])
    head = (
        "condition", "commit", ">activities", ">starts", ">solved", ">main rows on the same starts", ">mean q",
        "failures",
    )  # fmt: skip
    return [
        "## Other agents and conditions",
        "",
        "In physics, from the same start states ([comparisons](../guide/planning.md#comparisons)).",
        "",
        *table(head, rows),
        "",
    ]


def _provenance(kept: dict[str, list[Row]], requests: Sequence[Row]) -> list[str]:
    rows = []
    for rung in RUNGS:
        own = [line for line in requests if line["conditions"]["rung"] == rung]
        for key in ("commits", "commands"):
            found = sorted({value for line in own for value in line[key]})
            if found:
                rows.append((f"{rung}, requests", key, ", ".join(f"`{value}`" for value in found)))
    for rung, lines in kept.items():
        for key in ("commits", "commands", "dates"):
            found = sorted({value for line in lines for value in line[key]})
            found = sorted({_short(value) for value in found}) if key == "commands" else found
            rows.append((rung, key, ", ".join(f"`{value}`" for value in found)))
        versions = sorted({f"{name} {value}" for line in lines for name, value in line["versions"].items()})
        rows.append((rung, "versions", ", ".join(versions)))
    return table(("rung", "of the rows", ""), rows)


def _short(command: str) -> str:
    """A command of the activities' rows, with the number of activities in place of a long list of them."""
    before, option, names = command.partition(" --activities ")
    count = len(names.split())
    return command if count <= LISTED else f"{before}{option}({count} names)"


if __name__ == "__main__":
    main()
