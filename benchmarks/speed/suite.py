"""All that is measured on a GPU, in one run with a time limit: the most important first; what does not fit is left out.

    python -m benchmarks.speed.suite calibrate --out DIR [--minutes 3]   buffer sizes of all homes: DIR/profiles/<home>/
    python -m benchmarks.speed.suite throughput --out DIR [--minutes 8]    rows: DIR/throughput.jsonl
    python -m benchmarks.speed.suite readme --out DIR [--minutes 8]      README.md's rows of one card: DIR/readme.jsonl
    python -m benchmarks.speed.batch_report DIR/throughput.jsonl          table and plots

Every case is a process of its own with a time limit of its own, so that one that fails or hangs costs only itself; it
leaves a row with its error. Several are made ready (compiled) at the same time, but timed one after the other.
Calibrated profiles are also kept in out/benchmarks/profiles, where `throughput` looks for them first; without any, each
case measures its own.
"""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time
from typing import Literal

import tyro

from benchmarks.harness.made_home import write_home
from benchmarks.harness.paths import ROOT, WORK, environment, module
from ig2mj.process.processors import available

SIZES = (20, 60, 120)
PROFILES = WORK / "profiles"

MOST_JOBS = 4
"""Processes that share a card of 80 GB while they are compiled and timed: eight run out of its memory."""

FEWEST_SECONDS = 45.0
"""A case is not begun with less time than this left."""

README_LIMIT = 480.0
"""s that a case of README.md may take, which waits for others to be timed while it holds what it has compiled."""


@dataclasses.dataclass(frozen=True)
class Job:
    """A process: its name, its words after `python`, the seconds it may take, what its environment has besides, and the
    Python that runs it."""

    name: str
    words: tuple[str, ...]
    limit: float = 300.0
    env: dict[str, str] = dataclasses.field(default_factory=dict)
    python: str = sys.executable


@dataclasses.dataclass
class Args:
    """What to run."""

    plan: tyro.conf.Positional[Literal["calibrate", "throughput", "readme"]]
    """calibrate: buffer sizes; throughput: control steps per second; readme: those of the README's table."""
    out: pathlib.Path = WORK / "gpu_suite"
    """Folder for rows, profiles and logs."""
    minutes: float = 0.0
    """Time limit; 0: 3 for calibrate, 8 for the others."""
    jobs: int = 0
    """Processes at the same time; 0: one per two processors, and no more than `MOST_JOBS`."""
    only: tuple[str, ...] = ()
    """Only cases whose name contains one of these."""
    worlds: int = 0
    """calibrate: worlds measured side by side; 0: what `ig2mj calibrate` takes."""
    most_worlds: int = 0
    """throughput: cases with more worlds are cut down to this; 0: as planned. For small machines."""


def calibrations(homes: dict[str, str], out: pathlib.Path, worlds: int) -> list[Job]:
    """One per home: made ones, those of Table A.7's sizes, then the others."""
    first = [*(f"made_{n}" for n in SIZES), "aspen", "birch", "spruce"]
    order = [*first, *sorted(set(homes) - set(first))]
    words = (*module("harness.calibrate_home"), "--out", str(out / "profiles"), "--worlds", str(worlds))
    return [Job(name, (*words, homes[name])) for name in order if name in homes]


def throughputs(homes: dict[str, str], out: pathlib.Path, most: int) -> list[Job]:
    """The cases of the report, the most important first."""
    common = ("--rows", str(out / "throughput.jsonl"), "--lock", str(out / "lock"), "--profiles", str(PROFILES))

    def job(home: str, worlds: tuple[int, ...], what: str = "full", idle: bool = False, label: str = "") -> Job:
        counts = sorted({min(w, most) for w in worlds}) if most else worlds
        words = [*module("speed.batch"), homes[home], "--worlds", *map(str, counts), "--what", what, *common]
        words += ["--idle"] if idle else []
        words += ["--label", label] if label else []
        size = f"{min(counts)}..{max(counts)}" if len(counts) > 1 else f"{min(counts)}"
        return Job("-".join([home, "idle" if idle else "disturbed", what, size, *label.split()]), tuple(words))

    small, middle = (1, 4, 16, 64), (256, 1024, 4096)
    plan = [
        job("made_60", (16384,)),
        job("made_20", (16384,)),
        job("made_120", (8192,)),
        job("made_60", (8192,), "camera"),
        job("birch", (8192,)),
        job("birch", (8192,), "camera"),
        job("made_20", (32768,)),
        job("made_60", (16384,), idle=True),
        job("made_60", middle),
        job("made_60", small),
        job("made_120", (16384,)),
        job("made_60", (16384,), label="warm start"),
        job("made_60", (16384,), "physics"),
        job("made_60", (16384,), "view"),
        job("made_20", middle),
        job("made_120", middle),
        job("made_60", middle, idle=True),
        job("made_60", (8192,), "camera", idle=True),
        job("made_20", (16384,), idle=True),
        job("made_120", (16384,), idle=True),
        job("spruce", (4096,)),
        job("aspen", (8192,)),
        job("made_20", (8192,), "camera"),
        job("made_120", (4096,), "camera"),
        job("made_20", small),
        job("made_120", small),
        job("made_20", middle, idle=True),
        job("made_120", middle, idle=True),
        job("made_60", small, idle=True),
        job("made_20", small, idle=True),
        job("made_120", small, idle=True),
    ]
    return plan


