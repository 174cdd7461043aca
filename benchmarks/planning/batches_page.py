"""`docs/notes/planner.md`: the planner in many worlds, and policies that learn from its demonstrations.

    python -m benchmarks.planning.batches_page --batched FILE      takes in rows of `batched.py --out FILE`
    python -m benchmarks.planning.batches_page --policies FOLDER   takes in FOLDER/ALGORITHM/NAME.json
                                                                   (`ig2mj evaluate --json`) and NAME/progress.csv
    python -m benchmarks.planning.batches_page --learned FILE      takes in rows of `primitive_policies.py --out FILE`
    python -m benchmarks.planning.batches_page                     writes the page from what was taken in before

What is taken in is a line in benchmarks/results/planning/batched.jsonl for each activity, engine and number of worlds,
and in policies.jsonl for each activity and algorithm. What is written by hand stands in the page's last section,
`OWN`, and stays.
"""

from __future__ import annotations

import argparse
import csv
import json
import pathlib
from collections.abc import Callable, Sequence
from typing import Any

from benchmarks.harness.paths import RESULTS, ROOT
from benchmarks.harness.results import provenance
from benchmarks.planning.page import read_lines, table

FOLDER = RESULTS / "planning"
PAGE = ROOT / "docs" / "notes" / "planner.md"
BATCHED, POLICIES = "batched.jsonl", "policies.jsonl"
OWN = "## Noted"
"""Heading of the section that stays as it is."""

POINTS = 8
"""Points of a curve that are kept, at most."""

Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--batched", type=pathlib.Path, nargs="*", default=(), help="files of `batched.py --out`")
    parser.add_argument("--policies", type=pathlib.Path, nargs="*", default=(), help="folders of runs")
    parser.add_argument("--learned", type=pathlib.Path, nargs="*", default=(), help="of `primitive_policies.py --out`")
    parser.add_argument("--results", type=pathlib.Path, default=FOLDER)
    parser.add_argument("--page", type=pathlib.Path, default=PAGE)
    args = parser.parse_args()
    rows = [row for file in args.batched for row in read_lines(file)]
    take_in(rows, args.results / BATCHED, lambda row: (row["activity"], row["engine"], row["worlds"]))
    found = [row for folder in args.policies for row in policies_of(folder)]
    found += [row for file in args.learned for row in read_lines(file)]
    take_in(found, args.results / POLICIES, lambda row: (row["activity"], row["algorithm"]))
    kept = read_lines(args.results / BATCHED), read_lines(args.results / POLICIES)
    before = args.page.read_text(encoding="utf-8") if args.page.exists() else ""
    args.page.write_text(page(*kept) + own_section(before), encoding="utf-8")
    print(args.page)


def own_section(text: str) -> str:
    """What of a page is written by hand, with the line before it; "" where there is none."""
    _, heading, own = text.partition(f"\n{OWN}\n")
    return heading + own


def take_in(rows: Sequence[Row], file: pathlib.Path, key: Callable[[Row], tuple]) -> None:
    """Replaces the lines with the rows' keys."""
    if rows:
        known = {key(line): line for line in read_lines(file)} | {key(row): row for row in rows}
        file.write_text("".join(json.dumps(known[k]) + "\n" for k in sorted(known)), encoding="utf-8")


