"""How far do worlds drift apart that take the same actions from the same start on another engine, or again on a GPU?

    python benchmarks/divergence.py play CookingMeat SlicingFruit --worlds 64 --out out/divergence
    python benchmarks/divergence.py replay out/divergence --engine warp --rows out/divergence.jsonl

`play` needs no GPU: episodes are played natively, by the task's expert (with noise) and at random, and written with
their start states. `replay` puts an engine's worlds at those starts and takes the actions, twice; a row is written as
soon as it is known. Measured after each step, over all worlds: the farthest that any object is from where it was (m),
the farthest of the hands (m), the largest difference of a temperature (K), and in how many worlds a literal of the goal
has another truth. The expert's actions are those of the first run: nobody corrects them when the worlds drift apart. An
episode is a success if the goal held after any step. `replay --engine native` says whether another machine comes to the
same.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import pathlib
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import jax
import numpy as np
from results import keep_row, machine

import ig2mj
from ig2mj.demos.frames import frame_of, names_of, resumed
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.experts import expert_of
from ig2mj.worlds.pool import load_pool, save_pool

NOISE = 0.1
"""Deviation of what is added to the expert's actions."""

SECONDS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""After which the differences are written."""


@dataclasses.dataclass
class Track:
    """Of each frame and world: places of objects [T, W, O, 3] and hands [T, W, H, 3], temperatures [T, W, O], literals
    of the goal [T, W, L], success [T, W]."""

    objects: list[np.ndarray] = dataclasses.field(default_factory=list)
    hands: list[np.ndarray] = dataclasses.field(default_factory=list)
    temperature: list[np.ndarray] = dataclasses.field(default_factory=list)
    goal: list[np.ndarray] = dataclasses.field(default_factory=list)
    success: list[np.ndarray] = dataclasses.field(default_factory=list)

    def see(self, state: EnvState) -> None:
        """Adds a frame."""
        view, states = state.batch.world.view, state.batch.world.states
        self.objects.append(np.array(view.object_com, np.float64))
        self.hands.append(np.array(view.agent.hand_pos, np.float64))
        self.temperature.append(np.array(states.temperature, np.float64))
        self.goal.append(np.array(state.status.literals))
        self.success.append(np.array(state.info["success"]))


def played(env: Environment, state: EnvState, acts: Iterable[Callable[[EnvState], np.ndarray]]) -> tuple[Track, list]:
    """Steps without resets; what came of it, and the actions."""
    track, actions = Track(), []
    track.see(state)
    for act in acts:
        actions.append(np.asarray(act(state), np.float32))
        state = env.step(state, actions[-1])
        track.see(state)
    return track, actions


def compared(a: Track, b: Track, period: float) -> dict[str, Any]:
    """Differences at `SECONDS`; medians, 95th percentiles and shares are over worlds."""

    def far(x: list[np.ndarray], y: list[np.ndarray]) -> np.ndarray:
        return np.linalg.norm(np.stack(x) - np.stack(y), axis=-1).max(-1)

    objects, hands = far(a.objects, b.objects), far(a.hands, b.hands)
    heat = np.nanmax(np.abs(np.stack(a.temperature) - np.stack(b.temperature)), axis=-1)
    goal = (np.stack(a.goal) != np.stack(b.goal)).any(-1)
    success = [np.stack(t.success).any(0) for t in (a, b)]
    found: dict[str, Any] = {"success": [float(s.mean()) for s in success], "same_success": 0.0, "after": {}}
    found["same_success"] = float((success[0] == success[1]).mean())
    for seconds in SECONDS:
        step = round(seconds / period)
        if step >= len(objects):
            break
        found["after"][str(seconds)] = {
            "object_m": [float(np.median(objects[step])), float(np.percentile(objects[step], 95))],
            "hand_m": [float(np.median(hands[step])), float(np.percentile(hands[step], 95))],
            "kelvin": [float(np.median(heat[step])), float(np.percentile(heat[step], 95))],
            "another_goal": float(goal[step].mean()),
        }
    return found


def acting(env: Environment, who: str) -> Callable[[EnvState], np.ndarray]:
    """Actions of the task's expert, disturbed, or random ones."""
    rng, shape = np.random.default_rng(0), (env.num_worlds, *env.action_space.shape)
    if who == "random":
        return lambda state: rng.uniform(-1, 1, shape)
    expert = expert_of(env)
    return lambda state: np.clip(np.asarray(expert(state)) + NOISE * rng.standard_normal(shape), -1, 1)


