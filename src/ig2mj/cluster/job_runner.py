"""`map_jobs`: runs independent, seeded jobs in this process, on the processes of this machine, or on a Ray cluster.

The result of a job depends on its arguments alone, so neither its place nor the order of jobs matters. A job that fails
is retried, on another node if there is one. If it keeps failing, its reason is listed while the other jobs continue.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import time
from collections.abc import Collection, Generator, Iterable, Sequence
from typing import Protocol, runtime_checkable

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.cluster.jobs import Job, JobResult, JobSet
from ig2mj.cluster.journal import Journal, MemoryStore
from ig2mj.errors import ClusterError, EngineError, Ig2mjError, StateError
from ig2mj.process.processors import available

RETRIES = 2
"""Retries of a failed job. Errors of the user (`Ig2mjError`) are not retried."""

SIMPLE = {kind.__name__: kind for kind in (EngineError, StateError, ClusterError)}
"""Errors that are made of their message alone."""


@dataclasses.dataclass(frozen=True)
class Where:
    """Where jobs run.

    Attributes:
      jobs: processes of this machine; 1: this process; 0: one per processor.
      cluster: address of a Ray cluster, or "auto" for the one that this machine belongs to; None: this machine.
      resume: continue an interrupted run.
    """

    jobs: int = 1
    cluster: str | None = None
    resume: bool = False


@runtime_checkable
class Workers(Protocol):
    """Runs jobs: `ThisProcess`, `LocalProcesses` or `RayNodes`. `width`: number of jobs to keep in flight."""

    @property
    def width(self) -> int: ...

    @property
    def running(self) -> int: ...

    def submit(self, job: Job) -> None:
        """Starts or queues a job."""
        ...

    def wait(self) -> list[JobResult]:
        """Waits for at least one result."""
        ...

    def close(self, now: bool) -> None:
        """Stops the workers. `now`: abort jobs in flight."""
        ...


def map_jobs(
    job_set: JobSet[Sequence[Job]],
    where: Where = Where(),
    store: Journal | MemoryStore | None = None,
    progress: ProgressCallback = no_progress,
) -> tuple[Journal | MemoryStore, dict[str, str]]:
    """Runs all jobs that the store does not hold yet.

    Args:
      store: keeps results as they arrive; None: in memory.

    Returns:
      The store, and the reasons of the failed jobs by name, in the order of the jobs.

    Raises:
      ClusterError: the cluster cannot be reached, or cannot run these jobs. An error that every job would raise.
    """
    store = MemoryStore() if store is None else store
    failed: dict[str, str] = {}
    with contextlib.closing(stream_jobs(job_set, where, store.names(), progress)) as results:
        for result in results:
            if result.error:
                failed[result.name] = result.error
            else:
                store.put(result.name, result.result)
    return store, {job.name: failed[job.name] for job in job_set.jobs if job.name in failed}


def stream_jobs(
    job_set: JobSet[Iterable[Job]],
    where: Where = Where(),
    finished: Collection[str] = (),
    progress: ProgressCallback = no_progress,
) -> Generator[JobResult, None, None]:
    """Runs jobs and yields one result each, in the order of completion. Closing the iterator aborts jobs in flight.

    Args:
      finished: names of jobs to skip.

    Raises:
      As `map_jobs`.
    """
    all_jobs = job_set.jobs
    total = len(all_jobs) if isinstance(all_jobs, Sequence) else None
    skipped = set(finished)
    todo = (job for job in all_jobs if job.name not in skipped)
    first = next(todo, None)
    if first is None:
        return
    counter = _Counter(total, sum(job.name in skipped for job in all_jobs) if isinstance(all_jobs, Sequence) else 0)
    workers = _workers(job_set, where, None if total is None else total - counter.before)
    queue, tries, clean = collections.deque([first]), collections.Counter[str](), False
    by_name: dict[str, Job] = {}
    try:
        while True:
            while workers.running < workers.width and (job := queue.popleft() if queue else next(todo, None)):
                by_name[job.name] = job
                workers.submit(job)
            progress(counter.before + counter.done + counter.failed, total, counter.text(workers.running))
            if not workers.running:
                break
            for result in workers.wait():
                if result.all_fail:
                    raise result.cause or SIMPLE.get(result.kind, Ig2mjError)(result.error)
                tries[result.name] += 1
                if result.error and result.again and tries[result.name] <= RETRIES:
                    queue.append(by_name[result.name])
                    continue
                counter.failed += bool(result.error)
                counter.done += not result.error
                del by_name[result.name]
                yield result
        clean = True
    finally:
        workers.close(now=not clean)


class _Counter:
    """Counts the jobs of a run. `before`: those that an earlier run finished."""

    def __init__(self, total: int | None, before: int):
        self.total, self.before, self.done, self.failed = total, before, 0, 0
        self._began = time.monotonic()

    def text(self, running: int) -> str:
        """E.g. "1 failed, 2 running, 1:02:05 left"; the remaining time is predicted from the pace so far."""
        parts = [f"{self.failed} failed"] if self.failed else []
        parts.append(f"{running} running")
        ended = self.done + self.failed
        if ended and self.total is not None:
            pace = (time.monotonic() - self._began) / ended
            left = round((self.total - self.before - ended) * pace)
            parts.append(f"{left // 3600}:{left // 60 % 60:02}:{left % 60:02} left" if left else "nearly done")
        return ", ".join(parts)


def _workers(job_set: JobSet, where: Where, count: int | None) -> Workers:
    if where.cluster is not None:
        from ig2mj.cluster.ray_nodes import RayNodes

        return RayNodes(job_set, where.cluster)
    from ig2mj.cluster.processes import LocalProcesses, ThisProcess

    processes = where.jobs or available()
    processes = processes if count is None else min(processes, count)
    return ThisProcess(job_set) if processes == 1 else LocalProcesses(job_set, processes)
