"""`WorkerThreads`: threads that work through a queue of calls and end with the process.

The threads of `concurrent.futures` finish everything in the queue before the process may exit: after Ctrl+C that is
every kernel that is still to be compiled. These threads start no further call when the process exits; the exit waits
only for the calls in progress, so that libraries are not unloaded while a call runs.
"""

from __future__ import annotations

import atexit
import concurrent.futures
import contextlib
import queue
import threading
import weakref
from collections.abc import Callable
from typing import Any

ENDING = threading.Event()
"""Set when the process exits."""

_threads: set[threading.Thread] = set()

_groups: weakref.WeakSet[WorkerThreads] = weakref.WeakSet()


class WorkerThreads(contextlib.AbstractContextManager):
    """A fixed number of threads. At the end of the block they finish the queue, or drop it if the block raised."""

    def __init__(self, workers: int, name: str):
        """`name`: prefix of the threads' names."""
        self._jobs: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._dropped = threading.Event()
        self._members = [spawn(self._work, f"{name}-{k}") for k in range(workers)]
        _groups.add(self)

    def submit(self, act: Callable[..., Any], *arguments: Any) -> concurrent.futures.Future[Any]:
        """Queues a call. Its future is cancelled if the process exits, or the block raises, before the call starts."""
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
        self.end()
        for member in self._members:
            member.join()

    def end(self) -> None:
        """Lets the threads end when the queue is empty; does not wait for them."""
        for _ in range(len(self._members)):
            self._jobs.put(None)


def spawn(act: Callable[[], None], name: str) -> threading.Thread:
    """Starts a thread that the exit of the process joins after `ENDING` is set."""

    def run() -> None:
        try:
            act()
        finally:
            _threads.discard(thread)

    thread = threading.Thread(target=run, name=name, daemon=True)  # others are joined before `ENDING` is set
    _threads.add(thread)
    thread.start()
    return thread


@atexit.register
def end() -> None:
    """Sets `ENDING` and joins the threads, also of groups whose block was never left."""
    ENDING.set()
    for group in list(_groups):
        group.end()
    for thread in list(_threads):
        thread.join()
