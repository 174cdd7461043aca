"""Telling on stderr that something takes its time: in a terminal a line that comes and goes, elsewhere a line now and
then. For work that other libraries do inside a call, where no progress bar can be put."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator

PATIENCE = 2.0
"""Seconds of silence before the first line."""

EVERY = 5.0
"""Seconds between two lines where there is no terminal."""

REDRAW = 0.5
"""Seconds between two drawings of the line in a terminal."""

PAUSE = 3.0
"""Seconds without work after which the next work is told as a new wait."""

Text = Callable[[], str]


class Waiting:
    """Work in progress, in any thread; a thread of its own tells of it while there is some."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._works: list[tuple[object, Text]] = []
        self._thread: threading.Thread | None = None
        self._began = self._ended = self._told = float("-inf")
        self._drawn = False

    @contextlib.contextmanager
    def during(self, text: Text) -> Iterator[None]:
        """Tells `text()` while the block runs."""
        token = self.begin(text)
        try:
            yield
        finally:
            self.end(token)

    def begin(self, text: Text) -> object:
        """Work begins; returns what `end` takes."""
        token, now = object(), time.monotonic()
        with self._changed:
            if not self._works and now - self._ended > PAUSE:
                self._began, self._told = now, float("-inf")
            self._works.append((token, text))
            if self._thread is None:
                self._thread = threading.Thread(target=self._tell_while_working, name="ig2mj-waiting", daemon=True)
                self._thread.start()
        return token

    def end(self, token: object) -> None:
        """Work has ended, well or not; the line in the terminal goes."""
        with self._changed:
            self._works = [(t, text) for t, text in self._works if t is not token]
            if not self._works:
                self._ended = time.monotonic()
                if self._drawn:
                    _write("\r\x1b[K")
                    self._drawn = False
            self._changed.notify_all()

    def _tell_while_working(self) -> None:
        with self._changed:
            while self._works:
                in_terminal = sys.stderr.isatty()
                now = time.monotonic()
                due = max(self._began + PATIENCE, self._told + (REDRAW if in_terminal else EVERY))
                if now < due:
                    self._changed.wait(due - now)
                    continue
                line = f"{self._works[-1][1]()} ({now - self._began:.0f} s)"
                _write(f"\r{line}\x1b[K" if in_terminal else f"{line}\n")
                self._drawn, self._told = in_terminal, now
            self._thread = None


def _write(text: str) -> None:
    with contextlib.suppress(OSError, ValueError):  # stderr closed: then nobody waits for a line
        sys.stderr.write(text)
        sys.stderr.flush()


WAITING = Waiting()
"""The one of this process."""
