"""`evaluate_axes`: success and q of an agent on the episodes of a file, axis by axis, next to the nominal case."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.registry import make
from ig2mj.envs.rollout import Act, play
from ig2mj.errors import PolicyServerError
from ig2mj.learn.episodes import ALL, EpisodePart, Episodes
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


def axis_environment(episodes: Episodes, axis: str, part: EpisodePart, options: Mapping[str, Any]) -> Environment:
    """The environment that plays a part of an axis. `options`: of `ig2mj.make`."""
    worlds = min(options.get("worlds", 1), len(part.numbers))
    env = make(episodes.header["task"], **{**options, "worlds": worlds, **episodes.options(axis, part.home)})
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
        parts, ended = episodes.parts(axis, count), dict[int, tuple[bool, float]]()
        failed = None
        for k, part in enumerate(parts):
            env = axis_environment(episodes, axis, part, options)
            share = (number + k / len(parts)) / len(axes)

            def forward(
                done: float,
                total: float | None,
                text: str = "",
                share: float = share,
                of: float = len(axes) * len(parts),
                axis: str = axis,
            ) -> None:
                report(share + done / of, total, f"{axis}: {text}")

            def start(rows: np.ndarray, env: Environment = env, axis: str = axis, part: EpisodePart = part) -> EnvState:
                return episodes.start(env, axis, part, rows.tolist())

            played = play(env, act_of(env), len(part.numbers), in_order=True, report=forward, start=start)
            ended |= dict(zip(part.numbers, zip(played.success, played.q, strict=True), strict=False))
            failed = played.failed
            if failed is not None:
                break
        last = [ended[episode] for episode in sorted(ended)]
        found.append(AxisResult(axis, [s for s, _ in last], [q for _, q in last], failed))
        if failed is not None:
            break
    return found


def result_of(results: Sequence[AxisResult]) -> dict[str, Any]:
    """For JSON: "axes" by name, the combination of all axes last."""
    last = sorted(results, key=lambda r: r.axis == ALL)
    return {"axes": {r.axis: r.as_dict() for r in last}}
