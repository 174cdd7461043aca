"""What a benchmark leaves behind: `result.json`, `table.md` and plots in `benchmarks/results/<name>/`."""

from __future__ import annotations

import datetime
import importlib.metadata
import json
import os
import pathlib
import platform
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from typing import Any

import msgspec
from rich.console import Console
from rich.table import Table

from benchmarks.harness.paths import RESULTS, ROOT, command_line
from ig2mj.process.processors import available

__all__ = ["RESULTS", "command", "keep_row", "keep_rows", "machine", "provenance", "save", "table"]

PACKAGES = ("mujoco", "jax", "jaxlib", "numpy", "pybullet")


def keep_row(row: dict[str, Any], file: pathlib.Path | None) -> None:
    """Prints a row as a line of JSON, and adds it to a file of such lines; None: no file."""
    line = json.dumps(row)
    print(line, flush=True)
    if file is not None:
        with file.open("a", encoding="utf-8") as opened:
            opened.write(line + "\n")


def keep_rows(rows: Iterable[dict[str, Any]], file: pathlib.Path | None) -> list[dict[str, Any]]:
    """`keep_row` of each as soon as it is there; all of them."""
    kept = []
    for row in rows:
        keep_row(row, file)
        kept.append(row)
    return kept


def machine(core: int) -> dict[str, Any]:
    """The processor, how busy it was, and versions of what ran."""
    versions = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "absent"
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "cores_used": 1 if core >= 0 else available(),
        "load_average": [round(v, 2) for v in os.getloadavg()] if hasattr(os, "getloadavg") else None,
        "system": f"{platform.system()} {platform.machine()}",
        "versions": versions,
        "ig2mj_commit": _commit(),
    }


def provenance() -> dict[str, str]:
    """Commit, command line and day of a row."""
    return {
        "commit": _commit(),
        "command": command(),
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
    }


def save(
    name: str,
    core: int,
    settings: dict[str, Any],
    rows: list[dict[str, Any]],
    tables: Sequence[Table],
    out: pathlib.Path,
    measured_on: dict[str, Any] | None = None,
) -> pathlib.Path:
    """Writes JSON and tables below `out`, prints the tables, and returns the benchmark's folder.

    `measured_on`: the machine, where that is another one than this; with "what" in a few words.
    """
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    result = {
        "benchmark": name,
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": command(),
        "machine": measured_on or machine(core),
        "settings": settings,
        "rows": rows,
    }
    (folder / "result.json").write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=1) + b"\n")
    console = Console(width=140)
    text = []
    for table in tables:
        console.print(table)
        text += [f"### {table.title}", "", *_markdown(table), ""]
    who = result["machine"]
    where = who["what"] if measured_on else f"{who['processor']}, {who['cores_used']} core used"
    text.append(f"{where}; `{result['command']}`; {result['date'][:10]}")
    (folder / "table.md").write_text("\n".join(text) + "\n")
    return folder


def command() -> str:
    """The command line, with folders reduced to their names: others have them elsewhere."""
    return shlex.join(command_line(sys.argv))


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """A table whose first column is text and whose others are numbers."""
    result = Table(title=title)
    for k, column in enumerate(columns):
        result.add_column(column, justify="left" if k == 0 else "right", no_wrap=k == 0)
    for row in rows:
        result.add_row(*row)
    return result


def _markdown(table: Table) -> list[str]:
    columns = [list(column.cells) for column in table.columns]
    lines = ["| " + " | ".join(str(c.header) for c in table.columns) + " |"]
    lines.append("|" + "|".join(":--" if k == 0 else "--:" for k in range(len(columns))) + "|")
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in zip(*columns, strict=True)]
    return lines


def _processor() -> str:
    cpuinfo = pathlib.Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _commit() -> str:
    """Of this checkout; `IG2MJ_COMMIT` names it where there is a copy of the files without git."""
    if named := os.environ.get("IG2MJ_COMMIT"):
        return named
    try:
        done = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return done.stdout.strip()
