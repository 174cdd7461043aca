"""Processes that report, and what becomes of those that crash or say nothing."""

import sys

import pytest

from ig2mj.cluster.reporting import ProcessEnded, reports


def run(tmp_path, code: str, silence: float = 20.0):
    program = f"from ig2mj.cluster.reporting import report\n{code}"
    return reports([sys.executable, "-c", program], lambda: silence, tmp_path / "log.txt")


def test_reports_arrive_in_order_and_other_output_goes_to_the_log(tmp_path):
    found = list(run(tmp_path, "report(n=1)\nprint('hello')\nreport(n=2)"))
    assert found == [{"n": 1}, {"n": 2}]
    assert "hello" in (tmp_path / "log.txt").read_text()


def test_a_crash_is_said_after_the_reports_before_it(tmp_path):
    found = []
    with pytest.raises(ProcessEnded, match="status -9"):
        for told in run(tmp_path, "import os\nreport(n=1)\nos.kill(os.getpid(), 9)"):
            found.append(told)
    assert found == [{"n": 1}]


def test_a_process_that_is_silent_is_ended(tmp_path):
    with pytest.raises(ProcessEnded, match="nothing was reported"):
        list(reports([sys.executable, "-c", "import time; time.sleep(600)"], lambda: 0.2, tmp_path / "log.txt"))
