"""How far do worlds drift apart that take the same actions from the same start on another engine, or again on a GPU?

    python benchmarks/divergence.py CookingMeat SlicingFruit --worlds 64 --rows out/divergence.jsonl

Episodes are played natively, by the task's expert (with noise) and at random, and replayed by action: natively again,
on the second engine (`--engine warp`), and there again. Measured after each step, over all worlds: the farthest that
any object is from where it was (m), the farthest of the hands (m), the largest difference of a temperature (K), and in
how many worlds a literal of the goal has another truth. The expert's actions are those of the first run: nobody
corrects them when the worlds drift apart. An episode is a success if the goal held after any step.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import sys
import time
from collections.abc import Callable, Iterable
from typing import Any

import jax
import numpy as np
from results import keep_row, machine

import ig2mj
from ig2mj.demos.frames import Frame, frame_of, resumed
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.experts import expert_of

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


def on_host(frame: Frame) -> Frame:
    """The same in NumPy's arrays."""
    return jax.tree.map(np.array, frame)


def rows_of(task: str, args: argparse.Namespace) -> Iterable[dict[str, Any]]:
    """A row for each who acts and each pair of runs."""
    common: dict[str, Any] = {"robot": args.robot, "worlds": args.worlds, "pool_size": args.pool_size}
    native = ig2mj.make(task, engine="native", **common)
    other = ig2mj.make(task, engine=args.engine, **common)
    rows = np.arange(args.worlds) % args.pool_size
    rng, shape = np.random.default_rng(0), (args.worlds, *native.action_space.shape)
    expert = expert_of(native)
    acts = {
        "expert": lambda state: np.clip(np.asarray(expert(state)) + NOISE * rng.standard_normal(shape), -1, 1),
        "random": lambda state: rng.uniform(-1, 1, shape),
    }
    for who, act in acts.items():
        began = time.monotonic()
        state = native.start_from(rows)
        start = on_host(frame_of(native.core.engine, state))
        first, actions = played(native, state, [act] * args.steps)
        given = [lambda state, a=a: a for a in actions]

        def again(env: Environment, start: Frame = start, given: list = given) -> Track:
            return played(env, resumed(env, start, rows), given)[0]

        there = again(other)
        pairs = {
            "native, native": (first, again(native)),
            f"native, {args.engine}": (first, there),
            f"{args.engine}, {args.engine}": (there, again(other)),
        }
        for pair, tracks in pairs.items():
            about = {"task": task, "robot": args.robot, "actions": who, "engines": pair, "worlds": args.worlds}
            yield about | compared(*tracks, native.period) | {"seconds": round(time.monotonic() - began, 1)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="+")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--engine", default="warp", help="the second one")
    parser.add_argument("--worlds", type=int, default=64)
    parser.add_argument("--steps", type=int, default=200, help="agent steps")
    parser.add_argument("--pool-size", type=int, default=32)
    parser.add_argument("--rows", type=pathlib.Path, help="a file to which rows are added")
    args = parser.parse_args()
    where = machine(-1) | {"devices": [d.device_kind for d in jax.devices()]}
    for task in args.tasks:
        for row in rows_of(task, args):
            keep_row(row | {"machine": where}, args.rows)
            for seconds, d in row["after"].items():
                print(f"{seconds:>5} s  {d['object_m'][0]:.1e} {d['object_m'][1]:.1e} m", file=sys.stderr)


if __name__ == "__main__":
    main()
