"""How far work is that takes long, and how long it may take: a line on stderr, or words next to a bar of a command.

with progress("playing CookingMeat") as report:
    report(0.25, "64 of 256 episodes")      # playing CookingMeat: 64 of 256 episodes, about 3 min left (58 s)
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from ig2mj.process.waiting import WAITING

Report = Callable[[float, str], None]
"""Takes the share of the work that is done, 0 to 1, and how far it is in words."""

BARS: list[Callable[[str], None]] = []
"""What shows the words of a command's bar, the innermost last; where there is one no lines are printed."""

SOON = 2.0
"""Seconds of work before which nothing is predicted."""


class Share:
    """Work of which a share is done. The time that is left is predicted from the pace since the first report."""

    def __init__(self, what: str):
        self._what, self._words, self._share = what, "", 0.0
        self._began: tuple[float, float] | None = None

    def __call__(self, share: float, words: str = "") -> None:
        """See `Report`."""
        self._words, self._share = words, share
        if self._began is None:
            self._began = time.monotonic(), share
        if BARS:
            BARS[-1](self.text())

    def text(self) -> str:
        """What is done, how far it is, and how long it may take."""
        parts = [part for part in (self._words, self._left()) if part]
        return f"{self._what}: {', '.join(parts)}" if parts else self._what

    def _left(self) -> str:
        if self._began is None:
            return ""
        seconds, done = time.monotonic() - self._began[0], self._share - self._began[1]
        return f"about {in_words(seconds * (1 - self._share) / done)} left" if done > 0 and seconds > SOON else ""


def in_words(seconds: float | int) -> str:
    """40 s, 3 min or 2.5 h."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 100 * 60 else f"{seconds / 3600:.1f} h"


@contextlib.contextmanager
def progress(what: str) -> Iterator[Report]:
    """Shows how far some work is, from the second second on, until the block ends."""
    share = Share(what)
    if BARS:
        BARS[-1](share.text())
        yield share
        return
    with WAITING.during(share.text):
        yield share


@contextlib.contextmanager
def shown_by(bar: Callable[[str], None]) -> Iterator[None]:
    """While the block runs, this shows the words of `progress`, in place of lines."""
    BARS.append(bar)
    try:
        yield
    finally:
        BARS.remove(bar)
