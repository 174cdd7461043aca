"""What a run reports: a line on the terminal, `progress.csv`, and TensorBoard's file."""

from __future__ import annotations

import csv
import os
import pathlib
import sys
from collections.abc import Mapping
from typing import Any

from ig2mj.learn.curves import Curves

LOSSES = 3
"""So many losses stand in a line of the terminal, before an episode has ended."""


class Log:
    """Writes rows of numbers to a run's folder."""

    def __init__(
        self,
        run: str | os.PathLike | None,
        *,
        quiet: bool = False,
        minutes: float | None = None,
    ):
        """
        Args:
          run: the folder; None: only the terminal. quiet: nothing on the terminal.
          minutes: of the run, for the lines on the terminal.
        """
        self._folder = None if run is None else pathlib.Path(run)
        self._quiet, self._board, self._minutes = quiet, None, minutes
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._board = Curves(self._folder)

    def forget_after(self, seconds: float) -> None:
        """Drops the rows after a checkpoint, which a resumed run writes again."""
        file = self._file
        if file is None or not file.exists():
            return
        with file.open(newline="", encoding="utf-8") as f:
            rows = [r for r in csv.DictReader(f) if r.get("seconds") and float(r["seconds"]) <= seconds]
        file.unlink()
        for row in rows:
            self._append(file, row)

    def row(self, values: Mapping[str, float | int | None]) -> None:
        """One row: a line on the terminal, a line of the CSV, a point of every curve."""
        if self._file is not None:
            self._append(self._file, {k: _number(v) for k, v in values.items()})
        if self._board is not None:
            points = {name: value for name, value in values.items() if value is not None and name != "env_steps"}
            self._board.add(int(values["env_steps"] or 0), points)
        if not self._quiet:
            print(_line(values, self._minutes), file=sys.stderr, flush=True)

    def close(self) -> None:
        """Ends TensorBoard's file."""
        if self._board is not None:
            self._board.close()

    @property
    def _file(self) -> pathlib.Path | None:
        return None if self._folder is None else self._folder / "progress.csv"

    def _append(self, file: pathlib.Path, row: Mapping[str, Any]) -> None:
        new = not file.exists()
        names = list(row)
        if not new:
            with file.open(newline="", encoding="utf-8") as f:
                names = next(csv.reader(f), names)
        with file.open("a", newline="", encoding="utf-8") as f:
            writer = csv.DictWriter(f, names, restval="", extrasaction="ignore")
            if new:
                writer.writeheader()
            writer.writerow(row)


def _number(value: float | int | None) -> str:
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _line(v: Mapping[str, Any], minutes: float | None = None) -> str:
    """Before an episode has ended, losses stand in place of return and success."""

    def text(name: str, form: str) -> str:
        return "-" if v.get(name) is None else format(v[name], form)

    whole = "" if minutes is None else f" of {60 * minutes:.0f}"
    parts = [f"{v['seconds']:7.1f}{whole} s"]
    if v["steps_per_second"] is not None:
        parts.append(f"{v['env_steps'] / 1e6:7.3f} M steps")
    else:  # no environment is stepped
        parts.append(f"{v['env_steps']:,} updates")
    if v.get("success") is not None:
        parts.append(f"return {text('return', '.3f')}  success {text('success', '.1%')}")
    else:
        losses = [name for name, value in v.items() if "loss" in name and value is not None][:LOSSES]
        parts += [f"{name} {v[name]:.4g}" for name in losses] or ["no episode has ended yet"]
    if v["steps_per_second"] is not None:
        parts.append(f"{v['steps_per_second']:,.0f} steps/s")
    parts.append(f"{v['updates_per_second']:,.0f} updates/s")
    if v.get("learner_share") is not None:
        parts.append(f"learner {text('learner_share', '.0%')}  simulator {text('simulator_share', '.0%')}")
    return "  ".join(parts)
