"""How often do the scripted experts succeed? Activities, robots and modes of grasping, on held-out start states.

    python -m benchmarks.learning.experts --jobs 48 --episodes 200 --minutes 8      # everything; goes on where it ended
    python -m benchmarks.learning.experts --tasks SlicingFruit --robots fetch --episodes 32 --out out/experts
    python -m benchmarks.learning.experts --table                                   # the table of docs/guide/experts.md

First the pools of held-out states are sampled, as far as they are not in the cache. Then every case is cut into parts
of `--worlds` episodes, each played in a process of its own, native engine, one thread. A part that is done adds a line
to `rows.jsonl` and is not done again (with `--force` it is). At the time limit what still runs is given up; the lines
stay.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import contextlib
import dataclasses
import json
import pathlib
import subprocess
import sys
import time
from typing import Any

from benchmarks.harness.pages import between
from benchmarks.harness.paths import ROOT, environment, module
from benchmarks.harness.results import RESULTS
from ig2mj.process.processors import available

ROWS = RESULTS / "experts" / "rows.jsonl"
"""What the table of docs/guide/experts.md is made of."""

PAGE = ROOT / "docs" / "guide" / "experts.md"

BEGIN, END = "<!-- begin: python -m benchmarks.learning.experts --table -->", "<!-- end of the table -->"
"""Lines of the page between which the table stands."""

GRASPING = ("mitten", "physical", "assisted")
"""Modes in the order in which they are measured, in case time does not suffice."""

ONE_THREAD = {
    "JAX_PLATFORMS": "cpu",
    "OMP_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}
"""Of each process, so that many of them share a machine."""


Key = tuple[str, str, str, int, int, int]


@dataclasses.dataclass(frozen=True)
class Part:
    """Some episodes of a case: `count` held-out rows from `first` on, of a pool of `episodes` rows."""

    task: str
    robot: str
    grasping: str
    first: int
    count: int
    episodes: int
    variant: int = 0

    @property
    def key(self) -> Key:
        """What its row in the rows' file begins with."""
        return self.task, self.robot, self.grasping, self.first, self.count, self.variant


def parts(options: argparse.Namespace) -> list[Part]:
    """All that is to be played, in the order of what it is worth."""
    from ig2mj.tasks.activities import ACTIVITIES

    found = [
        Part(name, robot, grasping, first, min(options.worlds, options.episodes - first), options.episodes, variant)
        for name, task in ACTIVITIES.items()
        for robot in task.robots
        for grasping in options.grasping
        for variant in options.variants
        for first in range(0, options.episodes, options.worlds)
        if name in options.tasks and robot in options.robots
    ]
    return sorted(found, key=lambda part: (part.variant > 0, GRASPING.index(part.grasping), part.first))


def play_part(part: Part) -> dict[str, Any]:
    """Plays the episodes, in this process. `failed`: numbers of the pool's rows."""
    import ig2mj
    from ig2mj.envs.experts import expert_of
    from ig2mj.envs.rollout import play
    from ig2mj.tasks.activities import ACTIVITIES
    from ig2mj.tasks.pools import start_states
    from ig2mj.tasks.variants import variant

    began, pool = time.process_time(), min_pool(part.episodes)
    settings = {"split": "held_out", "pool_size": pool, "variant": part.variant, "threads": 1}
    env = ig2mj.make(part.task, part.robot, part.count, "native", part.grasping, **settings)
    done = play(env, expert_of(env), part.count, in_order=True, first=part.first)
    metrics = env.metrics(done.state)
    task = variant(ACTIVITIES[part.task], part.variant, part.grasping)
    return {
        "task": part.task,
        "robot": part.robot,
        "grasping": part.grasping,
        "variant": part.variant,
        "first": part.first,
        "count": part.count,
        "failed": [part.first + k for k, good in enumerate(done.success) if not good],
        "not_in_hand": [part.first + k for k, good in enumerate(done.outcomes["success_in_hand"]) if not good],
        "mean_return": round(sum(done.total) / part.count, 3),
        "overflow": int(metrics["overflow"]),
        "non_finite": int(metrics["not_finite"]),
        "pool": start_states(task, "held_out").cached.stem.rsplit("-", 1)[1],
        "processor_s": round(time.process_time() - began, 1),
        "date": time.strftime("%Y-%m-%d"),
    }


def min_pool(episodes: int) -> int:
    """Rows of the pool that is sampled: its first ones are the same whatever its size."""
    return max(32, episodes)


def make_pools(names: list[str], variants: list[int], modes: list[str], episodes: int, jobs: int) -> None:
    """Samples the pools that are not in the cache, side by side."""
    from ig2mj.tasks.activities import ACTIVITIES
    from ig2mj.tasks.pools import pool_of, sampling_processes, start_states
    from ig2mj.tasks.variants import variant

    every = [variant(ACTIVITIES[name], number, mode) for name in names for number in variants for mode in modes]
    tasks = list({start_states(task, "held_out").cached.name: task for task in every}.values())
    with (
        sampling_processes(jobs) as workers,
        concurrent.futures.ThreadPoolExecutor(len(tasks)) as threads,
    ):
        list(threads.map(lambda task: pool_of(task, "held_out", min_pool(episodes), workers=workers), tasks))


def _process(part: Part, end: float) -> dict[str, Any]:
    """A part, in a process of its own. `error`: it failed, or time was up."""
    command = [sys.executable, *module("learning.experts"), "--part", json.dumps(dataclasses.asdict(part))]
    left = end - time.monotonic()
    if left < 5:
        return {"error": "no time left"}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=environment(**ONE_THREAD), timeout=left
        )
    except subprocess.TimeoutExpired:
        return {"error": "no time left"}
    if done.returncode:
        return {"error": (done.stderr.strip().splitlines() or ["no message"])[-1]}
    return json.loads(done.stdout.strip().splitlines()[-1])


