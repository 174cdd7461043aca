"""BEHAVIOR's activities, planned and carried out on a rung: one row for every activity and start state.

    python -m benchmarks.planning.activities --rung symbolic --starts 100 --jobs 64 --out rows
    python -m benchmarks.planning.activities --rung physics --starts 100 --jobs 64 --out rows
    python -m benchmarks.planning.activities --rung physics --starts 10 --activities making_tea --out rows
    python -m benchmarks.planning.activities --rung physics --starts 10 --agent random --out rows
    python -m benchmarks.planning.activities --rung physics --starts 10 --doors shut --out rows
    python -m benchmarks.planning.activities --rung physics --starts 10 --home other --out rows
    python -m benchmarks.planning.activities --rung physics --starts 10 --grasping physical --out rows
    python -m benchmarks.planning.activities --rung physics --starts 10 --moved once --out rows

Rows are appended to OUT/<rung>.jsonl, each as soon as it is there. A run that was interrupted continues where it ended;
rows of other conditions (split, seed, robot, doors, agent, home, grasping, moved) stay. Start states are sampled first,
each activity by one process, and kept in ig2mj's cache. Each process computes with one thread. A process that crashes,
or is silent for `--silence` seconds, leaves a row that says so for the start that it was at, and the others go on.
`python -m benchmarks.planning.page` makes the page from the rows.
"""

from __future__ import annotations

import argparse
import collections
import concurrent.futures
import dataclasses
import json
import pathlib
import queue
import sys
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from benchmarks.harness.paths import ROOT, module
from benchmarks.harness.results import provenance
from benchmarks.planning.worker import DEFAULTS, add_conditions
from benchmarks.sampling.behavior_goals import RESULTS, sampled_homes
from ig2mj.cluster.reporting import ProcessEnded, reports
from ig2mj.cluster.versions import versions

RUNGS = ("symbolic", "kinematic", "physics")
TOGETHER = {"symbolic": 20, "kinematic": 10, "physics": 5}
"""Starts that one process solves, one after another."""

FEW = 4
"""Processes with which an activity is finished before the next; with more, all start states are sampled first."""

CONDITIONS = ("rung", "robot", "split", "doors", "seed")
"""Arguments that a row holds, and by which it is found again."""

Row = dict[str, Any]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--rung", choices=RUNGS, required=True)
    parser.add_argument("--activities", nargs="*", help="just these; default: all of which starts can be sampled")
    parser.add_argument("--starts", type=int, default=10, help="start states of each activity")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=pathlib.Path, required=True, metavar="FOLDER")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--split", default="held_out")
    parser.add_argument("--doors", choices=("open", "shut"), default="open")
    add_conditions(parser)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=1800.0, help="wall time of an episode")
    parser.add_argument("--silence", type=float, default=900.0, help="seconds without a step that end a process")
    parser.add_argument("--record", type=pathlib.Path, metavar="FOLDER", help="of recordings of episodes in physics")
    parser.add_argument("--again", action="store_true", help="repeat starts at which a process crashed or was ended")
    parser.add_argument("--until", type=float, default=float("inf"), help="seconds after which nothing is begun")
    args = parser.parse_args()
    names = args.activities or sorted(sampled_homes(RESULTS / "starts"))
    args.out.mkdir(parents=True, exist_ok=True)
    if args.record is not None:
        if args.rung != "physics":
            parser.error("--record is of episodes in physics (--rung physics)")
        args.record.mkdir(parents=True, exist_ok=True)
    run = _Run(args, names)
    try:
        run.all()
    except KeyboardInterrupt:
        run.stopped.set()
        print("interrupted; the same command continues", file=sys.stderr)
        raise SystemExit(130) from None


@dataclasses.dataclass
class _Job:
    """Starts of an activity for one process; none: its start states are to be sampled."""

    activity: str
    starts: tuple[int, ...] = ()


