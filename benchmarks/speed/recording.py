"""What recording costs: processor time of an agent step with and without it, and bytes an hour of one world;
and what a replay by state costs, without rendering its images.

    python -m benchmarks.speed.recording [--task CookingMeat] [--turns 20]

Two environments take the same actions from the same start in lockstep, one recorded and one not, the one first in odd
steps and the other in even ones: physics does the same work bit for bit, and what other programs on the machine take
away (caches, clock) it takes from both alike. Processor time is that of all threads of the process, compression and
writing included. A turn is as many steps as are written at once; the share is that of the sums over a turn, of which
the median over turns is given, with its 95 % interval (turns resampled). `ms` are medians of steps; what
writing adds to the last step of a turn is apart.
Sizes are those of files with a whole number of
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

import ig2mj
from benchmarks.harness.results import keep_row, machine
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


def cost(plain: Environment, recorded: Environment, turns: int, folder: pathlib.Path) -> dict[str, Any]:
    """Milliseconds of processor time of an agent step without and with recording."""
    actions = random_actions(plain, (turns + 1) * FLUSH)
    envs = [plain, record(recorded, folder / "cost.h5", past_success=True)]
    states, times = [env.start_from(np.zeros(1, int)) for env in envs], np.zeros((len(actions), 2))
    for k, action in enumerate(actions):
        for which in (0, 1) if k % 2 else (1, 0):
            began = time.process_time()
            states[which] = envs[which].step(states[which], action)
            times[k, which] = time.process_time() - began
    same = [np.asarray(s.batch.world.view.object_com).tobytes() for s in states]
    assert same[0] == same[1], "the two did not do the same work"
    envs[1].close()
    rows = 1000 * times.reshape(turns + 1, FLUSH, 2)[1:]  # the first turn compiles and warms up
    shares = rows[..., 1].sum(1) / rows[..., 0].sum(1) - 1
    drawn = np.median(np.random.default_rng(0).choice(shares, (2000, turns)), axis=1)
    last = np.argmax(np.median(rows[..., 1] - rows[..., 0], axis=0))
    typical = np.delete(rows, last, axis=1)
    written = np.median(rows[:, last, 1] - rows[:, last, 0]) - np.median(typical[..., 1] - typical[..., 0])
    paired = float(np.median(typical[..., 1] - typical[..., 0]) + written / FLUSH)
    return {
        "ms_plain": round(float(np.median(typical[..., 0])), 3),
        "ms_recorded": round(float(np.median(typical[..., 1])), 3),
        "ms_writing_200_frames": round(float(written), 2),
        "ms_more_a_step": round(paired, 3),
        "share_of_medians": round(paired / float(np.median(typical[..., 0])), 4),
        "share": round(float(np.median(shares)), 4),
        "share_95": [round(float(v), 4) for v in np.percentile(drawn, (2.5, 97.5))],
        "steps": FLUSH,
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
    parser.add_argument("--turns", type=int, default=20)
    parser.add_argument("--cost-only", action="store_true", help="no sizes, no replay")
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
            "cost": cost(env, ig2mj.make(args.task, **make).with_horizon(10**6), args.turns, folder),
        }
        if args.cost_only:
            keep_row(row | {"machine": machine(-1)}, args.out)
            return
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
