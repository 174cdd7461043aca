"""Policies over primitives that learn from the planner: they see which facts hold, and choose the next primitive.

    python -m benchmarks.planning.primitive_policies --jobs 24 --out policies.jsonl
    python -m benchmarks.planning.primitive_policies --activities installing_a_modem --algorithms bc --episodes 4

The environment is `ig2mj.make("activity/NAME", action_space="primitives")`. Demonstrations are the planner's plans on
the symbolic rung, from start states of the split `train`. With `dagger` the policy then acts there, and the planner
labels the states that it reaches, for some rounds. The policy acts in physics on held-out start states: motion is the
primitives', and what fails is chosen again or not by the policy. A row for each activity and algorithm is appended to
OUT: success with its 95 % interval, agreement with the planner on demonstrations that are not learned from, before and
after each round, and q.

Axes: N steps, F facts, A actions.
"""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import functools
import json
import multiprocessing
import pathlib
import sys
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from benchmarks.harness.results import provenance
from ig2mj.envs.primitives import PrimitiveEnv
from ig2mj.envs.registry import find_task, make
from ig2mj.errors import Ig2mjError
from ig2mj.learn.evaluate import wilson
from ig2mj.planning.steps import PlanningError, make_step
from ig2mj.planning.task_planner import TaskPlanner

ACTIVITIES = ("installing_a_modem", "opening_packages", "preparing_a_shower_for_child")
ALGORITHMS = ("bc", "dagger")

HELD_OUT = 5
"""One demonstration in so many is not learned from."""

HIDDEN, UPDATES, RATE, DECAY = 64, 1500, 3e-3, 1e-4
"""Units of the hidden layer, steps of Adam on all demonstrations, its rate, and weight decay."""

MOST = 20
"""Primitives of an episode in physics, at most."""

ROUNDS, EACH = 3, 16
"""Rounds of DAgger, and episodes of each."""

Row = dict[str, Any]


@dataclasses.dataclass
class Steps:
    """Facts that held, what the planner does then, and the demonstration that a step is of."""

    facts: list[np.ndarray] = dataclasses.field(default_factory=list)
    action: list[int] = dataclasses.field(default_factory=list)
    episode: list[int] = dataclasses.field(default_factory=list)

    def add(self, facts: np.ndarray, action: int, episode: int) -> None:
        self.facts.append(np.asarray(facts, np.float32))
        self.action.append(action)
        self.episode.append(episode)

    def arrays(self) -> tuple[Float[np.ndarray, "N F"], Int[np.ndarray, "N"], Int[np.ndarray, "N"]]:
        return np.array(self.facts), np.array(self.action), np.array(self.episode)


class Policy:
    """A network with one hidden layer from facts to the logits of actions."""

    def __init__(self, weights: list[np.ndarray]):
        self.weights = weights

    def __call__(self, facts: np.ndarray) -> int:
        """The most probable action."""
        return int(np.argmax(self.logits(np.asarray(facts, np.float32)[None])[0]))

    def logits(self, facts: Float[np.ndarray, "N F"]) -> Float[np.ndarray, "N A"]:
        first, bias, second, last = self.weights
        return np.maximum(facts @ first + bias, 0.0) @ second + last

    @classmethod
    def learned(cls, facts: Float[np.ndarray, "N F"], action: Int[np.ndarray, "N"], actions: int, seed: int) -> Policy:
        """By Adam on the cross-entropy of all steps."""
        rng = np.random.default_rng(seed)
        size = facts.shape[1]
        weights = [
            rng.normal(0, size**-0.5, (size, HIDDEN)), np.zeros(HIDDEN),
            rng.normal(0, HIDDEN**-0.5, (HIDDEN, actions)), np.zeros(actions),
        ]  # fmt: skip
        means, squares = [np.zeros_like(w) for w in weights], [np.zeros_like(w) for w in weights]
        wanted = np.eye(actions)[action]
        for k in range(1, UPDATES + 1):
            first, bias, second, last = weights
            hidden = np.maximum(facts @ first + bias, 0.0)
            logits = hidden @ second + last
            share = np.exp(logits - logits.max(1, keepdims=True))
            slope = (share / share.sum(1, keepdims=True) - wanted) / len(facts)
            back = (slope @ second.T) * (hidden > 0)
            slopes = [facts.T @ back, back.sum(0), hidden.T @ slope, slope.sum(0)]
            for w, g, mean, square in zip(weights, slopes, means, squares, strict=True):
                mean += 0.1 * (g - mean)
                square += 0.001 * (g * g - square)
                w -= RATE * (mean / (1 - 0.9**k) / (np.sqrt(square / (1 - 0.999**k)) + 1e-8) + DECAY * w)
        return cls(weights)


class Expert:
    """The planner's next primitive in an environment, by its number."""

    def __init__(self, env: PrimitiveEnv):
        self.env, self.planner = env, TaskPlanner(env.domain, env.problem.goal)

    def __call__(self) -> int | None:
        """None: there is none, or it is no action of the environment."""
        try:
            plan = self.planner.plan(self.env.facts)
        except PlanningError:
            return None
        if not plan.steps:
            return None
        step = make_step(plan.steps[0].primitive, plan.steps[0].arguments)
        return self.env.actions.index(step) if step in self.env.actions else None


def demonstrations(env: PrimitiveEnv, count: int, seed: int) -> Steps:
    """Episodes of the planner on the symbolic rung that reach the goal."""
    expert, found = Expert(env), Steps()
    for number in range(count):
        facts, _ = env.reset(seed=seed + number)
        own, done = list[tuple[np.ndarray, int]](), False
        while not done and len(own) < MOST and (action := expert()) is not None:
            own.append((facts, action))
            facts, _, done, _, _ = env.step(action)
        for seen, action in own if done else []:
            found.add(seen, action, number)
    return found


