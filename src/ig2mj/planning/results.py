"""Results of episodes as lines of JSON: one file for any number of runs, which a later run continues."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping
from typing import Any

from ig2mj.errors import InputError
from ig2mj.planning.solver import EpisodeResult, StepRecord
from ig2mj.planning.steps import Outcome, Step


class ResultFile:
    """Results of episodes under the same conditions.

    Attributes:
      kept: results by the number of the episode, those of the file first.
    """

    def __init__(self, file: pathlib.Path | None, conditions: Mapping[str, Any]):
        """
        Args:
          file: of lines, or None: nothing is kept on disk. conditions: of the episodes; lines of other conditions stay.

        Raises:
          InputError: a line of the file is not a result, or it cannot be written.
        """
        self._file, self._conditions = file, dict(conditions)
        self.kept: dict[int, EpisodeResult] = {}
        if file is None:
            return
        try:
            file.touch()
        except OSError as e:
            raise InputError(file, f"cannot be written: {e.strerror}", fix="choose another place") from e
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
            try:
                row = json.loads(line)
                if row["conditions"] == self._conditions:
                    self.kept[row["episode"]] = result_of(row)
            except (ValueError, KeyError, TypeError):
                raise InputError(
                    file, "is not a result of an episode", element=f"line {number}", fix="name another file"
                ) from None

    def add(self, episode: int, result: EpisodeResult) -> None:
        """Keeps a result, at once on disk."""
        self.kept[episode] = result
        if self._file is not None:
            with self._file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps({"conditions": self._conditions, "episode": episode, **row_of(result)}) + "\n")


def row_of(result: EpisodeResult) -> dict[str, Any]:
    """A result as JSON."""
    steps = [
        {
            "primitive": r.step.primitive,
            "arguments": list(r.step.arguments),
            "reason": r.outcome.reason,
            "detail": r.outcome.detail,
            "time": r.outcome.time,
            "attempts": r.outcome.attempts,
            "planning": round(r.outcome.planning, 4),
            "seconds": round(r.seconds, 3),
        }
        for r in result.steps
    ]
    return {
        "success": result.success,
        "q": result.q,
        "replans": result.replans,
        "planned": result.planned,
        "seconds": round(result.seconds, 3),
        "time": result.time,
        "ended": result.ended,
        "steps": steps,
    }


def result_of(row: Mapping[str, Any]) -> EpisodeResult:
    """A result that `row_of` wrote. Raises KeyError, TypeError: it is none."""
    steps = tuple(
        StepRecord(
            Step(s["primitive"], tuple(s["arguments"])),
            Outcome(s["reason"], s["detail"], s["time"], s["attempts"], s.get("planning", 0.0)),
            s["seconds"],
        )
        for s in row["steps"]
    )
    names = ("success", "q", "replans", "planned", "seconds", "time", "ended")
    return EpisodeResult(steps=steps, **{name: row[name] for name in names})
