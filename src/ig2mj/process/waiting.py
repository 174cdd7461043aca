"""Telling on stderr that something takes its time: in a terminal a line that comes and goes, elsewhere a line now and
then. For work that other libraries do inside a call, where no progress bar can be put."""

from __future__ import annotations

import contextlib
import dataclasses
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator

PATIENCE = 2.0
"""Seconds of silence before the first line."""

EVERY = 5.0
"""Seconds between two lines where there is no terminal; more the longer it takes, `SELDOM` of what has passed."""

SELDOM = 0.2

REDRAW = 0.5
"""Seconds between two drawings of the line in a terminal."""

PAUSE = 3.0
"""Seconds without work after which the next piece is the first of a new row."""

Text = Callable[[], str]


@dataclasses.dataclass(eq=False)
class Work:
    """One piece of work. `began`: seconds of the monotonic clock; of the first piece, where it is one of a row."""

    text: Text
    began: float
    in_row: bool


class Waiting:
    """Work in progress, in any thread; a thread of its own tells of it while there is some: of the latest piece of the
    row, and of the latest that is a wait of its own."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._works: list[Work] = []
        self._thread: threading.Thread | None = None
        self._row_began = self._row_ended = self._told = float("-inf")
        self._drawn = False

    @contextlib.contextmanager
    def during(self, text: Text, in_row: bool = False) -> Iterator[None]:
        """Tells `text()` while the block runs; `in_row`: see `begin`."""
        work = self.begin(text, in_row)
        try:
            yield
        finally:
            self.end(work)

    def begin(self, text: Text, in_row: bool = False) -> Work:
        """Work begins; returns what `end` takes.

        Args:
          in_row: one of many pieces, together one wait. Others are each a wait of their own.
        """
        now = time.monotonic()
        with self._changed:
            if in_row and now - self._row_ended > PAUSE and not any(w.in_row for w in self._works):
                self._row_began = now
            work = Work(text, self._row_began if in_row else now, in_row)
            self._works.append(work)
            if self._thread is None:
                self._thread = threading.Thread(target=self._tell_while_working, name="ig2mj-waiting", daemon=True)
                self._thread.start()
            self._changed.notify_all()
        return work

    def end(self, work: Work) -> None:
        """Work has ended, well or not; the line in the terminal goes."""
        with self._changed:
            self._works.remove(work)
            if work.in_row:
                self._row_ended = time.monotonic()
            if self._drawn and not self._works:
                _write("\r\x1b[K")
                self._drawn = False
            self._changed.notify_all()

    def _tell_while_working(self) -> None:
        with self._changed:
            while self._works:
                in_terminal, now = sys.stderr.isatty(), time.monotonic()
                rows = [[w for w in self._works if w.in_row is in_row] for in_row in (True, False)]
                works = [row[-1] for row in rows if row]
                due = self._due(min(w.began for w in works), in_terminal)
                if now < due:
                    self._changed.wait(due - now)
                    continue
                line = "; ".join(f"{w.text()} ({now - w.began:.0f} s)" for w in works if now >= w.began + PATIENCE)
                _write(f"\r{_cut(line)}\x1b[K" if in_terminal else f"{line}\n")
                self._drawn, self._told = in_terminal, now
            self._thread = None

    def _due(self, began: float, in_terminal: bool) -> float:
        """When the next line is due, of work since `began`."""
        pause = REDRAW if in_terminal else max(EVERY, SELDOM * (self._told - began))
        return max(began + PATIENCE, self._told + pause)


def _cut(line: str) -> str:
    """So much of a line as one row of the terminal holds: a longer one would leave its first row behind."""
    width = shutil.get_terminal_size().columns - 1
    return line if len(line) <= width else line[: width - 3] + "..."


def _write(text: str) -> None:
    with contextlib.suppress(OSError, ValueError):  # stderr closed: then nobody waits for a line
        sys.stderr.write(text)
        sys.stderr.flush()


WAITING = Waiting()
"""The one of this process."""
