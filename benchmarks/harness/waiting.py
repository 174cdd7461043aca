"""Processes of a benchmark that make themselves ready side by side, then wait to be told to begin.

A process says `READY {...}` on standard output, answers every line on standard input with `DONE {...}`, and ends when
its input does. What it says on standard error goes to a log.
"""

from __future__ import annotations

import contextlib
import json
import pathlib
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.harness import paths


class Process:
    """A worker.

    Attributes:
      ready: what it said when it was ready; None before that.
    """

    def __init__(self, words: Sequence[str], log: pathlib.Path, environment: Mapping[str, str]):
        """Starts `python WORDS` with more variables of the environment."""
        log.parent.mkdir(parents=True, exist_ok=True)
        self.ready: dict[str, Any] | None = None
        self._log, self._lines = log, queue.SimpleQueue[str | None]()
        with log.open("w") as said:
            self._opened = subprocess.Popen(
                [sys.executable, *words],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=said,
                text=True,
                env=paths.environment(**environment),
            )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def wait_until_ready(self, until: float) -> bool:
        """Waits for its first line, until a time of `time.monotonic`."""
        if self.ready is None:
            self.ready = self.hear("READY", until)
        return self.ready is not None

    def hear(self, word: str, until: float) -> dict[str, Any] | None:
        """The next line that begins with a word; None: the process has ended, or the time is over."""
        while True:
            try:
                line = self._lines.get(timeout=max(until - time.monotonic(), 0.0))
            except queue.Empty:
                return None
            if line is None:
                self._lines.put(None)  # it has ended: the same for every later call
                return None
            if line.startswith(word):
                return json.loads(line[len(word) :])

    def tell(self, message: Mapping[str, Any]) -> None:
        """To begin."""
        assert self._opened.stdin is not None
        with contextlib.suppress(OSError):
            self._opened.stdin.write(json.dumps(message) + "\n")
            self._opened.stdin.flush()

    @property
    def ended(self) -> bool:
        """Whether it has ended."""
        return self._opened.poll() is not None

    def trouble(self) -> str:
        """Why it has not answered: that it still runs or how it ended, and the end of its standard error."""
        if not self._reader.is_alive():  # it has closed its output, and is about to end
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._opened.wait(5.0)
        status = self._opened.poll()
        state = "still at work" if status is None else f"ended with {status}"
        return f"{state}: {' '.join(self._log.read_text(errors='replace').split())[-300:]}"

    def leave(self) -> None:
        """Its input ends: it is to end, too."""
        with contextlib.suppress(OSError):
            assert self._opened.stdin is not None
            self._opened.stdin.close()

    def end(self, seconds: float) -> None:
        """Ends it, by force after so many seconds."""
        self.leave()
        try:
            self._opened.wait(seconds)
        except subprocess.TimeoutExpired:
            self._opened.kill()
            self._opened.wait()
        self._reader.join(1.0)

    def _read(self) -> None:
        assert self._opened.stdout is not None
        with self._opened.stdout as lines:
            for line in lines:
                self._lines.put(line)
        self._lines.put(None)


def end_all(processes: Iterable[Process], seconds: float = 10.0) -> None:
    """Ends all of them: all are told first, so that those which wait for each other leave together."""
    every = list(processes)
    for process in every:
        process.leave()
    until = time.monotonic() + seconds
    for process in every:
        process.end(max(until - time.monotonic(), 0.0))