def readme_rows(homes: dict[str, str], out: pathlib.Path) -> list[Job]:
    """The cases of README.md's table, one protocol for all; `readme_table.py` makes the table of their rows."""
    common = ("--rows", str(out / "readme.jsonl"), "--lock", str(out / "lock"))

    def batch(home: str, worlds: int, *what: str, engine: str = "ig2mj") -> Job:
        words = (*module("speed.batch"), homes[home], "--worlds", str(worlds), "--what", *what)
        return Job("-".join([home, *what, engine]), (*words, "--engine", engine, *common), README_LIMIT)

    def cooking(*observations: str) -> Job:
        words = [*module("speed.environments"), "CookingMeat", "--worlds", "4096"]
        words += ["--observations", *observations] if observations else []
        return Job("-".join(["cooking", *observations]), (*words, *common), README_LIMIT)

    return [
        batch("birch", 8192, "physics", "full"),
        cooking("rgb", "depth"),
        batch("birch", 8192, "camera"),
        cooking(),
        batch("birch", 8192, "physics", engine="mujoco_warp"),
        batch("made_60", 16384, "full"),
        batch("made_60", 8192, "camera"),
        batch("made_120", 16384, "full"),
        batch("made_20", 32768, "full"),
    ]


class Runner:
    """Runs jobs side by side until all are done or the time is over."""

    def __init__(self, out: pathlib.Path, failures: pathlib.Path, jobs: int, seconds: float):
        self.out, self.failures, self.jobs = out, failures, jobs
        self.end = time.monotonic() + seconds
        self.done: list[str] = []
        self._running: list[tuple[Job, subprocess.Popen, float]] = []

    def run(self, queue: list[Job]) -> None:
        """Begins jobs in order, as places become free."""
        (self.out / "logs").mkdir(parents=True, exist_ok=True)
        waiting = list(queue)
        while waiting or self._running:
            while waiting and len(self._running) < self.jobs:
                if self.end - time.monotonic() < FEWEST_SECONDS:
                    for job in waiting:
                        self._tell(job, "left out: no time")
                    waiting = []
                    break
                self._begin(waiting.pop(0))
            self._look()
            time.sleep(0.2)

    def _begin(self, job: Job) -> None:
        log = (self.out / "logs" / f"{job.name}.txt").open("w")
        # Memory as needed, not all of the device for the first; in a group of its own, to be ended with its children.
        env = environment(XLA_PYTHON_CLIENT_PREALLOCATE="false") | job.env
        words = ["nice", "-n", "5", job.python, *job.words]
        process = subprocess.Popen(words, stdout=log, stderr=subprocess.STDOUT, env=env, start_new_session=True)
        log.close()
        self._running.append((job, process, min(self.end, time.monotonic() + job.limit)))
        print(f"begun  {job.name}", flush=True)

    def _look(self) -> None:
        for entry in list(self._running):
            job, process, limit = entry
            code = process.poll()
            if code is None and time.monotonic() < limit:
                continue
            if code is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            self._running.remove(entry)
            if code == 0:
                self.done.append(job.name)
                print(f"done   {job.name}", flush=True)
            else:
                self._tell(job, "time limit" if code is None else f"ended with {code}")

    def _tell(self, job: Job, why: str) -> None:
        log = self.out / "logs" / f"{job.name}.txt"
        tail = log.read_text(errors="replace").splitlines()[-5:] if log.exists() else []
        print(f"FAILED {job.name}: {why}", flush=True)
        with self.failures.open("a") as file:
            file.write(json.dumps({"failed": job.name, "why": why, "tail": tail}) + "\n")


def keep_profiles(out: pathlib.Path) -> None:
    """Copies what was calibrated to where `throughput` looks."""
    for file in (out / "profiles").glob("*/engine_profile.json"):
        (PROFILES / file.parent.name).mkdir(parents=True, exist_ok=True)
        shutil.copy(file, PROFILES / file.parent.name / file.name)


def main(args: Args) -> list[str]:
    """Runs the plan and returns the names of the cases that were done."""
    args.out.mkdir(parents=True, exist_ok=True)
    homes = {f"made_{n}": str(write_home(WORK / f"made_{n}", n)) for n in SIZES}
    homes |= {file.parent.name: file.parent.name for file in (ROOT / "scenes_mjcf").glob("*/manifest.json")}
    seconds = 60 * (args.minutes or {"calibrate": 3.0}.get(args.plan, 8.0))
    jobs = args.jobs or max(1, min(MOST_JOBS, available() // 2))
    if args.plan == "calibrate":
        queue = calibrations(homes, args.out, args.worlds)
    elif args.plan == "readme":
        queue = readme_rows(homes, args.out)
    else:
        queue = throughputs(homes, args.out, args.most_worlds)
    queue = [job for job in queue if not args.only or any(word in job.name for word in args.only)]
    runner = Runner(args.out, args.out / f"{args.plan}.jsonl", jobs, seconds)
    runner.run(queue)
    if args.plan == "calibrate":
        keep_profiles(args.out)
    print(f"{len(runner.done)} of {len(queue)} done")
    return runner.done


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
