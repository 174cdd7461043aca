"""Jobs side by side: each has its processors, its GPU or none, its cache and its log, and the order that is asked."""

from __future__ import annotations

import os
import pathlib

import pytest

from benchmarks.harness.pinned_jobs import environment_of, read_jobs, run_jobs

TWO = """
[[job]]
name = "first"
processors = "0"
command = "nproc; echo $JAX_PLATFORMS:$CUDA_VISIBLE_DEVICES; echo made > OUT/made; exit 3"

[[job]]
name = "second"
processors = "0"
gpu = 1
memory = 0.5
after = "first"
command = "cat OUT/made"
"""


def jobs_of(folder: pathlib.Path, text: str = TWO):
    file = folder / "jobs.toml"
    file.write_text(text, encoding="utf-8")
    return read_jobs(file)


def test_a_job_has_its_processors_and_its_log_and_begins_after_the_one_that_it_names(tmp_path: pathlib.Path):
    out = tmp_path / "out"
    assert run_jobs(jobs_of(tmp_path), out) == {"first": 3, "second": 0}
    assert (out / "first.log").read_text().split("\n")[:3] == ["1", "cpu:", "exit status 3"]
    assert (out / "second.log").read_text() == "made\nexit status 0\n"


def test_a_job_on_a_gpu_sees_that_one_alone(tmp_path: pathlib.Path):
    first, second = jobs_of(tmp_path)
    seen = environment_of(second, tmp_path)
    assert (seen["CUDA_VISIBLE_DEVICES"], seen["XLA_PYTHON_CLIENT_MEM_FRACTION"]) == ("1", "0.5")
    assert seen["IG2MJ_CACHE_DIR"] != environment_of(first, tmp_path)["IG2MJ_CACHE_DIR"]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('"second"', '"first"', "two jobs are named first"),
        ('after = "first"', 'after = "third"', "does not come before it"),
        ('"0"', f'"0-{os.cpu_count()}"', "processors 0-"),
        ("memory", "memorie", "memorie"),
    ],
)
def test_a_file_that_cannot_be_meant_is_refused(tmp_path: pathlib.Path, old: str, new: str, complaint: str):
    with pytest.raises(ValueError, match=complaint):
        jobs_of(tmp_path, TWO.replace(old, new))
