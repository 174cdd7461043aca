"""The table of policies on episodes in which one thing varies at a time, in docs/notes/learning.md.

    ig2mj evaluate GraspingBook-fetch --axes all --json --out /tmp/specialist.json
    python -m benchmarks.learning.axes_table --take /tmp/specialist.json     keeps a result, on the machine that gave it
    python -m benchmarks.learning.axes_table                                 prints the table
    python -m benchmarks.learning.axes_table --write                         writes it between its marks

A result of a policy and an episode file takes the place of an earlier one.
"""

from __future__ import annotations

import argparse
import json
import pathlib
from typing import Any

from benchmarks.harness.pages import between
from benchmarks.harness.paths import RESULTS, ROOT
from benchmarks.harness.results import machine, provenance
from ig2mj.learn.episodes import EVERY

PAGE = ROOT / "docs" / "notes" / "learning.md"
ROWS = RESULTS / "randomization" / "evaluations.jsonl"
BEGIN = "<!-- begin: python -m benchmarks.learning.axes_table --write -->\n"
END = "<!-- end of the axes -->"


def rows() -> list[dict[str, Any]]:
    """Results that are kept, by task, robot and policy."""
    found = [json.loads(line) for line in ROWS.read_text(encoding="utf-8").splitlines()] if ROWS.is_file() else []
    return sorted(found, key=lambda row: (row["env"], row["robot"], row["agent"]))


def take(file: pathlib.Path) -> None:
    """Keeps the result of a whole evaluation. Raises ValueError: some axes are unfinished."""
    found = json.loads(file.read_text(encoding="utf-8"))
    if found.get("unfinished"):
        raise ValueError(f"{file}: {', '.join(found['unfinished'])} are not finished")
    counts = {axis["episodes"] for axis in found["axes"].values()}
    if len(counts) != 1:
        raise ValueError(f"{file}: axes have different numbers of episodes")
    command = f"ig2mj evaluate {found['agent']} --axes all --episodes {counts.pop()} --engine {found['engine']}"
    row = {**found, **machine(-1), **provenance(), "command": command}
    kept = [other for other in rows() if (other["agent"], other["episode_file"]) != (row["agent"], row["episode_file"])]
    ROWS.write_text("".join(json.dumps(one) + "\n" for one in [*kept, row]), encoding="utf-8")


def table() -> str:
    """A row for each axis and a column for each policy, Markdown: success with its 95 % interval.

    Raises ValueError: rows are of different numbers of episodes (a table has one protocol).
    """
    found = rows()
    counts = {axis["episodes"] for row in found for axis in row["axes"].values()}
    if len(counts) > 1:
        raise ValueError(f"{ROWS}: rows of {sorted(counts)} episodes")
    lines = [f"| axis | {' | '.join(row['agent'] for row in found)} |", "|---" + "|--:" * len(found) + "|"]
    for axis in EVERY:
        cells = [_cell(row["axes"].get(axis)) for row in found]
        if any(cells):
            lines.append(f"| `{axis}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(axis: dict[str, Any] | None) -> str:
    if axis is None:
        return ""
    rate, low, high = (100 * axis[name] for name in ("success_rate", "success_low", "success_high"))
    return f"{rate:.1f} % ({low:.0f} to {high:.0f})"


def page_with(text: str) -> str:
    """The notes with another table between the marks."""
    return between(PAGE.read_text(encoding="utf-8"), BEGIN, END, text)


def main() -> None:
    """See the module's text."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--take", nargs="+", type=pathlib.Path, default=[], metavar="FILE")
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    for file in args.take:
        take(file)
    if args.write:
        PAGE.write_text(page_with(table()), encoding="utf-8")
    elif not args.take:
        print(table())


if __name__ == "__main__":
    main()
