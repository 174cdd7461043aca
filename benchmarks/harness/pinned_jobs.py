"""Several programs next to each other on one machine, each on processors and a GPU of its own.

    python -m benchmarks.harness.pinned_jobs jobs.toml --out OUT [--detach]

The file has a table for each program:

    [[job]]
    name = "towel"
    processors = "14-20"      # of those that this process may use, counted from 0
    gpu = 0                   # left out: none, and JAX computes on the processors
    memory = 0.5              # share of the GPU's memory that JAX takes at its start; left out: JAX's default
    after = "sample"          # left out: it starts at once
    command = "ig2mj train --config SoakingTowel-fetch-physical --out OUT/towel"

OUT in a command stands for the folder. Each program has a shell, a cache folder (OUT/cache/NAME), so that none waits
for another's kernels, and a log, OUT/NAME.log. Rows that programs write say how busy the machine was.
"""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
import threading
import tomllib
from typing import Annotated

import msgspec
import tyro

from benchmarks.harness.paths import environment

PINNED = """
import json, os, sys
os.sched_setaffinity(0, json.loads(sys.argv[1]))
os.execvp("sh", ["sh", "-c", sys.argv[2]])
"""
"""Becomes a shell on some processors. A fork of this process could not do so where other threads compute in it."""


class Job(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A program. `processors`: "A-B" or "A"; see the module."""

    name: str
    processors: str
    command: str
    gpu: int | None = None
    memory: float | None = None
    after: str | None = None


def read_jobs(file: pathlib.Path) -> list[Job]:
    """The jobs of a file. Raises ValueError: two of one name, one after itself or after one that does not come before
    it, or processors that this process has not."""
    jobs = msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8")), dict[str, list[Job]])["job"]
    known: set[str] = set()
    for job in jobs:
        if job.name in known:
            raise ValueError(f"{file}: two jobs are named {job.name}")
        if job.after is not None and job.after not in known:
            raise ValueError(f"{file}: {job.name} is after {job.after}, which does not come before it")
        processors_of(job)
        known.add(job.name)
    return jobs


def processors_of(job: Job) -> list[int]:
    """The system's numbers of a job's processors. Raises ValueError: this process has fewer."""
    allowed = sorted(os.sched_getaffinity(0))
    first, _, last = job.processors.partition("-")
    found = allowed[int(first) : int(last or first) + 1]
    if len(found) != int(last or first) - int(first) + 1:
        raise ValueError(f"{job.name}: processors {job.processors} of {len(allowed)}")
    return found


def environment_of(job: Job, out: pathlib.Path) -> dict[str, str]:
    """What a job's program finds in its environment."""
    more = {"IG2MJ_CACHE_DIR": str(out / "cache" / job.name), "PYTHONUNBUFFERED": "1"}
    more["CUDA_VISIBLE_DEVICES"] = "" if job.gpu is None else str(job.gpu)
    if job.gpu is None:
        more["JAX_PLATFORMS"] = "cpu"
    if job.memory is not None:
        more["XLA_PYTHON_CLIENT_MEM_FRACTION"] = str(job.memory)
    return environment(**more)


def run_job(job: Job, out: pathlib.Path) -> int:
    """Runs a job to its end; its exit status, which is also the last line of its log."""
    with (out / f"{job.name}.log").open("w", encoding="utf-8") as log:
        status = subprocess.run(
            [sys.executable, "-c", PINNED, json.dumps(processors_of(job)), job.command.replace("OUT", str(out))],
            env=environment_of(job, out),
            stdout=log,
            stderr=subprocess.STDOUT,
            check=False,
        ).returncode
        log.write(f"exit status {status}\n")
    return status


def run_jobs(jobs: list[Job], out: pathlib.Path) -> dict[str, int]:
    """Runs all jobs side by side, and those with `after` when that one has ended; exit statuses by name."""
    out.mkdir(parents=True, exist_ok=True)
    ended = {job.name: threading.Event() for job in jobs}
    status: dict[str, int] = {}

    def work(job: Job) -> None:
        if job.after is not None:
            ended[job.after].wait()
        status[job.name] = run_job(job, out)
        ended[job.name].set()

    threads = [threading.Thread(target=work, args=(job,)) for job in jobs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return status


def main(
    file: Annotated[pathlib.Path, tyro.conf.Positional],
    out: pathlib.Path,
    detach: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Run the jobs of a file.

    Args:
      file: the jobs.
      out: folder of logs, caches and results.
      detach: return at once; the jobs go on.
    """
    out = out.resolve()
    jobs = read_jobs(file)
    if detach:
        again = [sys.executable, "-m", "benchmarks.harness.pinned_jobs", str(file), "--out", str(out)]
        out.mkdir(parents=True, exist_ok=True)
        with (out / "jobs.log").open("w", encoding="utf-8") as log:
            subprocess.Popen(again, env=environment(), stdout=log, stderr=log, start_new_session=True)
        return 0
    status = run_jobs(jobs, out)
    for name, value in status.items():
        print(f"{name}: exit status {value}")
    return int(any(status.values()))


if __name__ == "__main__":
    sys.exit(tyro.cli(main, description=__doc__))
