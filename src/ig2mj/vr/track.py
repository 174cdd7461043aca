"""`PoseTrack`: where all bodies were at the last two control steps, for renderers at another rate.

The thread that steps physics adds to it; threads that draw ask for an instant and get poses between the last two
steps. Nobody waits for anybody: what was added is replaced as a whole.

Axis: B bodies.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np
from jaxtyping import Float

LONGEST = 0.1
"""s over which the way between two steps is stretched at most, however slow physics is."""

JUMP = 0.5
"""m of a step beyond which a body is not moved between the two: a reset, or what slicing moves."""


@dataclasses.dataclass(frozen=True, eq=False)
class _Steps:
    at: float
    gap: float
    before: Float[np.ndarray, "B 7"]
    now: Float[np.ndarray, "B 7"]


class PoseTrack:
    """See the module's text. Attributes: count: of steps added."""

    def __init__(self) -> None:
        """Empty."""
        self._steps: _Steps | None = None
        self.count = 0

    def add(self, pos: Float[np.ndarray, "B 3"], quat: Float[np.ndarray, "B 4"], now: float | None = None) -> None:
        """Poses after a step. `now`: s of `time.monotonic`."""
        now = time.monotonic() if now is None else now
        poses = np.concatenate([pos, quat], axis=1).astype(np.float32)
        last = self._steps
        before = poses if last is None else last.now
        gap = LONGEST if last is None else min(max(now - last.at, 1e-3), LONGEST)
        self._steps = _Steps(now, gap, before, poses)
        self.count += 1

    def at(self, now: float | None = None) -> Float[np.ndarray, "B 7"] | None:
        """Poses (position, quaternion) to draw now: one step behind, so that they are always between two that were
        really there; None before the first step."""
        steps = self._steps
        if steps is None:
            return None
        part = (time.monotonic() if now is None else now) - steps.at
        part = min(max(part / steps.gap, 0.0), 1.0)
        if part == 1.0:
            return steps.now
        before, after = steps.before, steps.now
        jumped = np.abs(after[:, :3] - before[:, :3]).max(axis=1) > JUMP
        sign = np.where((before[:, 3:] * after[:, 3:]).sum(1) < 0, -1.0, 1.0)[:, None]
        mixed = before + np.float32(part) * (after - before)
        turn = before[:, 3:] * (1 - part) + after[:, 3:] * sign * part
        mixed[:, 3:] = turn / np.maximum(np.linalg.norm(turn, axis=1, keepdims=True), 1e-6)
        mixed[jumped] = after[jumped]
        return mixed