def policies_of(folder: pathlib.Path) -> list[Row]:
    """Results of the policies of a folder, with the curve of each one's training."""
    found = []
    for file in sorted(folder.glob("*/*.json")):
        text = file.read_text(encoding="utf-8").strip()
        if not text:
            continue
        result, run = json.loads(text.splitlines()[-1]), file.with_suffix("")
        progress = run / "progress.csv"
        lines = progress.read_text(encoding="utf-8").splitlines() if progress.is_file() else []
        curve = list(csv.DictReader(lines))
        some = curve[:: max(1, len(curve) // POINTS)]
        names = ("seconds", "env_steps", "actor_loss", "held_out_loss", "success")
        kept = ("episodes", "success_rate", "success_low", "success_high", "steps_per_second")
        found.append(
            {
                "activity": file.stem,
                "algorithm": file.parent.name,
                **{name: result.get(name) for name in kept},
                "curve": [{n: point[n] for n in names if point.get(n)} for point in some],
                **provenance(),
            }
        )
    return found


def page(batched: Sequence[Row], policies: Sequence[Row]) -> str:
    """The page's text."""
    head = ("activity", "engine", ">worlds", ">processes", ">episodes", ">success", ">demonstrations an hour",
            ">agent steps a second", ">planning's share of wall time", ">share of steps held still",
            ">processor s of planning")  # fmt: skip
    many = [
        (
            row["activity"],
            row["engine"],
            f"{row['worlds']:,}",
            str(row["processes"]),
            str(row["episodes"]),
            "-" if row["success_rate"] is None else f"{row['success_rate']:.0%} ({_interval(row)})",
            f"{row['demonstrations_hour']:,.0f}",
            f"{row['steps_per_second']:,.0f}",
            f"{row['planning_share']:.1%}",
            f"{row['waiting_share']:.1%}",
            f"{row['planned']:.0f} of {row['seconds'] * max(row['processes'], 1):.0f}",
        )
        for row in batched
    ]
    learned = [
        (row["activity"], row["algorithm"], str(row["episodes"]), f"{row['success_rate']:.0%} ({_interval(row)})",
         ", ".join(f"{float(p['held_out_loss']):.2f}" for p in row["curve"] if p.get("held_out_loss")) or "-")
        for row in policies if "curve" in row
    ]  # fmt: skip
    chosen = [
        (row["activity"], row["algorithm"].partition(",")[0], str(row["demonstrations"]), str(row["steps"]),
         ", ".join(f"{a:.1%}" for a in row["agreement"]), str(row["episodes"]),
         f"{row['success_rate']:.0%} ({_interval(row)})", f"{row['q']:.2f}", f"{row['primitives']:.1f}")
        for row in policies if "agreement" in row
    ]  # fmt: skip
    commits = sorted({str(row["commit"]) for row in (*batched, *policies)})
    lines = [
        "# The planner in many worlds, and policies that learn from it",
        "",
        "Written by `python -m benchmarks.planning.batches_page`; by hand only the last section. Humanoid,",
        "assisted grasping, doors between rooms open at the start.",
        "",
    ]
    if batched:
        lines += [
            "## Many worlds",
            "",
            "*planning's share*: of wall time, all that is not the environment's step. *held still*: agent steps",
            "in which a world has no program yet. *processor s*: of planning, of those that the processes had.",
            "",
            *table(head, many),
            "",
        ]
    if learned:
        lines += [
            "## Policies",
            "",
            "From the planner's demonstrations, by the state; held-out start states. *held-out loss*: of",
            "demonstrations that are not learned from, over the training.",
            "",
            *table(("activity", "algorithm", ">episodes", ">success", "held-out loss"), learned),
            "",
        ]
    if chosen:
        lines += [
            "## Policies over primitives",
            "",
            "They see which facts hold and choose the next primitive (`action_space=\"primitives\"`). Learned from",
            "the planner on the symbolic rung; played in physics, on held-out start states. *agreement*: with the",
            "planner, in demonstrations that are not learned from, after each round of DAgger.",
            "",
            *table(
                ("activity", "algorithm", ">demonstrations", ">steps", ">agreement", ">episodes", ">success", ">q",
                 ">primitives of an episode"), chosen,
            ),
            "",
        ]  # fmt: skip
    lines += [f"Commits: {', '.join(f'`{commit}`' for commit in commits)}." if commits else "No rows are taken in.", ""]
    return "\n".join(lines)


def _interval(row: Row) -> str:
    return f"{row['success_low']:.0%} to {row['success_high']:.0%}"


if __name__ == "__main__":
    main()
