"""`Budget`: how much work a placement may spend."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable


@dataclasses.dataclass
class Budget:
    """How much may still be tried. Work is counted, not timed, so that a seed gives the same state on any machine.

    Attributes:
      work: units left. A candidate that is released and a search for candidates cost one unit each, 5 to 20 ms; a
        candidate that settles slowly costs more.
      seconds: time limit in s, after which no new candidate is tried; infinite by default.
      clock: gives the time in s; default: wall time.
    """

    work: int = 250
    seconds: float = math.inf
    clock: Callable[[], float] = time.monotonic

    def __post_init__(self) -> None:
        self._end = self.clock() + self.seconds

    def spend(self) -> bool:
        """Takes one unit. False: none is left."""
        if self.spent():
            return False
        self.work -= 1
        return True

    def spent(self) -> bool:
        """Whether no unit or no time is left."""
        return self.work <= 0 or self.clock() >= self._end

    def part(self, share: int) -> Budget:
        """A new budget of 1/`share` of the remaining work, with the same end. What it spends is not subtracted here."""
        return Budget(max(self.work // share, 1), self._end - self.clock(), self.clock)