class _Run:
    def __init__(self, args: argparse.Namespace, names: Sequence[str]):
        self.args, self.names = args, names
        self.file = args.out / f"{args.rung}.jsonl"
        self.logs = args.out / "logs"
        self.logs.mkdir(exist_ok=True)
        self.conditions = {name: getattr(args, name) for name in CONDITIONS}
        varied = {name: getattr(args, name, usual) for name, usual in DEFAULTS.items()}
        self.conditions |= {name: value for name, value in varied.items() if value != DEFAULTS[name]}
        self.stopped = threading.Event()
        self.began = time.monotonic()
        self.made_by = {**provenance(), "versions": versions()}
        self.lock = threading.Lock()
        few = args.jobs <= FEW
        self.jobs: queue.Queue[_Job | None] = queue.LifoQueue() if few else queue.Queue()
        self.open_jobs = 0
        self.counts: collections.Counter[str] = collections.Counter()
        kept = [row for row in read_rows([self.file]) if row["conditions"] == self.conditions]
        if args.again:
            kept = [row for row in kept if not row["crashed"]]
        self.done = {(row["activity"], row["start"]) for row in kept}

    def all(self) -> None:
        missing = [name for name in self.names if any((name, n) not in self.done for n in range(self.args.starts))]
        for name in missing if self.args.jobs > FEW else reversed(missing):
            self.put(_Job(name))
        workers = max(1, self.args.jobs)
        if not self.open_jobs:
            print("all rows are there")
            return
        with concurrent.futures.ThreadPoolExecutor(workers) as pool:
            running = [pool.submit(self.work) for _ in range(workers)]
            try:
                for future in running:
                    future.result()
            except BaseException:
                self.stopped.set()
                for _ in range(workers):
                    self.jobs.put(None)
                raise

    def put(self, job: _Job) -> None:
        with self.lock:
            self.open_jobs += 1
        self.jobs.put(job)

    def work(self) -> None:
        """Takes jobs until none is left; a job may add others."""
        while (job := self.jobs.get()) is not None:
            if not self.stopped.is_set() and time.monotonic() - self.began < self.args.until:
                self.sample(job) if not job.starts else self.solve(job)
            with self.lock:
                self.open_jobs -= 1
                last = not self.open_jobs
            if last:
                for _ in range(max(1, self.args.jobs)):
                    self.jobs.put(None)

    def sample(self, job: _Job) -> None:
        size, home, why = 0, "", ""
        try:
            for told in self.told(job, "--count", str(self.args.starts)):
                size, home = told["size"], told["home"]
        except ProcessEnded as e:
            why = str(e)
        if not size:
            detail = why or "no start state could be sampled"
            self.keep(job.activity, 0, home, _without(detail), crashed=True)
            return
        missing = [n for n in range(size) if (job.activity, n) not in self.done]
        together = TOGETHER[self.args.rung]
        for k in range(0, len(missing), together):
            self.put(_Job(job.activity, tuple(missing[k : k + together])))

    def solve(self, job: _Job) -> None:
        left = list(job.starts)
        while left and not self.stopped.is_set():
            at, step = left[0], ""
            try:
                for told in self.told(job, "--starts", *map(str, left), "--count", str(self.args.starts)):
                    at = told["start"]
                    if told["event"] == "step":
                        step = told["step"]
                    elif told["event"] == "begin":
                        step = ""
                    else:
                        left.remove(at)
                        result = told["result"] if told["event"] == "row" else _without(told["why"])
                        crashed = told["event"] == "failed"
                        self.keep(job.activity, at, told["home"], result, crashed, told.get("processor", 0.0))
                return
            except ProcessEnded as e:
                if self.stopped.is_set():
                    return
                if at in left:
                    left.remove(at)
                    self.keep(job.activity, at, "", _without(f"{e}" + (f", in {step}" if step else "")), crashed=True)

    def told(self, job: _Job, *arguments: str) -> Iterable[Row]:
        """What a process reports."""
        args = self.args
        options = [f"--{name}={value}" for name, value in self.conditions.items()]
        options += [f"--record={args.record.resolve()}"] if args.record is not None else []
        command = [sys.executable, *module("planning.worker"), job.activity, "--child", *options]
        log = self.logs / f"{job.activity}.{args.rung}.txt"
        for told in reports([*command, f"--seconds={args.seconds}", *arguments], lambda: args.silence, log, cwd=ROOT):
            yield told
            if self.stopped.is_set():
                return

    def keep(self, activity: str, start: int, home: str, result: Row, crashed: bool, processor: float = 0.0) -> None:
        row = {
            "activity": activity,
            "start": start,
            "home": home,
            "conditions": self.conditions,
            "crashed": crashed,
            "processor": processor,
            **result,
            **self.made_by,
        }
        with self.lock:
            with self.file.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(row) + "\n")
            self.counts["done"] += 1
            self.counts["solved"] += result["success"]
            passed = time.monotonic() - self.began
            state = "solved" if result["success"] else f"not solved (q {result['q']:.2f}): {result['ended']}"
            print(
                f"{passed:.0f} s: {activity} {start}: {state} [{self.counts['solved']} of {self.counts['done']}]",
                flush=True,
            )


def _without(why: str) -> Row:
    """The result of an episode that did not end by itself."""
    return {
        "success": False, "q": 0.0, "replans": 0, "planned": 0, "seconds": 0.0, "time": 0.0, "ended": why, "steps": [],
    }  # fmt: skip


def read_rows(files: Iterable[pathlib.Path]) -> list[Row]:
    """Rows of files; of several of one activity, start and conditions the last. A line that was cut off is left out."""
    found: dict[Any, Row] = {}
    for file in files:
        if not file.is_file():
            continue
        for line in file.read_text(encoding="utf-8").splitlines():
            try:
                row: Mapping[str, Any] = json.loads(line)
            except ValueError:
                continue
            found[row["activity"], row["start"], json.dumps(row["conditions"], sort_keys=True)] = dict(row)
    return list(found.values())


if __name__ == "__main__":
    main()
