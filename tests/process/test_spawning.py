"""Only commands of ig2mj start processes by themselves, and processes end with the one that started them."""

import pathlib
import subprocess
import sys
import time

import pytest

from ig2mj.process import spawning


def test_a_users_script_starts_no_process_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A spawned process would run a script without the guard again."""
    monkeypatch.setattr(spawning, "_allowed", False)
    assert spawning.processes_for(1000) == 1


def test_a_command_shares_work_between_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spawning, "_allowed", False)
    monkeypatch.setattr(spawning, "available", lambda: 16)
    spawning.allow_spawning()
    assert [spawning.processes_for(parts) for parts in (0, 1, 5, 1000)] == [1, 1, 5, 16]


def test_workers_end_with_a_parent_that_is_killed(tmp_path: pathlib.Path) -> None:
    """As the system does where memory is short; the parent cannot end them then."""
    script, pid = tmp_path / "parent.py", tmp_path / "pid"
    script.write_text(PARENT.format(pid=str(pid)), encoding="utf-8")
    parent = subprocess.Popen([sys.executable, str(script)])
    end = time.monotonic() + 60
    while not pid.exists() and time.monotonic() < end:
        time.sleep(0.05)
    worker = int(pid.read_text())
    parent.kill()
    parent.wait()
    while _runs(worker) and time.monotonic() < end:
        time.sleep(0.05)
    assert not _runs(worker)


PARENT = """
import os, pathlib, time
from ig2mj.process.spawning import worker_processes

if __name__ == "__main__":
    with worker_processes(1, gpu=True) as workers:
        worker = workers.submit(os.getpid).result()
        pathlib.Path({pid!r} + "_").write_text(str(worker))
        os.replace({pid!r} + "_", {pid!r})
        time.sleep(60)
"""


def _runs(pid: int) -> bool:
    """A process that has ended and that nobody has waited for does not."""
    try:
        stat = pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    except FileNotFoundError:
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"
