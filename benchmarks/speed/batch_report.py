"""Rows of `batch.py` made into `benchmarks/results/throughput/`: result.json, table.md and plots.

    python -m benchmarks.speed.batch_report ROWS.jsonl [ROWS.jsonl ...] [--fresh] [--out DIR]

Rows that were reported before stay, unless the same case was measured again. A row does not count where a world
overflowed or lost its numbers, where more than one world in a thousand lost an object, or where a hand that should
disturb touched nothing; it is shown all the same, marked.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
from typing import Any

import tyro
from rich.table import Table

from benchmarks.harness import plots, results

KEY = ("scene", "worlds", "case", "what", "iterations", "label")
"""What makes a case; a newer row of the same case replaces the older one."""

ASKED = {(20, "full"): 200_000, (60, "full"): 100_000, (120, "full"): 50_000, (60, "camera"): 40_000}
"""Control steps per second to reach on one H200, disturbed, by the number of objects."""

MEMORY_ASKED = 2.0
"""MB per world without cameras (same section)."""

WARM = "warm start"
"""Label of a case that was run before, so that its programs are in the cache."""

Row = dict[str, Any]


@dataclasses.dataclass
class Args:
    """What to report."""

    rows: tyro.conf.Positional[tuple[pathlib.Path, ...]]
    """Files of JSON lines."""
    fresh: bool = False
    """Leave out what was reported before."""
    out: pathlib.Path = results.RESULTS
    """Folder for results."""


def read(files: tuple[pathlib.Path, ...]) -> tuple[list[Row], list[Row]]:
    """Rows and failures, in the order of the files. Lines cut off by a time limit are passed over."""
    rows, failures = [], []
    for file in files:
        for line in file.read_text().splitlines():
            try:
                row = json.loads(line)
            except json.JSONDecodeError:
                continue
            if isinstance(row, dict) and "control_steps_per_s" in row and "case" in row:
                rows.append(row)
            elif isinstance(row, dict) and "failed" in row:
                failures.append(row)
    return rows, failures


def merged(old: list[Row], new: list[Row]) -> list[Row]:
    """The newest row of every case, by scene's size, case, what, and worlds."""
    by_case = {tuple(str(row.get(k, "")) for k in KEY): row for row in [*old, *new] if "case" in row}
    order = ("objects", "scene", "case", "what")
    return sorted(by_case.values(), key=lambda row: (*(row[k] for k in order), row["worlds"], row.get("label", "")))


def tables(rows: list[Row], failures: list[Row]) -> list[Table]:
    """What was asked against what was reached; all rows; compiling; cases that failed."""
    out = [_goals(rows), _all(rows)]
    if starts := _starts(rows):
        out.append(results.table("Seconds until the first step: programs compiled, and from the cache", *starts))
    if failures:
        lines = [[row["failed"], row["why"], (row.get("tail") or [""])[-1][:90]] for row in failures]
        out.append(results.table("Cases without a row", ["case", "why", "last line"], lines))
    return out


def _goals(rows: list[Row]) -> Table:
    lines = []
    for (objects, what), asked in ASKED.items():
        of = [r for r in rows if _size(r) == objects and r["case"] == "disturbed" and r["what"] == what]
        best = max((r for r in of if r["counts"]), key=lambda r: r["control_steps_per_s"], default=None)
        name = f"{objects} objects" + (", 128x128 RGB-D" if what == "camera" else "")
        if best is None:
            lines.append([name, f"{asked:,}", "-", "-", "-", "-"])
            continue
        rate, memory = best["control_steps_per_s"], best["peak_device_MB_per_world"]
        share = f"{rate / asked:.0%}"
        lines.append(
            [name, f"{asked:,}", f"{rate:,}", share, f"{best['worlds']:,} of {best['scene']}", f"{memory:.2f}"]
        )
    title = f"Disturbed, all states and a goal: control steps/s asked and reached (memory asked: {MEMORY_ASKED:g} MB)"
    return results.table(title, ["case", "asked", "reached", "share", "worlds", "MB/world"], lines)


def _size(row: Row) -> int:
    """The number of objects for which there is a target that a scene stands for; 0: none."""
    return next((size for size in (20, 60, 120) if 0.9 * size <= row["objects"] <= 1.15 * size), 0)


