"""`evaluate_axes`: success and q of an agent on the episodes of a file, axis by axis, next to the nominal case."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.envs.environment import Environment
from ig2mj.envs.registry import make
from ig2mj.envs.rollout import Act, play
from ig2mj.errors import PolicyServerError
from ig2mj.learn.episodes import ALL, Episodes
from ig2mj.learn.evaluate import wilson

ActOf = Callable[[Environment], Act]
"""The agent of an environment."""


@dataclasses.dataclass(frozen=True)
class AxisResult:
    """Of the episodes of one axis that were played to their end, in the file's order.

    Attributes:
      success, q: of each episode. error: what ended the evaluation before the last one.
    """

    axis: str
    success: Sequence[bool]
    q: Sequence[float]
    error: PolicyServerError | None = None

    def as_dict(self) -> dict[str, Any]:
        """Rates with the limits of 95 % intervals: Wilson's of success, the normal one of the mean of q."""
        count = len(self.success)
        if not count:
            return {"success_rate": None, "success_low": None, "success_high": None, "q": None, "episodes": 0}
        low, high = wilson(sum(self.success), count)
        mean, half = float(np.mean(self.q)), 1.96 * float(np.std(self.q)) / math.sqrt(count)
        return {
            "success_rate": round(sum(self.success) / count, 4),
            "success_low": round(low, 4),
            "success_high": round(high, 4),
            "q": round(mean, 4),
            "q_low": round(max(mean - half, 0.0), 4),
            "q_high": round(min(mean + half, 1.0), 4),
            "episodes": count,
        }

    @property
    def failures(self) -> list[int]:
        """Episodes without success."""
        return [k for k, done in enumerate(self.success) if not done]


def axis_environment(episodes: Episodes, axis: str, options: Mapping[str, Any]) -> Environment:
    """The environment that plays an axis. `options`: of `ig2mj.make`."""
    env = make(episodes.header["task"], pool=episodes.pool, **{**options, **episodes.options(axis)})
    if "instructions" in episodes.axes[axis]:
        env.wordings = tuple(episodes.header["instructions"]["held_out"])
    return env


def evaluate_axes(
    episodes: Episodes,
    axes: Sequence[str],
    count: int,
    act_of: ActOf,
    options: Mapping[str, Any],
    report: ProgressCallback = no_progress,
) -> list[AxisResult]:
    """Plays the first episodes of each axis.

    Args:
      axes: names. count: episodes of each. act_of: who acts. options: of `ig2mj.make`, "worlds" among them.
      report: called with the share of what is done, 1 and a text.

    Returns:
      A result for each axis, in order; the last has an error where a policy server ended the evaluation.
    """
    found = []
    for number, axis in enumerate(axes):
        env = axis_environment(episodes, axis, options)

        def forward(done: float, total: float | None, text: str = "", number: int = number, axis: str = axis) -> None:
            report((number + done) / len(axes), total, f"{axis}: {text}")

        played = play(env, act_of(env), count, in_order=True, report=forward, seeds=episodes.seeds)
        found.append(AxisResult(axis, played.success, played.q, played.failed))
        if played.failed is not None:
            break
    return found


def result_of(results: Sequence[AxisResult]) -> dict[str, Any]:
    """For JSON: "axes" by name, the combination of all axes last."""
    last = sorted(results, key=lambda r: r.axis == ALL)
    return {"axes": {r.axis: r.as_dict() for r in last}}
