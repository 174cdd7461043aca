"""What recording costs: processor time of an agent step with and without it, in turns, and bytes an hour of one world;
and what a replay by state costs, beside drawing its pictures.

    python benchmarks/recording.py [--task CookingMeat] [--turns 10]

Every turn plays the same actions from the same start, plainly and recorded, so that physics does the same work bit for
bit. Processor time is that of all threads of the process, writing and compression included; of all turns the quickest
counts, since other programs on the machine only ever add to it. Sizes are those of files with a whole number of
flushes, at 10 frames a second (agent steps) and at 30 (`period=1 / 30`, as people drive), for random actions that are
held for half a second, and for the task's expert. Pictures are 128 x 128 pixels, colour and depth.
"""

from __future__ import annotations

import argparse
import pathlib
import tempfile
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from results import keep_row, machine

import ig2mj
from ig2mj.demos import Recording, Replayer, record
from ig2mj.demos.writer import FLUSH
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.experts import expert_of
from ig2mj.envs.registry import VECTORS

Act = Callable[[EnvState], np.ndarray]


def random_actions(env: Environment, count: int, seed: int = 0) -> list[np.ndarray]:
    """[1, n] each, held for half a second."""
    rng, held = np.random.default_rng(seed), round(0.5 / env.period)
    drawn = rng.uniform(-1, 1, (count // held + 1, 1, *env.action_space.shape)).astype(np.float32)
    return [drawn[k // held] for k in range(count)]


def cost(env: Environment, steps: int, turns: int, folder: pathlib.Path) -> dict[str, Any]:
    """Milliseconds of processor time of an agent step."""
    actions = random_actions(env, steps)

    def plain() -> float:
        state = env.start_from(np.zeros(1, int))
        began = time.process_time()
        for action in actions:
            state = env.step(state, action)
        return time.process_time() - began

    def recorded(number: int) -> float:
        env_recorded = record(env, folder / f"{number}.h5")
        state = env_recorded.start_from(np.zeros(1, int))
        began = time.process_time()
        for action in actions:
            state = env_recorded.step(state, action)
        assert env_recorded.writer is not None
        env_recorded.writer.close()
        return time.process_time() - began

    plain()
    recorded(0)
    times = np.array([(plain(), recorded(k)) for k in range(turns)]) * 1000 / steps
    best, shares = times.min(0), times[:, 1] / times[:, 0] - 1
    return {
        "ms_plain": round(float(best[0]), 3),
        "ms_recorded": round(float(best[1]), 3),
        "share": round(float(best[1] / best[0] - 1), 4),
        "share_median_of_turns": round(float(np.median(shares)), 4),
        "steps": steps,
        "turns": turns,
    }


def size(env: Environment, act: Act, frames: int, file: pathlib.Path) -> float:
    """Megabytes that an hour of one world takes."""
    with record(env, file, past_success=True) as played:
        state = played.start_from(np.zeros(1, int))
        for _ in range(frames - 1):
            state = played.step(state, act(state))
    return file.stat().st_size / frames / env.period * 3600 / 1e6


def replayed(file: pathlib.Path, frames: int) -> dict[str, float]:
    """Milliseconds of processor time of a frame that is replayed by state: without and with pictures, and of the
    pictures alone, drawn again and again of the last frame."""
    found = {}
    for name, observations in (("ms_without", VECTORS), ("ms_with_pictures", ("rgb", "depth"))):
        with Recording(file) as recording:
            replayer = Replayer(recording, "state", observations=observations)
            at: list[float] = []
            replayer(watch=lambda state, now, frame, at=at: at.append(time.process_time()))
            times = np.diff(at[: frames + 1])
            found[name] = round(1000 * float(np.median(times)), 3)
            if "rgb" not in observations:
                continue
            state = replayer.at(recording.runs[0], 1)
            env, drawn = replayer.env, []
            for _ in range(30):
                began = time.process_time()
                env.resume(state.batch, np.zeros(1, int))
                drawn.append(time.process_time() - began)
            found["ms_pictures_alone"] = round(1000 * float(np.median(drawn)), 3)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="CookingMeat")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--steps", type=int, default=2 * FLUSH, help="of a turn")
    parser.add_argument("--turns", type=int, default=10)
    parser.add_argument("--flushes", type=int, default=6, help="frames of the files, in flushes")
    parser.add_argument("--out", type=pathlib.Path, help="a file to which the row is added")
    args = parser.parse_args()
    make = {"robot": args.robot, "engine": "native", "pool_size": 4}
    env = ig2mj.make(args.task, **make).with_horizon(10**6)
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        row: dict[str, Any] = {
            "task": args.task,
            "robot": args.robot,
            "cost": cost(env, args.steps, args.turns, folder),
        }
        sizes = row["megabytes_an_hour"] = {}
        faster = ig2mj.make(args.task, **make, whole_actions=True, period=1 / 30).with_horizon(10**6)
        frames = args.flushes * FLUSH
        for each in (env, faster):
            drawn = iter(random_actions(each, frames))
            sizes[f"random, {round(1 / each.period)} frames/s"] = size(
                each, lambda state, drawn=drawn: next(drawn), frames, folder / "size.h5"
            )
        expert = expert_of(env)
        sizes["expert, 10 frames/s"] = size(env, lambda state: np.asarray(expert(state)), frames, folder / "size.h5")
        row["replay_by_state"] = replayed(folder / "size.h5", 200)
        row["megabytes_an_hour"] = {name: round(value, 1) for name, value in sizes.items()}
    keep_row(row | {"machine": machine(-1)}, args.out)


if __name__ == "__main__":
    main()
