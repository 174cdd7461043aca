"""Figure 5b of the paper: cloned policies finish Bimanual Pick and Place from some seconds before its end.

    python -m benchmarks.learning.figure_5b --obs state rgbd --demos 30 --tests 16

Natively pictures are drawn by one processor for each process; `--engine warp --worlds 192` plays as many runs at a time
on a GPU. Parts may run side by side, each with some of the moments at which a policy takes over (`--seconds`) and a
folder of its own; `--merge FOLDER...` makes one table and plot of them.

Demonstrations of the scripted expert, slowed down so that the task takes as long as the paper's people took (more than
10 s), with noise on every action. Hands hold by assisted grasping. A clone learns the actions that were done, from the
poses of objects and proprioception ("state") or from 128x128 RGB-D and proprioception ("rgbd"). The closing of the
hands is replayed from the demonstration, as in the paper, or learned like the rest. Then each demonstration of a
held-out start state is replayed until so many seconds before its end, and the policy takes over.

Axes: W worlds, T steps, n numbers of an action.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import pathlib
import time
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import matplotlib
import numpy as np

from benchmarks.harness import results
from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.envs.environment import Environment
from ig2mj.envs.experts import expert_of
from ig2mj.envs.registry import VECTORS, make
from ig2mj.learn.bc import BC, BCConfig, clone
from ig2mj.learn.demos import Demos
from ig2mj.learn.evaluate import wilson
from ig2mj.learn.perception import Perception, Seen
from ig2mj.learn.policies import Policy, depends_on
from ig2mj.learn.train import Run

matplotlib.use("Agg")
import matplotlib.pyplot as plt

TASK = "BimanualPickAndPlace"

TAKEOVERS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, np.inf)
"""Seconds before the end at which the policy takes over. 0: the demonstration is replayed to its end."""

PAPER = (
    "paper: a run that is taken over 2 s before the end succeeds (figure A.3);\n"
    "from the start the policy diverges (appendix A.3)"
)


@dataclasses.dataclass
class Shown:
    """One demonstration. seen: before every step. row: of the pool. success: it ended in the goal."""

    row: int
    action: np.ndarray
    vector: np.ndarray
    picture: np.ndarray
    success: bool


def environment(split: str, obs: str, worlds: int, engine: str = "native", pool_size: int | None = None) -> Environment:
    names = VECTORS if obs == "state" else (*VECTORS, "rgb", "depth")
    return make(TASK, "humanoid", worlds, engine, "assisted", observations=names, split=split, pool_size=pool_size)


def collect(env: Environment, perception: Perception, count: int, pace: float, noise: float, seed: int) -> list[Shown]:
    """The expert's successful runs from the pool's first rows, slowed down to `pace`; actions as they were done."""
    rng, expert, found = np.random.default_rng(seed), expert_of(env), list[Shown]()
    closing = np.array(["trigger" in name for name in env.action_names])
    for first in range(0, env.core.starts.pool.size, env.num_worlds):
        rows = (first + np.arange(env.num_worlds)) % env.core.starts.pool.size
        state, going = env.start_from(rows), np.ones(env.num_worlds, bool)
        steps: list[tuple[np.ndarray, Seen, np.ndarray]] = []
        won = np.zeros(env.num_worlds, bool)
        while going.any():
            expected = np.asarray(expert(state)) * np.where(closing, 1.0, pace)
            action = expected + np.where(closing, 0.0, noise * pace) * rng.standard_normal(expected.shape)
            action = np.clip(action, -1, 1).astype(np.float32)
            seen = perception(state.obs)
            steps.append((action, Seen(np.asarray(seen.vector), np.asarray(seen.image)), going.copy()))
            state = env.step(state, action)
            ended = going & np.asarray(state.done)
            won |= ended & np.asarray(state.info["success"])
            going &= ~ended
        for w in range(env.num_worlds):
            own = [step for step in steps if step[2][w]]
            if won[w]:
                parts = ([s[0][w] for s in own], [s[1].vector[w] for s in own], [s[1].image[w] for s in own])
                actions, vectors, pictures = (np.stack(p) for p in parts)
                found.append(Shown(int(rows[w]), actions, vectors, pictures, True))
        if len(found) >= count:
            break
    return found[:count]


def demos_of(shown: Sequence[Shown], chosen: np.ndarray) -> Demos:
    """As cloning takes them; `chosen`: numbers of the action that are learned."""
    fields = {n: np.concatenate([getattr(s, n) for s in shown]) for n in ("action", "vector", "picture")}
    seen, action = Seen(jnp.asarray(fields["vector"]), jnp.asarray(fields["picture"])), fields["action"][:, chosen]
    nothing = jnp.zeros(len(action))
    return Demos(seen, jnp.asarray(action), jnp.asarray(action), nothing, nothing > 0, nothing > 0, seen)


def trained(
    env: Environment, perception: Perception, demos: Demos, steps: int, batch: int, seed: int
) -> tuple[Policy, float]:
    """A clone, and its loss on the tenth of the steps that is kept apart."""
    config = BCConfig(num_updates=steps, batch_size=batch, input_noise=0.02, actor_layers=(256, 256))
    algorithm = BC(perception, demos.action.shape[1], config)
    learner, row = clone(algorithm, demos, Run(minutes=600, seed=seed, quiet=True))
    depends = depends_on(env, perception)
    depends["actions"] = depends["actions"][: demos.action.shape[1]]
    return Policy.of(algorithm, learner, depends, {}), row["held_out_loss"]


def take_over(
    env: Environment, policy: Policy, perception: Perception, jobs: Sequence[tuple[Shown, float]], learnt: np.ndarray
) -> tuple[list[bool], list[bool]]:
    """Replays each job's demonstration until so many seconds before its end, then lets the policy act: who succeeds,
    and who of those held the cauldron with both hands when it left the floor."""
    choose, success, lifted = jax.jit(policy.actor(perception)), list[bool](), list[bool]()
    for first in range(0, len(jobs), env.num_worlds):
        part = list(jobs[first : first + env.num_worlds])
        part += [part[-1]] * (env.num_worlds - len(part))
        state = env.start_from(np.array([shown.row for shown, _ in part]))
        length = np.array([len(shown.action) for shown, _ in part])
        lead = np.where([np.isinf(x) for _, x in part], length, [round(min(x, 1e3) / ACTION_PERIOD) for _, x in part])
        handover, going, won = np.maximum(length - lead, 0), np.ones(len(part), bool), np.zeros(len(part), bool)
        by_all = np.zeros(len(part), bool)
        for k in range(env.task.horizon):
            action = np.stack([shown.action[min(k, len(shown.action) - 1)] for shown, _ in part])
            alone = k >= handover
            action[np.ix_(alone, learnt)] = np.asarray(choose(state.obs))[alone]
            state = env.step(state, action)
            ended = going & np.asarray(state.done)
            won |= ended & np.asarray(state.info["success"])
            by_all |= ended & np.asarray(state.info["lifted_by_all"])
            going &= ~ended
            if not going.any():
                break
        count = min(env.num_worlds, len(jobs) - first)
        success += won[:count].tolist()
        lifted += by_all[:count].tolist()
    return success, lifted


def plotted(rows: Sequence[dict[str, Any]], longest: float, file: pathlib.Path) -> None:
    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    for obs in dict.fromkeys(r["observation"] for r in rows):
        for closing, style in (("replayed", "-"), ("learnt", "--")):
            own = [r for r in rows if (r["observation"], r["closing"]) == (obs, closing)]
            if not own:
                continue
            x = [longest if r["seconds_before_end"] == "all" else float(r["seconds_before_end"]) for r in own]
            line = axes.plot(x, [100 * r["success"] for r in own], style, marker="o", label=f"{obs}, closing {closing}")
            low, high = ([100 * r[n] for r in own] for n in ("low", "high"))
            axes.fill_between(x, low, high, color=line[0].get_color(), alpha=0.08)
    axes.axvline(2.0, color="black", linestyle=":", linewidth=1, label=PAPER)
    axes.set(xlabel="seconds before the end at which the policy takes over (last: from the start)")
    axes.set(ylabel="success, %", ylim=(-3, 103))
    axes.legend(fontsize=7)
    figure.savefig(file, dpi=130)


def merged(folders: Sequence[pathlib.Path]) -> list[dict[str, Any]]:
    """The rows of several tables in the order of a plot."""
    rows = list[dict[str, Any]]()
    for folder in folders:
        with (folder / "figure_5b.csv").open() as file:
            rows += [row | {n: float(row[n]) for n in ("success", "low", "high")} for row in csv.DictReader(file)]
    order = [str(x) for x in TAKEOVERS[:-1]] + ["all"]
    return sorted(rows, key=lambda r: (r["observation"] != "state", r["closing"], order.index(r["seconds_before_end"])))


def kept(rows: Sequence[dict[str, Any]], folder: pathlib.Path) -> None:
    """Writes what there is so far."""
    longest = max(float(row.get("longest_s") or 0) for row in rows)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "figure_5b.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(max(rows, key=len)))
        writer.writeheader()
        writer.writerows(rows)
    plotted(rows, longest, folder / "figure_5b.png")


def main() -> None:
    """Measures, and writes a table (CSV) and a plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--obs", nargs="*", default=["state"], choices=("state", "rgbd"))
    parser.add_argument("--demos", type=int, default=30)
    parser.add_argument("--tests", type=int, default=16)
    parser.add_argument("--worlds", type=int, default=16)
    parser.add_argument("--engine", default="native", choices=("native", "warp"))
    parser.add_argument("--pool-size", type=int, help="start states of either split; default: all")
    parser.add_argument("--steps", type=int, default=3000, help="updates of a clone")
    parser.add_argument("--batch", type=int, default=256, help="samples of an update")
    parser.add_argument("--pace", type=float, default=0.35, help="share of the expert's speed")
    parser.add_argument("--noise", type=float, default=0.1, help="deviation, in shares of the slowed action's range")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--closing", nargs="*", default=["replayed", "learnt"], choices=("replayed", "learnt"))
    parser.add_argument("--seconds", nargs="*", type=float, default=TAKEOVERS, help="before the end; inf: all alone")
    parser.add_argument("--merge", nargs="*", type=pathlib.Path, default=(), help="only puts together what is in these")
    parser.add_argument("--policies", type=pathlib.Path, help="a folder for the clones")
    parser.add_argument("--out", type=pathlib.Path, default=results.RESULTS / "figure_5b")
    args = parser.parse_args()
    if args.merge:
        kept(merged(args.merge), args.out)
        return
    rows, longest, began = list[dict[str, Any]](), 0.0, time.process_time()
    for obs in args.obs:
        env = environment("train", obs, args.worlds, args.engine, args.pool_size)
        perception = Perception(env.observation_spaces, obs)
        shown = collect(env, perception, args.demos, args.pace, args.noise, args.seed)
        env = environment("held_out", obs, args.worlds, args.engine, args.pool_size)
        tests = collect(env, perception, args.tests, args.pace, args.noise, args.seed + 1)
        pairs, seconds = sum(len(s.action) for s in shown), [len(s.action) * ACTION_PERIOD for s in tests]
        longest = max(longest, *seconds)
        print(f"{obs}: {len(shown)} demonstrations, {pairs} pairs; tests last {np.mean(seconds):.1f} s on average")
        closing = np.array(["trigger" in name for name in env.action_names])
        for kind, learnt in (("replayed", np.flatnonzero(~closing)), ("learnt", np.arange(len(closing)))):
            if kind not in args.closing:
                continue
            policy, loss = trained(env, perception, demos_of(shown, learnt), args.steps, args.batch, args.seed)
            runs = [(s, x) for x in args.seconds for s in tests]
            if args.policies is not None:
                args.policies.mkdir(parents=True, exist_ok=True)
                policy.save(args.policies / f"{obs}-{kind}.npz")
            found = take_over(env, policy, perception, runs, learnt)
            all_won, all_lifted = np.reshape(found, (2, len(args.seconds), len(tests)))
            for x, won, lifted in zip(args.seconds, all_won, all_lifted, strict=True):
                low, high = wilson(int(won.sum()), len(won))
                row = {"observation": obs, "closing": kind, "seconds_before_end": "all" if np.isinf(x) else x}
                row |= {"success": round(float(won.mean()), 4), "low": round(low, 3), "high": round(high, 3)}
                row |= {"lifted_by_all": round(float(lifted.mean()), 4)}
                row |= {"runs": len(won), "demonstrations": len(shown), "pairs": pairs, "loss_apart": round(loss, 5)}
                row["longest_s"] = round(float(longest), 1)
                rows.append(row)
                print(rows[-1], flush=True)
            kept(rows, args.out)
    print(f"{results.command()}: {time.process_time() - began:.0f} s of processor time")


if __name__ == "__main__":
    main()
