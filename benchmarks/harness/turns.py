"""Programs that share a GPU take turns: they are made ready side by side, and timed one at a time.

A lock file stands for the machine. What is timed holds it alone (`exclusive`). Programs that are being compiled disturb
what is timed, since a step waits for thousands of launches; with a patience they hold the file together (`preparing`),
and nothing is timed before all are ready or the patience is over.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import pathlib
import time
from collections.abc import Iterator
from typing import IO

POLL = 0.2
"""Seconds between two looks at who is being made ready."""


@contextlib.contextmanager
def exclusive(lock: pathlib.Path | None, patience: float = 0.0) -> Iterator[None]:
    """Holds the lock file; others who time something wait. Whoever holds it is served first by the processor.

    Args:
      patience: seconds for which programs that are being made ready are waited for; afterwards none begins until this
        one is timed.
    """
    if lock is None:
        yield
        return
    with lock.open("a") as file, _others(lock).open("a") as others:
        fcntl.flock(file, fcntl.LOCK_EX)
        if patience > 0:
            _wait_for(others, patience)
        nice = os.getpriority(os.PRIO_PROCESS, 0)
        with contextlib.suppress(PermissionError):
            os.setpriority(os.PRIO_PROCESS, 0, 0)
        try:
            yield
        finally:
            os.setpriority(os.PRIO_PROCESS, 0, nice)


@contextlib.contextmanager
def preparing(lock: pathlib.Path | None, patience: float = 0.0) -> Iterator[None]:
    """While a program is compiled: with a patience, those who wait with one time nothing meanwhile."""
    if lock is None or patience <= 0:
        yield
        return
    with _others(lock).open("a") as others:
        fcntl.flock(others, fcntl.LOCK_SH)
        yield


def _others(lock: pathlib.Path) -> pathlib.Path:
    return lock.with_name(lock.name + ".preparing")


def _wait_for(others: IO[str], patience: float) -> None:
    until = time.monotonic() + patience
    while time.monotonic() < until:
        with contextlib.suppress(BlockingIOError):
            fcntl.flock(others, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        time.sleep(POLL)