def play(args: argparse.Namespace) -> None:
    """Plays and writes; a file for each task and who acts, and one with the task's start states."""
    args.out.mkdir(parents=True, exist_ok=True)
    for task in args.tasks:
        env = ig2mj.make(task, robot=args.robot, engine="native", worlds=args.worlds, pool_size=args.pool_size)
        save_pool(env.core.starts.pool, args.out / f"{task}.pool.npz", env.scene)
        rows = np.arange(args.worlds) % args.pool_size
        for who in ("expert", "random"):
            state = env.start_from(rows)
            frame = frame_of(env.core.engine, state)
            arrays: dict[str, Any] = dict(zip(names_of(frame), map(np.array, jax.tree.leaves(frame)), strict=True))
            track, actions = played(env, state, [acting(env, who)] * args.steps)
            arrays |= {f"track/{name}": np.stack(value) for name, value in vars(track).items()}
            about = {"task": task, "robot": args.robot, "actions": who, "worlds": args.worlds}
            file = args.out / f"{task}-{who}.npz"
            np.savez_compressed(file, about=json.dumps(about), rows=rows, actions=np.stack(actions), **arrays)
            print(f"{file}: {file.stat().st_size / 1e6:.1f} MB")


def replay(args: argparse.Namespace) -> None:
    """Replays what `play` wrote, twice."""
    where = machine(-1) | {"devices": [d.device_kind for d in jax.devices()]}
    envs: dict[str, Environment] = {}
    for file in sorted(args.folder.glob("*-*.npz")):
        began = time.monotonic()
        with np.load(file) as read:
            arrays = {name: read[name] for name in read.files}
        about = json.loads(str(arrays["about"]))
        task, worlds = about["task"], about["worlds"]
        pool, robot = load_pool(args.folder / f"{task}.pool.npz"), about["robot"]
        if task not in envs:
            envs = {task: ig2mj.make(task, robot, worlds, args.engine, pool=pool)}
        env, alone = envs[task], ig2mj.make(task, robot, 1, "native", pool=pool)
        like = frame_of(alone.core.engine, alone.start_from(np.zeros(1, int)))
        start = jax.tree.unflatten(jax.tree.structure(like), [arrays[name] for name in names_of(like)])
        first = Track(**{f.name: list(arrays[f"track/{f.name}"]) for f in dataclasses.fields(Track)})
        given = [lambda state, a=a: a for a in arrays["actions"]]
        tracks = []
        for pair in (f"native, {args.engine}", f"{args.engine}, {args.engine} again"):
            tracks.append(played(env, resumed(env, start, arrays["rows"]), given)[0])
            row = about | {"engines": pair} | compared(tracks[0] if len(tracks) > 1 else first, tracks[-1], env.period)
            keep_row(row | {"seconds": round(time.monotonic() - began, 1), "machine": where}, args.rows)
            for seconds, d in row["after"].items():
                print(f"{seconds:>5} s  {d['object_m'][0]:.1e} {d['object_m'][1]:.1e} m", file=sys.stderr, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    first = commands.add_parser("play")
    first.set_defaults(run=play)
    first.add_argument("tasks", nargs="+")
    first.add_argument("--robot", default="humanoid")
    first.add_argument("--worlds", type=int, default=64)
    first.add_argument("--steps", type=int, default=200, help="agent steps")
    first.add_argument("--pool-size", type=int, default=32)
    first.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/divergence"))
    second = commands.add_parser("replay")
    second.set_defaults(run=replay)
    second.add_argument("folder", type=pathlib.Path)
    second.add_argument("--engine", default="warp")
    second.add_argument("--rows", type=pathlib.Path, help="a file to which rows are added")
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
