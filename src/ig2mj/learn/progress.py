"""What a run reports of its last episodes and of the time since its last report."""

from __future__ import annotations

import dataclasses
from collections import deque
from collections.abc import Mapping
from typing import Any

EPISODES = (100, 500)
"""Return and success are of so many of the last episodes: of as many as there are worlds, within these limits."""

OF_HOMES = ("episodes", "success")
"""Sums of which trainings in several homes also have one of each home, as `success/birch`."""


@dataclasses.dataclass
class Window:
    """What happened since the last report, and in the last episodes.

    `last` reaches back over `episodes` episodes and `least` steps of all worlds together: over less than an episode's
    horizon those that end are mostly the short ones, and those succeed.

    Attributes:
      began: `time.monotonic()` of the last report. steps, updates: since then, of all worlds together.
      spent: seconds of the simulator since then; not a number where it is unknown. losses: the newest.
    """

    began: float
    episodes: int
    least: float
    last: deque[dict[str, float]] = dataclasses.field(default_factory=deque)
    steps: float = 0.0
    updates: float = 0.0
    spent: float = 0.0
    losses: dict[str, float] = dataclasses.field(default_factory=dict)

    def add(self, sums: Mapping[str, float]) -> None:
        """Counts an iteration's `sums` among the last episodes, and forgets those that are too long ago."""
        self.last.append(dict(sums))
        episodes, steps = (sum(s[name] for s in self.last) for name in ("episodes", "steps"))
        while len(self.last) > 1:
            episodes, steps = episodes - self.last[0]["episodes"], steps - self.last[0]["steps"]
            if episodes < self.episodes or steps < self.least:
                break
            self.last.popleft()

    def mean(self) -> dict[str, float | None]:
        """Of the last episodes by name; per step, what is counted per step."""
        total = {name: sum(s[name] for s in self.last) for name in self.last[-1]}
        episodes, steps = total.pop("episodes"), total.pop("steps")
        of_homes = {name.partition("/")[2]: total.pop(name) for name in list(total) if name.startswith("episodes/")}
        found: dict[str, float | None] = {}
        for name, value in total.items():
            kind, _, home = name.partition("/")
            ended = of_homes[home] if kind == "success" and home else episodes
            count = steps if name.startswith("reward") else ended if steps >= self.least else 0
            found[name] = value / count if count else None
        return found

    def counted(self) -> int:
        """How many episodes `mean` is of."""
        return round(sum(s["episodes"] for s in self.last)) if self.last else 0

    def solved(self, until: float) -> bool:
        """Of enough episodes so large a share succeeded."""
        episodes, steps = (sum(s[name] for s in self.last) for name in ("episodes", "steps"))
        enough = episodes >= self.episodes and steps >= self.least
        return enough and sum(s["success"] for s in self.last) >= until * episodes

    def rates(self, now: float) -> dict[str, Any]:
        """Steps and updates a second since the last report, and the simulator's and the learner's share of the time.

        Args:
          now: `time.monotonic()`.
        """
        passed = max(now - self.began, 1e-9)
        simulator = min(self.spent / passed, 1.0) if self.spent == self.spent else None
        return {
            "steps_per_second": self.steps / passed,
            "updates_per_second": self.updates / passed,
            "simulator_share": simulator,
            "learner_share": None if simulator is None else 1 - simulator,
        }

    def next(self, now: float) -> Window:
        """The window after a report; it remembers the last episodes."""
        return Window(now, self.episodes, self.least, self.last)
