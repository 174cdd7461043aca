"""`Crew`: threads that work through a list of jobs beside the rest of the process, and end with it.

The threads of `concurrent.futures` work off all that was handed in before a process may end: after Ctrl+C somebody
would wait for every kernel that was still to be compiled. A crew's threads begin nothing more when the process ends,
which waits only for what they are in the middle of: libraries must not be taken away from under it.
"""

from __future__ import annotations

import atexit
import concurrent.futures
import contextlib
import queue
import threading
from collections.abc import Callable
from typing import Any

ENDING = threading.Event()
"""The process ends."""

_threads: set[threading.Thread] = set()


class Crew(contextlib.AbstractContextManager):
    """So many threads; they end when the block is left and all jobs are done, or dropped if it is left by an error."""

    def __init__(self, workers: int, name: str):
        """`name`: of the threads."""
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._dropped = threading.Event()
        self._members = [spawn(self._work, f"{name}-{k}") for k in range(workers)]

    def submit(self, act: Callable[..., Any], *arguments: Any) -> concurrent.futures.Future[Any]:
        """What a call will give. It is cancelled if the process ends, or the block by an error, before it begins."""
        done: concurrent.futures.Future[Any] = concurrent.futures.Future()

        def job() -> None:
            if ENDING.is_set() or self._dropped.is_set():
                done.cancel()
                return
            done.set_running_or_notify_cancel()
            try:
                done.set_result(act(*arguments))
            except BaseException as failure:
                done.set_exception(failure)

        self._jobs.put(job)
        return done

    def _work(self) -> None:
        while (job := self._jobs.get()) is not None:
            job()

    def __exit__(self, kind: Any, *about: Any) -> None:
        if kind is not None:
            self._dropped.set()
        for _ in range(len(self._members)):
            self._jobs.put(None)
        for member in self._members:
            member.join()


def spawn(act: Callable[[], None], name: str) -> threading.Thread:
    """A thread that the end of the process waits for, but only after it has set `ENDING`."""

    def run() -> None:
        try:
            act()
        finally:
            _threads.discard(thread)

    thread = threading.Thread(target=run, name=name, daemon=True)  # the others are waited for before `ENDING` is set
    _threads.add(thread)
    thread.start()
    return thread


@atexit.register
def end() -> None:
    """Nothing more begins; returns when the threads have ended."""
    ENDING.set()
    for thread in list(_threads):
        thread.join()