def labelled(env: PrimitiveEnv, policy: Policy, count: int, seed: int, first: int) -> Steps:
    """States that the policy reaches on the symbolic rung, with what the planner does there; `first`: their number."""
    expert, found = Expert(env), Steps()
    for number in range(count):
        facts, _ = env.reset(seed=seed + number)
        for _ in range(MOST):
            if (action := expert()) is not None:
                found.add(facts, action, first + number)
            facts, _, done, _, _ = env.step(policy(facts))
            if done:
                break
    return found


def train(activity: str, algorithm: str, count: int, seed: int) -> tuple[list[np.ndarray], Row]:
    """Weights of a policy, and what its training reports.

    Raises PlanningError: fewer than two demonstrations reach the goal, or all are learned from, or none is.
    """
    env = make(f"activity/{activity}", action_space="primitives", rung="symbolic", split="train", pool_size=64)
    steps = demonstrations(env, count, seed)
    facts, action, episode = steps.arrays()
    own = episode % HELD_OUT != 0
    if not own.any() or own.all():
        got = len(set(episode.tolist()))
        raise PlanningError(f"{activity}: {got} of {count} plans reach the goal, too few to learn from and to test on")
    tested = facts[~own], action[~own]
    agreement = []

    def learn() -> Policy:
        facts, action, episode = steps.arrays()
        mine = (episode % HELD_OUT != 0) | (episode >= count)
        policy = Policy.learned(facts[mine], action[mine], len(env.actions), seed)
        agreement.append(round(float(np.mean(policy.logits(tested[0]).argmax(1) == tested[1])), 4))
        return policy

    policy = learn()
    for number in range(ROUNDS if algorithm == "dagger" else 0):
        more = labelled(env, policy, EACH, seed + 1000 * (number + 1), count + EACH * number)
        for seen, label, at in zip(more.facts, more.action, more.episode, strict=True):
            steps.add(seen, label, at)
        policy = learn()
    report = {"demonstrations": len(set(episode.tolist())), "steps": len(steps.action), "agreement": agreement}
    return policy.weights, report | {"actions": len(env.actions), "facts": len(env.fact_names)}


@functools.lru_cache(maxsize=2)
def held_out(activity: str, rows: int) -> PrimitiveEnv:
    """The environment in physics, made once in each process."""
    return make(f"activity/{activity}", action_space="primitives", split="held_out", pool_size=rows, horizon=MOST)


def play(activity: str, weights: list[np.ndarray], row: int, rows: int) -> tuple[bool, float, int]:
    """Success, q and number of primitives of one held-out episode in physics."""
    env, policy = held_out(activity, rows), Policy(weights)
    facts, info = env.reset(seed=row, options={"row": row})
    count, over = 0, False
    while not over:
        facts, _, done, late, info = env.step(policy(facts))
        count, over = count + 1, done or late
    return bool(info["success"]), float(info["q"]), count


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("--activities", nargs="+", default=ACTIVITIES, help=f"default: {' '.join(ACTIVITIES)}")
    parser.add_argument("--algorithms", nargs="+", choices=ALGORITHMS, default=ALGORITHMS, help="default: both")
    parser.add_argument("--demonstrations", type=int, default=100, help="planned episodes (default: 100)")
    parser.add_argument(
        "--episodes", type=int, default=20, help="held-out start states, each played once (default: 20)"
    )
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--seed", type=int, default=0, help="of start states and networks (default: 0)")
    parser.add_argument("--out", type=pathlib.Path, help="file of JSON lines to which rows are appended")
    args = parser.parse_args(arguments)
    for name, least in (("demonstrations", 2), ("episodes", 1), ("jobs", 1), ("seed", 0)):
        if getattr(args, name) < least:
            parser.error(f"--{name} {getattr(args, name)}: at least {least} is needed")
    try:
        for activity in args.activities:
            find_task(f"activity/{activity}")
    except Ig2mjError as error:
        parser.error(str(error))
    with concurrent.futures.ProcessPoolExecutor(args.jobs, multiprocessing.get_context("spawn")) as pool:
        trained = {
            (activity, algorithm): pool.submit(train, activity, algorithm, args.demonstrations, args.seed)
            for activity in args.activities
            for algorithm in args.algorithms
        }
        played = {}
        for (activity, algorithm), future in trained.items():
            weights, report = future.result()
            began = time.monotonic()
            print(f"{activity}, {algorithm}: {report}", file=sys.stderr, flush=True)
            games = [pool.submit(play, activity, weights, row, args.episodes) for row in range(args.episodes)]
            played[activity, algorithm] = report, games, began
        for (activity, algorithm), (report, games, began) in played.items():
            results = [game.result() for game in games]
            won = sum(success for success, _, _ in results)
            low, high = wilson(won, len(results))
            row = {
                "activity": activity,
                "algorithm": f"{algorithm}, primitives",
                "episodes": len(results),
                "success_rate": won / len(results),
                "success_low": round(low, 4),
                "success_high": round(high, 4),
                "q": round(float(np.mean([q for _, q, _ in results])), 4),
                "primitives": round(float(np.mean([count for _, _, count in results])), 2),
                "seconds": round(time.monotonic() - began, 1),
                **report,
                **provenance(),
            }
            print(json.dumps(row), flush=True)
            if args.out is not None:
                with args.out.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
