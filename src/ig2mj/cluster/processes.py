"""Runs jobs in this process or on several processes of this machine.

Each process runs one job at a time and keeps its modules and caches for the next. If a process dies (out of memory, a
crash in a library), its job fails and another process takes its place.
"""

from __future__ import annotations

import collections
import concurrent.futures
import concurrent.futures.process
import dataclasses
import multiprocessing
import signal
from collections.abc import Mapping

from ig2mj.cluster.jobs import Job, JobResult, JobSet, run_job
from ig2mj.process.spawning import worker_processes


class ThisProcess:
    """Runs one job after the other in this process."""

    width = 1

    def __init__(self, job_set: JobSet):
        """Runs nothing yet."""
        self._job_set, self._handed = job_set, collections.deque[Job]()

    @property
    def running(self) -> int:
        """Number of submitted jobs without a result."""
        return len(self._handed)

    def submit(self, job: Job) -> None:
        """Queues a job."""
        self._handed.append(job)

    def wait(self) -> list[JobResult]:
        """Runs one job."""
        return [run_job(self._job_set.function, self._handed.popleft(), self._job_set.shared)]

    def close(self, now: bool) -> None:
        """Nothing to stop."""


class LocalProcesses:
    """`width` processes of this machine; the death of one does not affect the others."""

    def __init__(self, job_set: JobSet, width: int):
        """Starts no process yet; each starts with its first job."""
        self._job_set, self.width = job_set, width
        self._others = set(multiprocessing.active_children())
        self._free: list[concurrent.futures.ProcessPoolExecutor] = []
        self._busy: dict[concurrent.futures.Future[JobResult], tuple[Job, concurrent.futures.ProcessPoolExecutor]] = {}

    @property
    def running(self) -> int:
        """Number of submitted jobs without a result."""
        return len(self._busy)

    def submit(self, job: Job) -> None:
        """Sends a job to a free process, or to a new one."""
        process = self._free.pop() if self._free else self._new()
        # A process that starts here inherits this: Ctrl-C would have it print a traceback until it is set up.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self._busy[process.submit(_do_here, self._job_set.function, job)] = (job, process)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)

    def _new(self) -> concurrent.futures.ProcessPoolExecutor:
        return worker_processes(1, gpu=self._job_set.gpu, begin=_share, arguments=(dict(self._job_set.shared),))

    def wait(self) -> list[JobResult]:
        """Waits for at least one result."""
        done, _ = concurrent.futures.wait(self._busy, return_when=concurrent.futures.FIRST_COMPLETED)
        answers = []
        for future in done:
            job, process = self._busy.pop(future)
            try:
                answers.append(future.result())
                self._free.append(process)
            except concurrent.futures.process.BrokenProcessPool:
                process.shutdown(wait=False)
                answers.append(JobResult(job.name, error="the process that ran it died", again=True))
        return answers

    def close(self, now: bool) -> None:
        """Stops the processes."""
        for process in [*self._free, *(p for _, p in self._busy.values())]:
            process.shutdown(wait=not now, cancel_futures=True)
        if now:
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()


_shared: dict[str, bytes] = {}
"""`JobSet.shared`, in a worker process."""


def _share(shared: Mapping[str, bytes]) -> None:
    """Set-up of a worker process."""
    _shared.update(shared)


def _do_here(function: str, job: Job) -> JobResult:
    return dataclasses.replace(run_job(function, job, _shared), cause=None)  # not all errors can be sent
