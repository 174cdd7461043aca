"""One core, before and after robots moved in: writes the table of docs/notes/benchmarks.md.

    python benchmarks/before_after.py measure [--tree FOLDER --which before]   some 80 s of two quiet cores
    python benchmarks/before_after.py write                                    the table, from the newest rows

`measure` runs `states_step.py`, `native_step.py` and `idle_a7.py --sizes 60 --no-pictures`, each in a process of its
own, and adds a row for each to `results/before_after/rows.jsonl`. Another tree is measured with its own benchmarks and
sources: a checkout of an older commit (`git worktree add FOLDER COMMIT`).
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import subprocess
import sys
import tempfile
from typing import Any

import tyro

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROWS = ROOT / "benchmarks" / "results" / "before_after" / "rows.jsonl"
PAGE = ROOT / "docs" / "notes" / "benchmarks.md"
BEGIN, END = "<!-- begin: python benchmarks/before_after.py write -->\n", "<!-- end of before and after -->"

LINES = (
    ("asleep, physics and view", "native_step", "asleep"),
    ("asleep, 16 worlds on 2 threads, a world", "native_step", "asleep, 16 worlds, 2 threads"),
    ("a hand hovers, physics and view", "native_step", "hand hovers"),
    ("a hand pushes two objects, physics and view", "native_step", "hand pushes"),
    ("the humanoid stands, physics and view", "native_step", "humanoid stands"),
    ("states and a goal, an object cools", "states_step", "states and goal, an object cools"),
    ("states and a goal, one object moves", "states_step", "states and goal, one object moves"),
    ("the same, the goal is about it", "states_step", "the same, the goal is about it"),
    ("idle robot, all states", "idle_a7", "ig2mj"),
    ("the same scene, PyBullet's physics alone", "idle_a7", "pybullet"),
)
"""What the table says, and where it stands."""

OLD_NAMES = {
    "states and goal, a thing cools": "states and goal, an object cools",
    "states and goal, one thing moves": "states and goal, one object moves",
}
"""How the oldest rows call some cases."""

SAME_WORK = {"states and goal, one object moves": "the same, the goal is about it"}
"""Before, a step cost the same whatever moved."""


@dataclasses.dataclass
class Measure:
    """Takes the figures."""

    which: str = "now"
    """What the rows are called: "before" or "now"."""
    tree: pathlib.Path = ROOT
    """Whose benchmarks and sources run."""
    seconds: float = 1.5
    """Of each figure of `states_step.py` and `native_step.py`."""
    pybullet: bool = True
    """Measure PyBullet, too."""
    only: tuple[str, ...] = ("native_step", "states_step", "idle_a7")
    """Which of the benchmarks run."""


@dataclasses.dataclass
class Write:
    """Writes the table."""


def measure(args: Measure) -> None:
    """One row for each benchmark, as they come."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=args.tree, capture_output=True, text=True)
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder)
        links = out / "packages"  # under the names that these two folders have when they are installed
        links.mkdir()
        for package in ("converters", "homes"):
            (links / f"ig2mj_{package}").symlink_to(args.tree / package)
        told = ["--seconds", str(args.seconds), "--json", str(out / "found.json")]
        a7 = ["--sizes", "60", "--no-pictures", "--rounds", "5", "--rest-steps", "900"]
        a7 += ["--work", str(out / "work"), "--out", str(out), *([] if args.pybullet else ["--no-pybullet"])]
        ways = {"native_step": told, "states_step": [*told, "--worlds", "64"], "idle_a7": a7}
        for name, arguments in [(name, ways[name]) for name in args.only]:
            before = list(os.getloadavg())
            command = [sys.executable, str(args.tree / "benchmarks" / f"{name}.py"), *arguments]
            path = os.pathsep.join([str(args.tree / "src"), str(links), os.environ.get("PYTHONPATH", "")])
            done = subprocess.run(command, cwd=args.tree, env={**os.environ, "PYTHONPATH": path}, check=False)
            if done.returncode:
                print(f"{name} failed: no row", file=sys.stderr)
                continue
            found = out / "idle_a7" / "result.json" if name == "idle_a7" else out / "found.json"
            row = {"which": args.which, "commit": commit.stdout.strip(), "benchmark": name, "load_before": before}
            with ROWS.open("a", encoding="utf-8") as file:
                file.write(json.dumps({**row, "result": [json.loads(found.read_text(encoding="utf-8"))]}) + "\n")


def figures(rows: list[dict[str, Any]], before: bool) -> dict[tuple[str, str], float]:
    """Microseconds a control step, by benchmark and case; of each benchmark's newest row."""
    found: dict[tuple[str, str], float] = {}
    for row in rows:
        if (row["which"] == "before") is not before:
            continue
        found = {key: value for key, value in found.items() if key[0] != row["benchmark"]}
        for case in (case for result in row["result"] for case in result.get("rows", ())):
            if row["benchmark"] == "states_step":
                name = str(OLD_NAMES.get(case["case"], case["case"]))
                found["states_step", name] = case["microseconds"]
                if before and name in SAME_WORK:
                    found["states_step", SAME_WORK[name]] = case["microseconds"]
            elif row["benchmark"] == "native_step":
                found["native_step", case["case"]] = case["engine_us"]
            elif row["benchmark"] == "idle_a7" and case["robot"]:
                for engine, rates in case["rates"].items():
                    found["idle_a7", engine] = 1e6 / rates["steps_per_cpu_s"]
    return found


def table(rows: list[dict[str, Any]]) -> str:
    """Markdown."""
    then, now = figures(rows, True), figures(rows, False)
    newest = [row["commit"] for row in rows if row["which"] != "before"][-1]
    lines = [f"| | `dd38870` | `{newest}` |", "|---|--:|--:|"]
    for text, *key in LINES:
        pair = [shown(of.get((key[0], key[1]))) for of in (then, now)]
        if pair != ["-", "-"]:
            lines.append(f"| {text} | {pair[0]} | {pair[1]} |")
    return "\n".join(lines) + "\n"


def shown(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def write() -> None:
    """The table between its marks in docs/notes/benchmarks.md."""
    rows = [json.loads(line) for line in ROWS.read_text(encoding="utf-8").splitlines()]
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    made = before + BEGIN + "\n" + table(rows) + "\n" + END + rest.split(END)[1]
    PAGE.write_text(made, encoding="utf-8")


if __name__ == "__main__":
    chosen = tyro.cli(Measure | Write, description=__doc__)  # pyright: ignore[reportArgumentType]
    measure(chosen) if isinstance(chosen, Measure) else write()
