"""Tasks over a process pool: results in the order of the tasks, whatever finished first."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import signal
from collections.abc import Callable, Sequence
from typing import TypeVar

from .options import Progress

Task = TypeVar("Task")
Result = TypeVar("Result")


def map_tasks(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    labels: Sequence[str],
    jobs: int,
    progress: Progress,
    is_quick: Callable[[Task], bool] | None = None,
) -> list[Result]:
    """`[function(task) for task in tasks]`, in `jobs` processes where that is worth it.

    Tasks that are quick are done here, while the processes work on the others. The first error is raised as it came;
    what has not begun then is dropped. On an interrupt the processes are ended.
    """
    if jobs <= 1 or len(tasks) <= 1:
        results = []
        for done, (task, label) in enumerate(zip(tasks, labels, strict=True)):
            progress(label, done, len(tasks))
            results.append(function(task))
        return results
    with _Pool(jobs) as pool:
        found: dict[int, Result] = {}
        sent: dict[concurrent.futures.Future, int] = {}
        for index, task in enumerate(tasks):
            progress(labels[index], len(found), len(tasks))
            if is_quick is not None and is_quick(task):
                found[index] = function(task)
            else:
                sent[pool.submit(function, task)] = index
        waiting = {index: labels[index] for index in sent.values()}
        for future in concurrent.futures.as_completed(sent):
            progress(next(iter(waiting.values())), len(found), len(tasks))
            found[sent[future]] = future.result()
            waiting.pop(sent[future])
    return [found[index] for index in range(len(tasks))]


class _Pool:
    """A process pool that starts with its first task, and whose processes are ended when the block is left early."""

    def __init__(self, jobs: int):
        self._jobs = jobs
        self._executor: concurrent.futures.ProcessPoolExecutor | None = None
        self._others = set(multiprocessing.active_children())

    def __enter__(self) -> _Pool:
        return self

    def submit(self, function: Callable[[Task], Result], task: Task) -> concurrent.futures.Future:
        if self._executor is None:
            context = multiprocessing.get_context("spawn")  # forking a process that has threads can hang
            self._executor = concurrent.futures.ProcessPoolExecutor(self._jobs, context, initializer=_ignore_interrupts)
        return self._executor.submit(function, task)

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if self._executor is None:
            return
        self._executor.shutdown(wait=error is None, cancel_futures=error is not None)
        if error is not None:
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()


def _ignore_interrupts() -> None:
    """Ctrl-C reaches every process of the terminal; only the parent answers it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
