"""`chosen_runs`: selects the runs of a recording for exports and metrics."""

from __future__ import annotations

from collections.abc import Sequence

from ig2mj.demos.reader import Recording, Run
from ig2mj.errors import InputError

INCOMPLETE = "--include-incomplete (`incomplete=True`) takes those that were cut off"


def chosen_runs(recording: Recording, success_only: bool = False, incomplete: bool = False) -> list[Run]:
    """Runs with at least one step, in the order of their beginning.

    Args:
      success_only: successful runs only. incomplete: also runs that neither terminated nor were truncated.

    Raises:
      InputError: the recording is broken.
    """
    runs = [run for run in recording.runs if run.frames > 1 and (incomplete or run.complete)]
    return [run for run in runs if run.success] if success_only else runs


def left_out(recording: Recording, chosen: Sequence[Run]) -> str:
    """The omitted runs as text: "2 incomplete and 1 unsuccessful runs"; "" for none."""
    taken = {run.name for run in chosen}
    others = [run for run in recording.runs if run.frames > 1 and run.name not in taken]
    cut = sum(not run.complete for run in others)
    counts = {"incomplete": cut, "unsuccessful": len(others) - cut}
    words = " and ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    return f"{words} run{'s' if len(others) > 1 else ''}" if words else ""


def advice(recording: Recording, success_only: bool, incomplete: bool) -> str:
    """The option that selects runs of a recording without selected ones; "" without one."""
    return INCOMPLETE if not incomplete and chosen_runs(recording, success_only, True) else ""


def some_runs(recording: Recording, success_only: bool = False, incomplete: bool = False) -> list[Run]:
    """As `chosen_runs`. Raises InputError: there is none."""
    runs = chosen_runs(recording, success_only, incomplete)
    if not runs:
        others = left_out(recording, runs)
        problem = f"has nothing to export but {others}" if others else "has no run with a step"
        raise InputError(recording.file, problem, fix=advice(recording, success_only, incomplete))
    return runs
