"""The process pool: results in order, and no worker that outlives its parent."""

import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest
from ig2mj_converters.base.process_pool import TaskPool

from ig2mj.callbacks import no_progress

SCRIPT = """
import os, sys, time
from ig2mj.callbacks import no_progress
from ig2mj_converters.base.process_pool import TaskPool

def work(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(120)

if __name__ == "__main__":
    with TaskPool(2) as pool:
        pool.map(work, [sys.argv[1]] * 2, ["a", "b"], no_progress)
"""


def _negative(number: int) -> int:
    return -number


def test_results_come_in_the_order_of_the_tasks():
    with TaskPool(2) as pool:
        assert pool.map(_negative, [3, 1, 2], ["a", "b", "c"], no_progress) == [-3, -1, -2]
        assert pool.map(_negative, [4, 5], ["d", "e"], no_progress, lambda n: n == 4) == [-4, -5]


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_a_killed_parent_and_let_go_of_its_output(how, tmp_path):
    script, pids = tmp_path / "script.py", tmp_path / "pids"
    script.write_text(SCRIPT)
    pids.mkdir()
    with subprocess.Popen([sys.executable, script, pids], stdout=subprocess.PIPE) as parent:
        wait_until(lambda: len(list(pids.iterdir())) == 2)
        parent.send_signal(how)
        assert parent.stdout is not None
        assert parent.stdout.read() == b""  # ends only when no process holds the pipe any more
    wait_until(lambda: not any(alive(int(file.name)) for file in pids.iterdir()))


def wait_until(condition) -> None:
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def alive(process: int) -> bool:
    """Whether it runs; one that has ended and waits for a parent to ask is not alive."""
    try:
        os.kill(process, 0)
        return "(zombie)" not in pathlib.Path(f"/proc/{process}/status").read_text()
    except (ProcessLookupError, FileNotFoundError):
        return False
