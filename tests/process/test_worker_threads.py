"""Threads that work through a list and end with the process."""

from __future__ import annotations

import concurrent.futures
import subprocess
import sys
import threading
import time

import pytest

from ig2mj.process.worker_threads import WorkerThreads


def test_a_crew_works_side_by_side_and_ends_with_its_block():
    both = threading.Barrier(2, timeout=20)  # passed by two at a time only
    with WorkerThreads(2, "test-crew") as crew:
        done = [crew.submit(lambda k=k: (both.wait(), k)[1]) for k in range(4)]
        assert [job.result(20) for job in done] == [0, 1, 2, 3]
    assert not any(thread.name.startswith("test-crew") for thread in threading.enumerate())


def test_a_failure_is_the_jobs_own():
    with WorkerThreads(1, "test-crew") as crew:
        failed, fine = crew.submit(lambda: 1 // 0), crew.submit(lambda: 7)
        assert fine.result(20) == 7
    with pytest.raises(ZeroDivisionError):
        failed.result()


def test_a_block_left_by_an_error_begins_nothing_more():
    begun, go = threading.Event(), threading.Event()
    with pytest.raises(KeyboardInterrupt), WorkerThreads(1, "test-crew") as crew:
        first = crew.submit(lambda: (begun.set(), go.wait(20)))
        second = crew.submit(lambda: None)
        assert begun.wait(20)
        threading.Timer(0.2, go.set).start()
        raise KeyboardInterrupt
    assert first.done() and second.cancelled()
    with pytest.raises(concurrent.futures.CancelledError):
        second.result()


CODE = """
import threading, time
from ig2mj.process.worker_threads import WorkerThreads, spawn
begun = threading.Event()

def job(k):
    begun.set()
    time.sleep(0.5)
    print("ended", k, flush=True)

def all_jobs():
    with WorkerThreads(1, "test-crew") as crew:
        for done in [crew.submit(job, k) for k in range(100)]:
            done.result()

spawn(all_jobs, "test-all")
begun.wait()
raise KeyboardInterrupt
"""


def test_a_process_that_ends_waits_only_for_what_has_begun():
    began = time.monotonic()
    done = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, timeout=40)
    assert done.stdout.splitlines() == ["ended 0"], "what has begun ends; a hundred would take 50 s"
    assert time.monotonic() - began < 30
    assert "KeyboardInterrupt" in done.stderr


def test_threads_of_a_block_that_was_never_left_do_not_keep_a_process():
    code = (
        "from ig2mj.process.worker_threads import WorkerThreads\n"
        "crew = WorkerThreads(2, 'test')\n"
        "print(crew.submit(lambda: 3).result())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=40)
    assert (done.stdout, done.returncode) == ("3\n", 0)
