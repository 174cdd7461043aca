"""How good a policy is: `ig2mj.envs.rollout.play` from every start state in turn, and how sure the rate is.

An evaluation is done in jobs (`ig2mj.cluster.job_runner`), each of as many episodes as there are worlds.
"""

from __future__ import annotations

import functools
import json
import math
import pathlib
import tempfile
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.cluster.jobs import Job, WholeRunError
from ig2mj.envs.actor import Actor
from ig2mj.envs.environment import Environment
from ig2mj.envs.registry import make
from ig2mj.envs.rollout import play
from ig2mj.envs.shared_starts import keep_pool
from ig2mj.errors import Ig2mjError
from ig2mj.learn.policies import Policy, perception_of
from ig2mj.process import entry_point
from ig2mj.process.progress import progress


def acting(policy: Policy, env: Environment, file: object, *, drawn: bool | None = None, seed: int = 0) -> Actor:
    """A policy as the agent of an environment.

    Args:
      file: of the policy, for messages. seed: of sampled actions.
      drawn: actions are sampled; None: as the policy was evaluated, where it ships, else not.

    Raises:
      InputError: the policy is for something else.
    """
    perception = perception_of(policy, env.observation_spaces)
    policy.check(env, perception, file)
    remembers = 0 if policy.memory is None else policy.memory.size
    drawn = draws(policy) if drawn is None else drawn
    return Actor(env, policy.player(perception, sampled=drawn), remembers, seed, policy.parameters())


def draws(policy: Policy) -> bool:
    """Whether a policy ships with the success of sampled actions."""
    return bool(policy.card.get("evaluation", {}).get("drawn"))


def summary(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Rates and means over what jobs gave; the success with the limits of its 95 % interval."""
    success, total = ([x for r in results for x in r[name]] for name in ("success", "total"))
    count, successes = len(success), sum(success)
    low, high = wilson(successes, count)
    return {
        "episodes": count,
        "success_rate": successes / count,
        "success_low": round(low, 4),
        "success_high": round(high, 4),
        **{f"{name}_rate": sum(sum(r["outcomes"][name]) for r in results) / count for name in results[0]["outcomes"]},
        "mean_return": float(np.mean(total)),
        **({"q": round(float(np.mean(q)), 4)} if (q := [x for r in results for x in r.get("q", ())]) else {}),
        **{name: sum(r[name] for r in results) for name in ("overflow", "non_finite")},
    }


def wilson(successes: int, count: int, z: float = 1.96) -> tuple[float, float]:
    """Limits of the interval in which a rate lies with 95 % confidence (Wilson 1927)."""
    rate = successes / count
    middle = (rate + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(rate * (1 - rate) / count + z * z / (4 * count**2)) / (1 + z * z / count)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def evaluation_jobs(settings: Mapping[str, Any], episodes: int) -> list[Job]:
    """Jobs of an evaluation. `settings`: the arguments of `evaluate_job` but `first`, `episodes` and `shared`."""
    worlds = settings["worlds"]
    starts = range(0, episodes, worlds)
    return [
        Job(f"episodes_{first:07d}", {**settings, "first": first, "episodes": min(worlds, episodes - first)})
        for first in starts
    ]


@entry_point
def evaluate_job(
    file: str,
    task: str,
    robot: str,
    grasping: str,
    engine: str,
    worlds: int,
    observations: list[str],
    paper_rl: bool,
    split: str,
    pool_size: int | None,
    drawn: bool,
    first: int,
    episodes: int,
    shared: Mapping[str, bytes],
    objects: Sequence[str] = (),
    looks: str | None = None,
    doors: str = "shut",
    horizon: int | None = None,
) -> bytes:
    """Episodes from the start states `first` on, as JSON: how each ended, what went wrong, and how long it took until
    the first step was taken ("start_seconds").

    Args:
      file: of the policy, for messages.
      shared: "policy", a policy's file, and where another machine made them the start states. The others: of
        `ig2mj.make`, and of `acting`.
    """
    began = time.monotonic()
    try:
        keep_pool(shared, task, split, pool_size, objects)
        made = (task, robot, grasping, engine, worlds, tuple(observations), paper_rl, split, pool_size)
        env, actor = _player(shared["policy"], file, drawn, *made, tuple(objects), looks, doors, horizon)
    except Ig2mjError as e:
        raise WholeRunError(e) from e
    with progress(f"playing {task} from start state {first}") as report:
        played = play(env, actor.seeded(first // worlds), episodes, in_order=True, first=first, report=report)
    found = {"success": played.success, "outcomes": played.outcomes, "total": played.total, "q": played.q}
    trouble = {"overflow": played.metrics["overflow"], "non_finite": played.metrics["not_finite"]}
    stepping = (played.steps - worlds) / played.steps_per_second if played.steps_per_second else 0.0
    start = time.monotonic() - began - stepping
    return json.dumps({**found, "steps": played.steps, "start_seconds": start, **trouble}).encode()


@functools.lru_cache(maxsize=1)
def _player(
    content: bytes,
    file: str,
    drawn: bool,
    task: str,
    robot: str,
    grasping: str,
    engine: str,
    worlds: int,
    observations: tuple[str, ...],
    paper_rl: bool,
    split: str,
    pool_size: int | None,
    objects: tuple[str, ...],
    looks: str | None,
    doors: str,
    horizon: int | None,
) -> tuple[Environment, Actor]:
    """The environment and its agent, the same in all jobs of an evaluation, so that they are compiled once.

    Args:
      content: of the policy's file. The others: of `evaluate_job`.
    """
    made: dict[str, Any] = {
        "observations": observations,
        "relaxed_thresholds": paper_rl,
        "split": split,
        "pool_size": pool_size,
        "objects": objects,
        "looks": looks,
        "doors": doors,
        "horizon": horizon,
    }
    env = make(task, robot, worlds, engine, grasping, **made)
    with tempfile.TemporaryDirectory(prefix="ig2mj-") as folder:
        copy = pathlib.Path(folder) / "policy.npz"
        copy.write_bytes(content)
        policy = Policy.load(copy)
    return env, acting(policy, env, file, drawn=drawn)
