"""Pieces of work in this process, or on several processes of this machine.

Each process does one piece at a time and keeps what it has loaded for the next. One that dies (out of memory, a crash
in a library) costs the piece that it was doing, and another takes its place.
"""

from __future__ import annotations

import collections
import concurrent.futures
import concurrent.futures.process
import dataclasses
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Mapping

from ig2mj.cluster.work import Answer, Piece, Work, do


class ThisProcess:
    """One piece after the other, here."""

    width = 1

    def __init__(self, work: Work):
        """Does nothing yet."""
        self._work, self._handed = work, collections.deque[Piece]()

    @property
    def running(self) -> int:
        """Pieces that were handed out and have no answer."""
        return len(self._handed)

    def submit(self, piece: Piece) -> None:
        """Hands a piece out."""
        self._handed.append(piece)

    def wait(self) -> list[Answer]:
        """Does one piece."""
        return [do(self._work.function, self._handed.popleft(), self._work.shared)]

    def close(self, now: bool) -> None:
        """Nothing is left behind."""


class LocalProcesses:
    """`width` processes of this machine, each of which can die alone."""

    def __init__(self, work: Work, width: int):
        """Starts no process yet: each starts with its first piece."""
        self._work, self.width = work, width
        self._others = set(multiprocessing.active_children())
        self._free: list[concurrent.futures.ProcessPoolExecutor] = []
        self._busy: dict[concurrent.futures.Future[Answer], tuple[Piece, concurrent.futures.ProcessPoolExecutor]] = {}

    @property
    def running(self) -> int:
        """Pieces that were handed out and have no answer."""
        return len(self._busy)

    def submit(self, piece: Piece) -> None:
        """Hands a piece out to a process that is free, or a new one."""
        process = self._free.pop() if self._free else self._new()
        # A process that starts here inherits this: Ctrl-C would have it print a traceback until `_begin` has run.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._busy[process.submit(_do_here, self._work.function, piece)] = (piece, process)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _new(self) -> concurrent.futures.ProcessPoolExecutor:
        context = multiprocessing.get_context("spawn")  # forking a process that has threads can hang
        return concurrent.futures.ProcessPoolExecutor(
            1, context, initializer=_begin, initargs=(dict(self._work.shared), self._work.gpu)
        )

    def wait(self) -> list[Answer]:
        """Waits for the first answers."""
        done, _ = concurrent.futures.wait(self._busy, return_when=concurrent.futures.FIRST_COMPLETED)
        answers = []
        for future in done:
            piece, process = self._busy.pop(future)
            try:
                answers.append(future.result())
                self._free.append(process)
            except concurrent.futures.process.BrokenProcessPool:
                process.shutdown(wait=False)
                answers.append(Answer(piece.name, error="the process that did it died", again=True))
        return answers

    def close(self, now: bool) -> None:
        """Ends the processes."""
        for process in [*self._free, *(p for _, p in self._busy.values())]:
            process.shutdown(wait=not now, cancel_futures=True)
        if now:
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()


_shared: dict[str, bytes] = {}
"""What all pieces need, in a process that does some."""


def _begin(shared: Mapping[str, bytes], gpu: bool) -> None:
    """Ctrl-C reaches every process of the terminal, and only the parent answers it; a dead parent ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _shared.update(shared)
    if not gpu:
        from ig2mj.process import use_processor_only

        use_processor_only()  # many processes would fill a GPU's memory


def _end_with_parent() -> None:
    """Waits for the parent's end, however it comes."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


def _do_here(function: str, piece: Piece) -> Answer:
    return dataclasses.replace(do(function, piece, _shared), cause=None)  # not all errors can be sent
