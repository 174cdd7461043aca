"""`benchmarks/gpu/jobs.py`: order, limits, and that nothing is left running."""

from __future__ import annotations

import time
from pathlib import Path

import jobs
import pytest


def test_jobs_wait_for_each_other_and_for_files(tmp_path):
    made = tmp_path / "made"
    text = f"""
    # cards cores after name command
    0,1 - - first   sleep 0.3; touch {made}; echo $CUDA_VISIBLE_DEVICES
    -   0 - third   test -e {made} && echo "on $(taskset -cp $$)"
    -   - first+file:{tmp_path}/ma* second  test -e {made} && echo here > $OUT/answer
    """
    listed = jobs.read_jobs(text)
    ended = jobs.run(listed, tmp_path / "out", seconds=20, wait=0.02)
    assert ended == {"first": 0, "second": 0, "third": 1}, "the third began at once, before there was a file"
    assert (tmp_path / "out/second/answer").read_text() == "here\n"
    assert (tmp_path / "out/first/log").read_text() == "0,1\n"


def test_what_a_job_leaves_behind_ends_with_it(tmp_path):
    """Even what has a group of processes of its own, as the commands of `timeout` have."""
    text = "- - - leaves  timeout 60 sleep 50 & echo $! > $OUT/pid; sleep 0.2"
    assert jobs.run(jobs.read_jobs(text), tmp_path, seconds=20, wait=0.02) == {"leaves": 0}
    left = Path("/proc", (tmp_path / "leaves/pid").read_text().strip(), "stat")
    until = time.monotonic() + 5
    while left.exists() and left.read_text().rpartition(")")[2].split()[0] != "Z":  # a zombie has ended, too
        assert time.monotonic() < until
        time.sleep(0.02)


def test_time_is_up(tmp_path):
    text = "- - - long sleep 60\n- - long never true"
    assert jobs.run(jobs.read_jobs(text), tmp_path, seconds=0.5, wait=0.02) == {}
    assert "time was up: long, never" in (tmp_path / "jobs.log").read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("- - - short", "line 1"),
        ("- - other name true", "no job's name"),
        ("- - - twice true\n- - - twice true", "two jobs"),
    ],
)
def test_wrong_lines_are_named(text, words):
    with pytest.raises(ValueError, match=words):
        jobs.read_jobs(text)
