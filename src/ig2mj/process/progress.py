"""Progress of long work and its remaining time: a line on stderr, or text next to the progress bar of a command.

with progress("playing CookingMeat") as report:
    report(64, 256, "64 of 256 episodes")      # playing CookingMeat: 64 of 256 episodes, about 3 min left (58 s)
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from ig2mj.callbacks import ProgressCallback
from ig2mj.process.waiting import WAITING

BARS: list[Callable[[str], None]] = []
"""Show text next to a command's progress bar, the innermost last. While there is one, no lines are printed."""

SOON = 2.0
"""Seconds of work before the remaining time is predicted."""


class Share:
    """Work in progress. The remaining time is predicted from the pace since the first report."""

    def __init__(self, what: str):
        self._what, self._words, self._share = what, "", 0.0
        self._began: tuple[float, float] | None = None

    def __call__(self, done: float | int, total: float | int | None, text: str = "", /) -> None:
        """See `ig2mj.callbacks.ProgressCallback`."""
        share = done / total if total else 0.0
        self._words, self._share = text, share
        if self._began is None:
            self._began = time.monotonic(), share
        if BARS:
            BARS[-1](self.text())

    def text(self) -> str:
        """What is done, how far it is, and the remaining time."""
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
def progress(what: str) -> Iterator[ProgressCallback]:
    """Shows the progress of the block, after its second second."""
    share = Share(what)
    if BARS:
        BARS[-1](share.text())
        yield share
        return
    with WAITING.during(share.text):
        yield share


@contextlib.contextmanager
def shown_by(bar: Callable[[str], None]) -> Iterator[None]:
    """During the block, `bar` shows the text of `progress` in place of lines."""
    BARS.append(bar)
    try:
        yield
    finally:
        BARS.remove(bar)
