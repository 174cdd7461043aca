"""`chosen_runs`: which runs of a recording exports and metrics are made of."""

from __future__ import annotations

from collections.abc import Sequence

from ig2mj.demos.reader import Recording, Run
from ig2mj.errors import InputError

INCOMPLETE = "--include-incomplete (`incomplete=True`) takes those that were cut off"


def chosen_runs(recording: Recording, success_only: bool = False, incomplete: bool = False) -> list[Run]:
    """Runs with at least one step, in the order of their beginning.

    Args:
      success_only: only those that succeeded. incomplete: also those that neither terminated nor were truncated.

    Raises:
      InputError: the recording is broken.
    """
    runs = [run for run in recording.runs if run.frames > 1 and (incomplete or run.complete)]
    return [run for run in runs if run.success] if success_only else runs


def left_out(recording: Recording, chosen: Sequence[Run]) -> str:
    """What was not chosen, for people: "2 incomplete and 1 unsuccessful runs"; "" where all were."""
    taken = {run.name for run in chosen}
    others = [run for run in recording.runs if run.frames > 1 and run.name not in taken]
    cut = sum(not run.complete for run in others)
    counts = {"incomplete": cut, "unsuccessful": len(others) - cut}
    words = " and ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    return f"{words} run{'s' if len(others) > 1 else ''}" if words else ""


def advice(recording: Recording, success_only: bool, incomplete: bool) -> str:
    """The option with which a recording of which nothing was chosen has runs, or ""."""
    return INCOMPLETE if not incomplete and chosen_runs(recording, success_only, True) else ""


def some_runs(recording: Recording, success_only: bool = False, incomplete: bool = False) -> list[Run]:
    """The same for what must have a run. Raises InputError: there is none."""
    runs = chosen_runs(recording, success_only, incomplete)
    if not runs:
        others = left_out(recording, runs)
        problem = f"has nothing to export but {others}" if others else "has no run with a step"
        raise InputError(recording.file, problem, fix=advice(recording, success_only, incomplete))
    return runs
