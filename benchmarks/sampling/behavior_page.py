"""`docs/notes/behavior100.md`, written from the files of `behavior.py`."""

from __future__ import annotations

import json
import pathlib
import statistics
from typing import Any

TITLES = {"behavior100": "BEHAVIOR-100", "behavior1k": "BEHAVIOR-1K"}
STARTS = {"behavior100": "starts", "behavior1k": "starts1k"}
FEW = 4
"""Homes that are named in a row; of more only their number is told."""
Row = dict[str, Any]


def write_page(page: pathlib.Path, results: pathlib.Path) -> None:
    """Writes the page from `<results>/<suite>/<home>.json` of all suites that there are."""
    lines = [
        "# BEHAVIOR's activities in the homes",
        "",
        "Written by `python -m benchmarks.sampling.behavior` (and `--suite behavior1k`); not by hand.",
        "An activity *fits* a home when every object it names can be bound: to an object of the home of that",
        "synset, in the kind of room the activity asks for and able to do what it wants of it,",
        "or to one that is added from the object library.",
        "Each home was loaded with what is added, and start and goal of every activity that fits were compiled",
        "against it. `ig2mj activity show NAME` tells the conditions in words and the binding. *added*: objects from",
        "the library in the home that needs fewest (*best*). *literals*: of the goal / of the start.",
        "",
    ]
    for suite, title in TITLES.items():
        files = sorted((results / suite).glob("*.json"))
        if not files:
            continue
        homes = [json.loads(file.read_text(encoding="utf-8")) for file in files]
        lines += _suite(title, {home["home"]: home["activities"] for home in homes})
        fit = {n for home in homes for n, row in home["activities"].items() if "objects" in row}
        lines += _starts(results / STARTS[suite], suite, len(fit))
    page.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


def _starts(folder: pathlib.Path, suite: str, fit: int) -> list[str]:
    """What came of sampling the starts; `fit`: activities that fit a home."""
    rows = {f.stem: json.loads(f.read_text(encoding="utf-8")) for f in sorted(folder.glob("*.json"))}
    if not rows:
        return []
    tried = {name: len(row["seeds"]) for name, row in rows.items()}
    done = {name: sum(seed["done"] for seed in row["seeds"]) for name, row in rows.items()}
    most = max(tried.values())
    allowed = round(min(row.get("allowed", 60.0) for row in rows.values()))
    never = sum(n == 0 for n in done.values())
    enough = sum(10 * done[name] >= 8 * most for name in rows)
    option = "" if suite == "behavior100" else f" --suite {suite}"
    ten = [
        _median(row) for row in rows.values() if row.get("conditions") == 10 and any(s["done"] for s in row["seeds"])
    ]
    lines = [
        "### Starts, sampled",
        "",
        f"`python -m benchmarks.sampling.behavior_starts{option} --seeds {most} --resume`: the start of each activity,",
        f"sampled in the home to which least is added, or the next one where that fails; {allowed} s of wall time",
        "a seed (one whose first three seeds fail is not tried with more).",
        f"Run so far: {len(rows)} of {fit} that fit a home, with {most} seeds each.",
        f"**{enough} of the {len(rows)} succeed with at least 80 % of their seeds**; of all",
        f"{sum(tried.values())} seeds {sum(done.values())} succeeded, {never} activities never did.",
        "*processor*: seconds of processor time of a seed, the median (wall time on the machine of the benchmark,",
        "which did other work, was several times that); *first*: of the first seed, in which predicates are compiled.",
        "*done before*: rows in which the goal holds already.",
    ]
    if ten:
        lines += [f"An activity with ten conditions takes {statistics.median(ten):.2f} s (median of {len(ten)})."]
    lines += [
        "",
        "| activity | home | added | conditions | seeds | processor | first | done before | why others fail |",
        "|---|---|--:|--:|--:|--:|--:|--:|---|",
    ]
    for name, row in rows.items():
        spent = [seed["processor"] for seed in row["seeds"]] or [float("nan")]
        why = row.get("failed", "")
        if not why and done[name] < tried[name]:
            why = "; ".join(f"{reason} ({n})" for reason, n in list(row["reasons"].items())[:3])
        already = sum(seed["goal_holds"] for seed in row["seeds"])
        cells = (
            name,
            row["home"],
            len(row.get("added", ())),
            row.get("conditions", "-"),
            f"{done[name]} of {tried[name]}",
            f"{_median(row):.2f}",
            f"{spent[0]:.1f}",
            already or "",
            why,
        )
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return [*lines, ""]


def _median(row: Row) -> float:
    """Processor time of a seed, the first left out where there are more."""
    spent = [seed["processor"] for seed in row["seeds"]] or [float("nan")]
    return statistics.median(spent[1:] or spent)


def _suite(title: str, found: dict[str, dict[str, Row]]) -> list[str]:
    names = sorted(next(iter(found.values())))
    fit = {n: {home: rows[n] for home, rows in found.items() if "objects" in rows[n]} for n in names}
    every = [(name, home, rows[name]) for home, rows in found.items() for name in names]
    failed = [f"{name} in {home}: {row['failed']}" for name, home, row in every if "failed" in row]
    per_home = ", ".join(f"{home} {sum('objects' in row for row in rows.values())}" for home, rows in found.items())
    lines = [
        f"## {title}",
        "",
        f"{sum(map(bool, fit.values()))} of {len(names)} activities fit one of {len(found)} homes;",
        f"{len(failed)} times one that fits did not compile. Activities by home:",
        f"{per_home}.",
        *(f"- {line}" for line in failed),
        "",
        "| activity | objects | homes that fit | best | added | literals |",
        "|---|--:|---|---|--:|--:|",
    ]
    instead: set[str] = set()
    unable: set[str] = set()
    for name, homes in fit.items():
        if not homes:
            continue
        best = min(homes, key=lambda home, homes=homes: homes[home]["added"])
        row = homes[best]
        instead |= {f"{synset} ({other})" for synset, other in row["stand_ins"].items()}
        unable |= {name} if row["without_ability"] else set()
        shown = ", ".join(homes) if len(homes) <= FEW else f"{len(homes)} of {len(found)}"
        literals = f"{row['goal_literals']} / {row['start_literals']}"
        cells = (name, row["objects"], shown, best, row["added"], literals)
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    lines.append("")
    if missing := [name for name in names if not fit[name]]:
        lines += ["What the others lack, in the home that comes nearest:", ""]
        lines += ["| activity | home | lacks |", "|---|---|---|"]
        for name in missing:
            reasons = {home: rows[name].get("missing", ()) for home, rows in found.items()}
            near = min(reasons, key=lambda home, reasons=reasons: len(reasons[home]))
            lines.append(f"| {name} | {near} | {'; '.join(reasons[near])} |")
        lines.append("")
    if unable:
        lines += [
            "A condition that is to be false is asked of an object that can never fulfil it, and counts as false, in:",
            f"{', '.join(sorted(unable))}.",
            "",
        ]
    if instead:
        lines += ["Synsets that ig2mj's taxonomy does not know, and what stands in for them:"]
        lines += [f"{', '.join(sorted(instead))}.", ""]
    return lines