def _all(rows: list[Row]) -> Table:
    columns = ["scene, case", "objects", "worlds", "steps/s", "ms", "contact", "moved", "awake", "MB/world", "lost"]
    lines = []
    for row in rows:
        limit = f", {row['iterations']} iterations" if row.get("iterations") else ""
        label = f", {row['label']}" if row.get("label") else ""
        lost = (str(row.get(k, "-")) for k in ("capacity_overflows", "non_finite", "lost_object_worlds"))
        lines.append(
            [
                f"{row['scene']}, {row['case']}, {row['what']}{limit}{label}",
                str(row["objects"]),
                f"{row['worlds']:,}",
                f"{row['control_steps_per_s']:,}" + ("" if row["counts"] else " (does not count)"),
                f"{row['ms_per_control_step']:.2f}",
                f"{row['hand_contact_share']:.0%}" if row["case"] != "idle" else "-",
                f"{row['moved_objects_per_world']:.1f}",
                f"{row['awake_dofs_beside_the_hand']:.1f}",
                f"{row['peak_device_MB_per_world']:.2f}",
                " / ".join(lost),
            ]
        )
    title = (
        "All rows. contact: steps in which the hand presses on a loose object; moved: objects per world by over 2 cm; "
        "awake: degrees of freedom but for hand and robot; lost: worlds that overflowed / without numbers / "
        "that lost an object (not counted in older rows)"
    )
    return results.table(title, columns, lines)


def _starts(rows: list[Row]) -> tuple[list[str], list[list[str]]] | None:
    warm = {(r["scene"], r["worlds"], r["case"], r["what"]): r for r in rows if r.get("label") == WARM}
    lines = []
    for row in rows:
        again = warm.get((row["scene"], row["worlds"], row["case"], row["what"]))
        if again is not None and row.get("label") != WARM:
            name = f"{row['scene']}, {row['worlds']:,} worlds, {row['case']}, {row['what']}"
            lines.append([name, *(f"{r[k]:.1f}" for k in ("compile_s", "first_call_s") for r in (row, again))])
    columns = ["case", "compile, cold", "compile, warm", "first call, cold", "first call, warm"]
    return (columns, lines) if lines else None


def draw(rows: list[Row], folder: pathlib.Path) -> None:
    """Speed, and memory, against the number of worlds; only rows that count."""
    panels = {"disturbed": ("disturbed", "full"), "idle": ("idle", "full"), "with 128x128 RGB-D": ("", "camera")}
    for name, quantity, label, log in (
        ("plot.png", "control_steps_per_s", "control steps/s", True),
        ("memory.png", "peak_device_MB_per_world", "MB per world, most", False),
    ):
        shown: dict[str, dict[str, tuple[list[float], list[float]]]] = {}
        for title, (case, what) in panels.items():
            series: dict[str, tuple[list[float], list[float]]] = {}
            for row in rows:
                plain = row["counts"] and not row.get("label") and not row.get("iterations")
                if plain and row["what"] == what and case in ("", row["case"]):
                    which = f"{row['scene']} ({row['objects']})" + ("" if case else f", {row['case']}")
                    x, y = series.setdefault(which, ([], []))
                    x.append(row["worlds"])
                    y.append(row[quantity])
            shown[title] = series
        plots.curves(folder / name, shown, "worlds", label, log)


def main(args: Args) -> list[Row]:
    """Writes the report and returns its rows."""
    new, failures = read(args.rows)
    file = args.out / "throughput" / "result.json"
    old = json.loads(file.read_text())["rows"] if file.exists() and not args.fresh else []
    rows = merged(old, new)
    if not rows:
        raise SystemExit("error: there are no rows of throughput.py in these files")
    known = rows[-1]
    machine = {
        "what": ", ".join(sorted({row["device"] for row in rows})),
        "versions": {name: known[name] for name in ("jax", "warp", "mujoco")},
    }
    settings = {"step": "four physics steps of 1/120 s, view, all states, guards, a goal of up to ten literals"}
    folder = results.save("throughput", -1, settings, rows, tables(rows, failures), args.out, machine)
    draw(rows, folder)
    return rows


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
