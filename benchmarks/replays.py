"""Do recorded episodes come out the same, byte for byte, in a fresh process, on any number of threads?

    python benchmarks/replays.py --episodes 2000 --jobs 30 --minutes 9 --out out/replays

A case is a task, a robot, and an expert (with noise) or random actions; its episodes are played in several pieces, each
from other start states. One process records a piece, another replays it by action and compares every byte of every
frame; about `THREADED` episodes of experts are replayed again with 2 and with 8 threads, each time in a process of its
own. After `--minutes` what runs is ended. Each piece that was finished is a file, which is not done again in the same
folder. `rows.jsonl`, `summary.json` and `table.md` are brought up to date after every piece.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import io
import json
import os
import pathlib
import subprocess
import sys
import threading
import time
from typing import Any

from results import machine, save, table

NOISE = 0.1
"""Deviation of what is added to the experts' actions, so that no two episodes are alike."""

ROWS = 32
"""Start states of each task; those of activities are sampled first, by one process each."""

THREADED, THREADS = 200, (2, 8)
"""Episodes that are replayed with more threads, too, and with how many; the first replay has one."""

ONE_THREAD = {
    "JAX_PLATFORMS": "cpu",
    "OMP_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}
"""Of each process, so that many of them share a machine."""

Case = tuple[str, str, str]
"""(task, robot, who acts)."""


def cases() -> list[Case]:
    """All registered tasks with two robots each; experts where there are some."""
    from ig2mj.envs.names import NAMES
    from ig2mj.envs.registry import find_task
    from ig2mj.tasks.experts.expert import PLANS

    found = []
    for name in NAMES:
        for robot in list(find_task(name).robots)[:2]:
            found += [(name, robot, agent) for agent in ("random", "expert") if agent == "random" or name in PLANS]
    return found


def record(task: str, robot: str, agent: str, episodes: int, worlds: int, file: str, seed: int) -> dict[str, Any]:
    """Plays a piece's episodes and writes them."""
    import numpy as np

    import ig2mj
    from ig2mj.demos import record as recorded
    from ig2mj.envs.experts import expert_of
    from ig2mj.envs.rollout import play

    env = ig2mj.make(task, robot=robot, worlds=worlds, engine="native", threads=1, pool_size=ROWS)
    rng, shape = np.random.default_rng(seed), (worlds, *env.action_space.shape)
    if agent == "random":
        act = lambda state: rng.uniform(-1, 1, shape).astype(np.float32)  # noqa: E731
    else:
        expert = expert_of(env)
        act = lambda state: np.asarray(expert(state)) + NOISE * rng.standard_normal(shape)  # noqa: E731
    with recorded(env, file) as played:
        outcome = play(played, act, episodes, seed)
    return {"success": sum(outcome.success)}


def replay(file: str, threads: int) -> dict[str, Any]:
    """Replays the episodes of a recording by action, and says what came of it."""
    from ig2mj.demos import Recording, Replayer

    with Recording(file) as recording:
        replayer = Replayer(recording, threads=threads)
        runs = [run for run in recording.runs if run.attributes.get("ended") and run.frames > 1]
        done = replayer(check=True, runs=runs)
    about = {"runs": done.runs, "frames": done.frames, "different": len(done.differences)}
    return about | {"first": [str(d) for d in done.differences[:3]], "warnings": done.warnings}


def sample(task: str) -> dict[str, Any]:
    """Makes an activity's start states, if they are not there."""
    from ig2mj.envs.registry import find_task
    from ig2mj.tasks.pools import pool_of
    from ig2mj.tasks.task import Task

    found = find_task(task)
    return {"rows": pool_of(found, "train", ROWS).size if isinstance(found, Task) else 0}


class Pieces:
    """All pieces of all cases: which there are, which are done, and the time that is left."""

    def __init__(self, options: argparse.Namespace):
        self.out: pathlib.Path = options.out
        self.worlds, self.keep = options.worlds, options.keep
        self.ends = time.monotonic() + 60 * options.minutes
        chosen = [case for case in cases() if options.only in "_".join(case)]
        each = -(-options.episodes // len(chosen))
        count = options.pieces or max(1, round(3 * options.jobs / len(chosen)))
        sizes = [each // count + (k < each % count) for k in range(count)]
        # First pieces of all cases first: where time runs out, each case has some episodes.
        self.all = [(case, k, size) for k, size in enumerate(sizes) for case in chosen if size]
        experts = sorted({case for case in chosen if case[2] == "expert"})
        self.more_threads: set[tuple[Case, int]] = set()
        left = THREADED * options.episodes / 2000
        for k, size in enumerate(sizes):
            for case in experts:
                if left > 0:
                    self.more_threads.add((case, k))
                    left -= size
        self._lock, self._rows = threading.Lock(), []
        self.pools: dict[str, concurrent.futures.Future] = {}

    def process(self, *arguments: str) -> dict[str, Any]:
        """This program anew, and what it prints last. `error`: it failed. `late`: the time was up."""
        left = self.ends - time.monotonic()
        if left <= 0:
            return {"late": True}
        command = [sys.executable, __file__, *arguments]
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, check=False, env=os.environ | ONE_THREAD, timeout=left
            )
        except subprocess.TimeoutExpired:
            return {"late": True}
        if done.returncode:
            return {"error": (done.stderr.strip().splitlines() or ["no message"])[-1]}
        return json.loads(done.stdout.strip().splitlines()[-1])

    def __call__(self, case: Case, number: int, episodes: int) -> None:
        """Records and replays a piece, or reads what came of it before."""
        name = f"{'_'.join(case)}_{number}"
        kept, file = self.out / f"{name}.json", self.out / f"{name}.h5"
        if kept.exists():
            return self._add(json.loads(kept.read_text()))
        if case[0] in self.pools:
            self.pools[case[0]].result()
        began = time.monotonic()
        row: dict[str, Any] = dict(zip(("task", "robot", "agent"), case, strict=True)) | {"piece": number}
        steps = [("", "--record", *case, str(episodes), str(self.worlds), str(file), str(number))]
        steps += [("", "--replay", str(file), "1")]
        if (case, number) in self.more_threads:
            steps += [(str(n), "--replay", str(file), str(n)) for n in THREADS]
        for threads, *arguments in steps:
            came = self.process(*arguments)
            if threads and "late" not in came:
                row.setdefault("threads", {})[threads] = came
            else:
                row |= came
            if "late" in came or "error" in came:
                break
        if file.exists():
            row["megabytes"] = round(file.stat().st_size / 1e6, 2)
            if not self.keep:
                file.unlink()
        row["seconds"] = round(time.monotonic() - began)
        if "late" not in row:
            kept.write_text(json.dumps(row))
        if "late" not in row or "runs" in row:
            print(json.dumps(row), flush=True)
            self._add(row)

    def _add(self, row: dict[str, Any]) -> None:
        with self._lock:
            self._rows.append(row)
            self.write()

    def write(self) -> dict[str, Any]:
        """Leaves rows, sums and a table of what is done by now; returns the sums."""
        rows = sorted(self._rows, key=lambda row: [row[name] for name in ("task", "robot", "agent", "piece")])
        (self.out / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
        good = [row for row in rows if "runs" in row]
        summary = {
            "episodes": sum(row["runs"] for row in good),
            "frames": sum(row["frames"] for row in good),
            "different": sum(row["different"] for row in good),
            "succeeded": sum(row["success"] for row in good),
            "cases": len({(row["task"], row["robot"], row["agent"]) for row in good}),
            "pieces": f"{len(good)} of {len(self.all)}",
            "threads": {},
            "failed": [
                row for row in rows if "error" in row or any("error" in t for t in row.get("threads", {}).values())
            ],
            "machine": machine(-1),
        }
        for n in map(str, THREADS):
            done = [row["threads"][n] for row in good if "runs" in row.get("threads", {}).get(n, {})]
            summary["threads"][n] = {key: sum(d[key] for d in done) for key in ("runs", "frames", "different")}
        (self.out / "summary.json").write_text(json.dumps(summary, indent=1) + "\n")
        lines = []
        for case in sorted({(row["task"], row["robot"], row["agent"]) for row in good}):
            mine = [row for row in good if (row["task"], row["robot"], row["agent"]) == case]
            added = [str(sum(row[key] for row in mine)) for key in ("runs", "frames", "different")]
            lines.append([case[0], case[1], case[2], *added])
        columns = ("task", "robot", "who acts", "episodes", "frames", "different")
        with contextlib.redirect_stdout(io.StringIO()):
            save("replays", -1, {}, rows, [table("Replayed by action in a fresh process", columns, lines)], self.out)
        return summary


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=2000, help="of all cases together")
    parser.add_argument("--worlds", type=int, default=8, help="of a piece, beside each other")
    parser.add_argument("--pieces", type=int, default=0, help="of each case; 0: three for each job")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--minutes", type=float, default=600.0, help="after which what runs is ended")
    parser.add_argument("--only", default="", help="cases whose names have this in them")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/replays"))
    parser.add_argument("--keep", action="store_true", help="the recordings")
    parser.add_argument("--sample", help=argparse.SUPPRESS)
    parser.add_argument("--record", nargs=7, help=argparse.SUPPRESS)
    parser.add_argument("--replay", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.sample:
        return print(json.dumps(sample(options.sample)))
    if options.record:
        task, robot, agent, episodes, worlds, file, seed = options.record
        return print(json.dumps(record(task, robot, agent, int(episodes), int(worlds), file, int(seed))))
    if options.replay:
        return print(json.dumps(replay(options.replay[0], int(options.replay[1]))))
    options.out.mkdir(parents=True, exist_ok=True)
    pieces = Pieces(options)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        activities = dict.fromkeys(case[0] for case, _, _ in pieces.all if case[2] == "expert")
        pieces.pools = {task: pool.submit(pieces.process, "--sample", task) for task in activities}
        # What waits for no start states begins first.
        order = sorted(pieces.all, key=lambda piece: (piece[1], piece[0][0] in activities))
        for done in [pool.submit(pieces, *piece) for piece in order]:
            done.result()
    print(json.dumps(pieces.write()))


if __name__ == "__main__":
    main()