def read_rows(file: pathlib.Path) -> list[dict[str, Any]]:
    """The rows of a file; of two of the same part the later one."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    rows = [json.loads(line) for line in lines]
    return list({_key(row): row for row in rows}.values())


def _key(row: dict[str, Any]) -> Key:
    return row["task"], row["robot"], row["grasping"], row["first"], row["count"], row.get("variant", 0)


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Lines of Markdown: a row for each activity and variant, a column for each robot and mode of grasping."""
    from ig2mj.tasks.activities import ACTIVITIES

    sums: dict[tuple[str, int, str, str], list[int]] = {}
    for row in rows:
        total = sums.setdefault((row["task"], row.get("variant", 0), row["robot"], row["grasping"]), [0, 0])
        total[0] += row["count"] - len(row["failed"])
        total[1] += row["count"]
    columns = [(robot, grasping) for robot in ("humanoid", "fetch") for grasping in GRASPING]
    columns = [c for c in columns if any(key[2:] == c for key in sums)]
    if not columns:
        return ["Nothing was measured yet."]
    lines = ["| | " + " | ".join(f"{robot}, {grasping}" for robot, grasping in columns) + " |"]
    lines.append("|---|" + "--:|" * len(columns))
    for name, number in [(name, number) for number in sorted({key[1] for key in sums}) for name in ACTIVITIES]:
        cells = []
        for robot, grasping in columns:
            good, played = sums.get((name, number, robot, grasping), (0, 0))
            absent = "n/a" if robot not in ACTIVITIES[name].robots else "-"
            cells.append(f"{good} of {played}" if played else absent)
        lines.append(f"| {name}{f', variant {number}' if number else ''} | " + " | ".join(cells) + " |")
    return lines


def page_with(text: str, rows: list[dict[str, Any]]) -> str:
    """The page with the table of these rows."""
    dates = sorted({row["date"] for row in rows})
    when = [f"Measured: {' to '.join(dict.fromkeys((dates[0], dates[-1])))}.", ""] if dates else []
    return between(text, BEGIN, END, "\n".join(["", "", *when, *table(rows), "", ""]))


def measure(options: argparse.Namespace) -> int:
    """Plays what is not in the rows' file yet; 1 where something failed."""
    end = time.monotonic() + 60 * options.minutes
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "rows.jsonl"
    there = set() if options.force else {_key(row) for row in read_rows(file)}
    todo = [part for part in parts(options) if part.key not in there]
    if todo:
        names = dict.fromkeys(part.task for part in todo)
        numbers = ["--episodes", str(options.episodes), "--jobs", str(options.jobs), "--variants"]
        numbers += [*map(str, options.variants), "--grasping", *options.grasping]
        command = [sys.executable, *module("learning.experts"), "--pools", *numbers, "--tasks", *names]
        with contextlib.suppress(subprocess.TimeoutExpired):
            subprocess.run(command, env=environment(**ONE_THREAD), timeout=60 * options.minutes)
        print(f"pools after {time.monotonic() - end + 60 * options.minutes:.0f} s; {len(todo)} parts", flush=True)
    wrong = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool, file.open("a", encoding="utf-8") as rows:
        for row in (f.result() for f in concurrent.futures.as_completed([pool.submit(_process, p, end) for p in todo])):
            wrong += "error" in row
            if "error" not in row:
                rows.write(json.dumps(row) + "\n")
                rows.flush()
            elif row["error"] != "no time left":
                print(row["error"], file=sys.stderr, flush=True)
    print("\n".join(table(read_rows(file))))
    print(f"{len(todo) - wrong} of {len(todo)} parts played; rows: {file}")
    return int(wrong > 0)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="*", help="default: all six")
    parser.add_argument("--robots", nargs="*", default=["humanoid", "fetch"])
    parser.add_argument("--grasping", nargs="*", default=list(GRASPING), choices=GRASPING)
    parser.add_argument("--variants", nargs="*", type=int, default=[0], help="of the objects; 0: the task's own")
    parser.add_argument("--episodes", type=int, default=200, help="held-out states of each case")
    parser.add_argument("--worlds", type=int, default=25, help="episodes of a part, side by side in one process")
    parser.add_argument("--jobs", type=int, default=available())
    parser.add_argument("--minutes", type=float, default=60.0, help="after which it ends with what it has")
    parser.add_argument("--force", action="store_true", help="play what has been played, too")
    parser.add_argument("--out", type=pathlib.Path, default=ROWS.parent)
    parser.add_argument("--table", action="store_true", help=f"only write the table of {PAGE.name}")
    parser.add_argument("--pools", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--part", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.part:
        print(json.dumps(play_part(Part(**json.loads(options.part)))))
        return 0
    if options.table:
        PAGE.write_text(
            page_with(PAGE.read_text(encoding="utf-8"), read_rows(options.out / "rows.jsonl")), encoding="utf-8"
        )
        return 0
    from ig2mj.tasks.activities import ACTIVITIES

    options.tasks = options.tasks or list(ACTIVITIES)
    unknown = set(options.tasks) - set(ACTIVITIES)
    if unknown:
        parser.error(f"no such tasks: {', '.join(sorted(unknown))}; there are {', '.join(ACTIVITIES)}")
    if options.pools:
        make_pools(options.tasks, options.variants, options.grasping, options.episodes, options.jobs)
        return 0
    return measure(options)


if __name__ == "__main__":
    sys.exit(main())
