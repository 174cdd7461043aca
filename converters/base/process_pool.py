"""Tasks over a process pool: results in the order of the tasks, whatever finished first."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Sequence
from typing import TypeVar

from ig2mj.callbacks import ProgressCallback

Task = TypeVar("Task")
Result = TypeVar("Result")


class TaskPool:
    """A process pool that starts with its first slow task and ends its processes when the block is left.

    A block that is left by an error or an interrupt ends them at once; a parent that is killed takes them along.

    Attributes:
      jobs: processes. With one, everything is done in this process.
    """

    def __init__(self, jobs: int):
        self.jobs = jobs
        self._executor: concurrent.futures.ProcessPoolExecutor | None = None
        self._others = set(multiprocessing.active_children())

    def __enter__(self) -> TaskPool:
        return self

    def map(
        self,
        function: Callable[[Task], Result],
        tasks: Sequence[Task],
        labels: Sequence[str],
        progress: ProgressCallback,
        is_quick: Callable[[Task], bool] | None = None,
    ) -> list[Result]:
        """`[function(task) for task in tasks]`, over the processes where that is worth it.

        Tasks that are quick are done here, while the processes work on the others. The first error is raised as it
        came; what has not begun then is dropped.
        """
        if self.jobs <= 1 or len(tasks) <= 1:
            results = []
            for done, (task, label) in enumerate(zip(tasks, labels, strict=True)):
                progress(done, len(tasks), label)
                results.append(function(task))
            return results
        found: dict[int, Result] = {}
        sent: dict[concurrent.futures.Future, int] = {}
        for index, task in enumerate(tasks):
            progress(len(found), len(tasks), labels[index])
            if is_quick is not None and is_quick(task):
                found[index] = function(task)
            else:
                sent[self._submit(function, task)] = index
        waiting = {index: labels[index] for index in sent.values()}
        for future in concurrent.futures.as_completed(sent):
            progress(len(found), len(tasks), next(iter(waiting.values())))
            found[sent[future]] = future.result()
            waiting.pop(sent[future])
        return [found[index] for index in range(len(tasks))]

    def _submit(self, function: Callable[[Task], Result], task: Task) -> concurrent.futures.Future:
        if self._executor is None:
            context = multiprocessing.get_context("spawn")  # forking a process that has threads can hang
            self._executor = concurrent.futures.ProcessPoolExecutor(self.jobs, context, initializer=_begin)
        return self._executor.submit(function, task)

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if self._executor is None:
            return
        self._executor.shutdown(wait=error is None, cancel_futures=error is not None)
        if error is not None:
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()


def _begin() -> None:
    """Ctrl-C reaches every process of the terminal, and only the parent answers it; a dead parent ends this one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """Waits for the parent's end, however it comes. Without this a killed parent leaves workers that wait for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
