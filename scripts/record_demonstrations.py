"""Records the demonstrations that ship, in demonstrations/: `make demonstrations`.

32 episodes of each activity's expert that succeed, with noise on every action and now and then five steps at random,
from which the expert finds its way back. `devices/expert` is what it would have done undisturbed. Thin: actions, first
and last frames. What was recorded is replayed by action first.

    python scripts/record_demonstrations.py [ACTIVITY ...]
"""

from __future__ import annotations

import pathlib
import sys
import tempfile

import numpy as np

import ig2mj
from ig2mj.demos import Recording, Replayer, record
from ig2mj.demos.compact import write_compact
from ig2mj.envs.experts import expert_of
from ig2mj.tasks.activities import ACTIVITIES

EPISODES, WORLDS, ROWS, SEED = 32, 4, 40, 14
NOISE, DISTURBED, LENGTH = 0.1, 0.02, 5
"""Deviation of the noise; share of the steps at which a disturbance begins, and its steps."""

FOLDER = pathlib.Path(__file__).resolve().parents[1] / "demonstrations"


def episodes_of(task: str, file: pathlib.Path) -> None:
    """Plays until enough episodes have succeeded."""
    env = ig2mj.make(task, robot="humanoid", worlds=WORLDS, engine="native", pool_size=ROWS)
    expert, rng, size = expert_of(env), np.random.default_rng(SEED), env.action_space.shape[0]
    wild, left, succeeded = np.zeros((WORLDS, size)), np.zeros(WORLDS, int), 0
    with record(env, file, devices={"expert": np.zeros((WORLDS, size), np.float32)}) as played:
        state = played.reset(SEED)
        while succeeded < EPISODES:
            label = np.clip(np.asarray(expert(state)), -1, 1).astype(np.float32)
            begins = (left <= 0) & (rng.random(WORLDS) < DISTURBED)
            wild[begins], left[begins] = rng.uniform(-1, 1, (int(begins.sum()), size)), LENGTH
            action = np.where((left > 0)[:, None], wild, label + NOISE * rng.standard_normal(label.shape))
            left, played.devices["expert"] = left - 1, label
            state = played.step_autoreset(state, np.clip(action, -1, 1))
            done, success = np.asarray(state.done), np.asarray(state.info["success"])
            succeeded += int((done & success).sum())
            left[done] = 0


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for task in sys.argv[1:] or ACTIVITIES:
        with tempfile.TemporaryDirectory() as scratch:
            file = pathlib.Path(scratch) / "runs.h5"
            episodes_of(task, file)
            with Recording(file) as recording:
                runs = [run for run in recording.runs if run.attributes.get("success")][:EPISODES]
                done = Replayer(recording)(check=True, runs=runs)
                assert not done.differences, str(done.differences[0])
                write_compact(recording, FOLDER / f"{task}.h5", runs, noise=NOISE, disturbed=DISTURBED)
                played = sum(1 for run in recording.runs if run.attributes["ended"])
        size = (FOLDER / f"{task}.h5").stat().st_size / 1e6
        print(f"{task}: {len(runs)} runs of {played}, {done.frames} frames, {size:.2f} MB", flush=True)


if __name__ == "__main__":
    main()
