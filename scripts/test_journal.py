"""A pytest plugin that notes each test in a file as soon as it begins and ends, and skips those that have ended.

`scripts/gpu_tests.py` gives it to pytest (`-p test_journal`). The variable TEST_JOURNAL names the file, which several
processes may share. Each line is JSON: {"test", "process"} or {"test", "outcome", "seconds"}; later lines count. So
whoever is killed, at any moment, leaves what ended before. A process ends when the one that started it has ended.
"""

from __future__ import annotations

import json
import os
import pathlib
import threading
import time
from typing import Any

VARIABLE = "TEST_JOURNAL"


def note(journal: pathlib.Path, **line: Any) -> None:
    """Appends a line, in one write, so that lines of several processes do not mix."""
    at = os.open(journal, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        os.write(at, (json.dumps(line) + "\n").encode())
    finally:
        os.close(at)


def read(journal: pathlib.Path) -> dict[str, dict[str, Any]]:
    """The last line of each test. A line that was cut off is left out."""
    found: dict[str, dict[str, Any]] = {}
    if journal.exists():
        for line in journal.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                of_test = json.loads(line)
            except json.JSONDecodeError:
                continue
            found[of_test["test"]] = of_test
    return found


def ended(journal: pathlib.Path) -> dict[str, dict[str, Any]]:
    """The lines of tests that have an outcome."""
    return {test: line for test, line in read(journal).items() if "outcome" in line}


class Noting:
    """The plugin's hooks."""

    def __init__(self, journal: pathlib.Path):
        self._journal = journal
        self._outcome, self._began = "passed", 0.0

    def pytest_collection_modifyitems(self, config: Any, items: list[Any]) -> None:
        done = ended(self._journal)
        left_out = [item for item in items if item.nodeid in done]
        items[:] = [item for item in items if item.nodeid not in done]
        config.hook.pytest_deselected(items=left_out)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._outcome, self._began = "passed", time.time()
        note(self._journal, test=nodeid, process=os.getpid())

    def pytest_runtest_logreport(self, report: Any) -> None:
        if report.outcome != "passed" and self._outcome != "failed":
            self._outcome = report.outcome
        if report.when == "teardown":
            seconds = round(time.time() - self._began, 1)
            note(self._journal, test=report.nodeid, outcome=self._outcome, seconds=seconds)


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def pytest_configure(config: Any) -> None:
    threading.Thread(target=_end_with, args=[os.getppid()], daemon=True).start()
    config.pluginmanager.register(Noting(pathlib.Path(os.environ[VARIABLE])), "test-journal")
