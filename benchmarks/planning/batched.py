"""The planner in many worlds of one environment: success, demonstrations an hour, and planning's share of wall time.

    python -m benchmarks.planning.batched --activity installing_alarms --engine warp --worlds 1024 --processes 60
    python -m benchmarks.planning.batched --activity installing_alarms --engine native --worlds 16 --episodes 64

Prints an episode a line, and at the end one line of JSON: `success_rate`, with its 95 % interval,
`demonstrations_hour`, `steps_per_second` (agent steps of all worlds) and the figures of
`ig2mj.envs.planned_batch.Spent`. Worlds begin at random rows of the pool, and begin another episode when theirs is
over. With `--out FILE` the line is appended to a file. With `--turn FILE` several of these compile side by side and
measure one after the other: a run holds the file's lock while it measures.
"""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import json
import pathlib
import time
from collections.abc import Iterator

from benchmarks.harness.results import provenance
from ig2mj.demos.solving import horizon_for
from ig2mj.envs.planned_batch import PlannedBatch, PlannedEpisode
from ig2mj.envs.registry import make
from ig2mj.learn.evaluate import wilson


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--activity", required=True, help="of BEHAVIOR, or 'goal/HOME GOAL'")
    parser.add_argument("--engine", default="warp", choices=("native", "warp", "jax"))
    parser.add_argument("--worlds", type=int, default=1024)
    parser.add_argument("--processes", type=int, default=60, help="that plan; 0: the one that steps")
    parser.add_argument("--episodes", type=int, default=0, help="default: 100 for each world")
    parser.add_argument("--steps", type=int, default=5, help="steps of the longest plan, for the horizon")
    parser.add_argument("--pool", type=int, default=64, help="start states")
    parser.add_argument("--split", default="held_out")
    parser.add_argument("--doors", choices=("open", "shut"), default="open")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--until", type=float, default=float("inf"), help="s of wall time, without compilation")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--turn", type=pathlib.Path, help="file whose lock is held while this measures")
    args = parser.parse_args()
    name = args.activity if args.activity.startswith("goal/") else f"activity/{args.activity}"
    began = time.monotonic()
    pool = 1 if name.startswith("goal/") else args.pool
    options = {"pool_size": pool, "split": args.split, "doors": args.doors, "horizon": horizon_for(args.steps)}
    env = make(name, worlds=args.worlds, engine=args.engine, **options)
    with PlannedBatch(env, args.processes, args.seed) as batch:
        batch.warm_up()
        ready, won = time.monotonic() - began, 0
        print(f"ready after {ready:.0f} s", flush=True)

        def watch(episode: PlannedEpisode) -> None:
            nonlocal won
            won += episode.success
            state = "solved" if episode.success else f"not solved: {episode.ended}"
            print(f"{time.monotonic() - start:.0f} s: episode {episode.number}: {state}", flush=True)

        with turn(args.turn):
            start = time.monotonic()
            episodes = batch.stream(args.episodes or 100 * args.worlds, args.seed, watch, args.until)
            seconds = time.monotonic() - start
        spent = batch.spent.figures()
    late = sum(e.ended == "the time limit passed" for e in episodes)
    counted = len(episodes) - late  # those that the end of the run cut off say nothing
    low, high = wilson(won, counted) if counted else (0.0, 1.0)
    row = {
        **{k: v for k, v in vars(args).items() if k not in ("out", "until", "turn")},
        "episodes": counted,
        "cut_off": late,
        "success_rate": round(won / counted, 4) if counted else None,
        "success_low": round(low, 4),
        "success_high": round(high, 4),
        "seconds": round(seconds, 1),
        "demonstrations_hour": round(3600 * won / seconds, 1),
        "steps_per_second": round(spent["world_steps"] / seconds, 1),
        "ready_seconds": round(ready, 1),
        **spent,
        **provenance(),
    }
    print(json.dumps(row))
    if args.out is not None:
        with args.out.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(row) + "\n")


@contextlib.contextmanager
def turn(file: pathlib.Path | None) -> Iterator[None]:
    """Until nobody else holds a file's lock, and then with it; None: at once."""
    if file is None:
        yield
        return
    with file.open("a") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield


if __name__ == "__main__":
    main()
