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
) -> list[Result]:
    """`[function(task) for task in tasks]`, in `jobs` processes where there is more than one task.

    The first error is raised as it came; what has not begun then is dropped. On an interrupt the processes are ended.
    """
    if jobs <= 1 or len(tasks) <= 1:
        results = []
        for done, (task, label) in enumerate(zip(tasks, labels, strict=True)):
            progress(label, done, len(tasks))
            results.append(function(task))
        return results
    return _in_processes(function, tasks, labels, jobs, progress)


def _in_processes(
    function: Callable[[Task], Result], tasks: Sequence[Task], labels: Sequence[str], jobs: int, progress: Progress
) -> list[Result]:
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")  # forking a process that has threads can hang
    executor = concurrent.futures.ProcessPoolExecutor(min(jobs, len(tasks)), context, initializer=_ignore_interrupts)
    try:
        futures = {executor.submit(function, task): index for index, task in enumerate(tasks)}
        waiting = dict(enumerate(labels))
        progress(labels[0], 0, len(tasks))
        results: dict[int, Result] = {}
        for future in concurrent.futures.as_completed(futures):
            index = futures[future]
            results[index] = future.result()
            waiting.pop(index)
            progress(next(iter(waiting.values()), ""), len(results), len(tasks))
        executor.shutdown()
        return [results[index] for index in range(len(tasks))]
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - before:
            process.terminate()
        raise


def _ignore_interrupts() -> None:
    """Ctrl-C reaches every process of the terminal; only the parent answers it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
