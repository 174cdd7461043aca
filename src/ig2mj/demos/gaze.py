"""Gaze of a person: rays of an eye tracker, and statistics of the objects that rays meet.

Axis: T steps of a run.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.demos.reader import Run

GAZE, AREA = "steps/devices/gaze", "steps/devices/area"
"""[T, 7] valid, origin, direction in the play area; [T, 5] x, y, z, yaw of the play area in the world, turning."""


@dataclasses.dataclass(frozen=True)
class Rays:
    """Gaze at frame t of a run, in the world's frame: origin, m, and direction of length 1. The last frame has none.

    Attributes:
      valid: the eyes were tracked.
    """

    origin: Float[np.ndarray, "T 3"]
    direction: Float[np.ndarray, "T 3"]
    valid: Bool[np.ndarray, "T"]

    def at(self, frame: int) -> tuple[np.ndarray, np.ndarray] | None:
        """Origin [3] and direction [3]; None where the eyes were not tracked."""
        if frame >= len(self.valid) or not self.valid[frame]:
            return None
        return self.origin[frame], self.direction[frame]


def measured_rays(run: Run) -> Rays | None:
    """The measured gaze of a run; None if the eyes were never tracked.

    Raises:
      InputError: an array is broken.
    """
    if {GAZE.removeprefix("steps/"), AREA.removeprefix("steps/")} - set(run.step_names):
        return None
    gaze, area = run.all_rows(GAZE), run.all_rows(AREA)
    for name, rows, width in ((GAZE, gaze, 7), (AREA, area, 5)):
        if rows.shape[1:] != (width,) or not np.isfinite(rows).all():
            raise run.broken(name, f"has rows that are not {width} finite numbers")
    length = np.linalg.norm(gaze[:, 4:], axis=1)
    valid = (gaze[:, 0] != 0) & (length > 0)
    if not valid.any():
        return None
    cos, sin, no, one = np.cos(area[:, 3]), np.sin(area[:, 3]), np.zeros(len(area)), np.ones(len(area))
    turn = np.stack([cos, -sin, no, sin, cos, no, no, no, one], axis=1).reshape(-1, 3, 3)
    origin = area[:, :3] + (turn @ gaze[:, 1:4, None])[..., 0]
    direction = (turn @ gaze[:, 4:, None])[..., 0] / np.where(valid, length, 1.0)[:, None]
    return Rays(origin, direction, valid)


def statistics(met: list[str | None], axis: list[np.ndarray], seconds: float, measured: bool) -> dict[str, Any]:
    """Statistics of the object that each frame's ray meets.

    Args:
      met: names of objects; None where the eyes were not tracked, which counts in `tracked` only. axis: [3] per frame,
        ignored where `met` is None.
      seconds: of a frame.
    """
    there = np.array([name is not None for name in met])
    names = [name for name in met if name is not None]
    rays = np.stack([a if t else np.zeros(3) for a, t in zip(axis, there, strict=True)])
    both = there[1:] & there[:-1]
    turns = np.arccos(np.clip((rays[1:] * rays[:-1]).sum(1), -1, 1))[both]
    share = {name: names.count(name) / len(names) for name in dict.fromkeys(names)}
    return {
        "measured": measured,
        "tracked": float(there.mean()),
        "objects": dict(sorted(share.items(), key=lambda pair: -pair[1])),
        "fixations": sum(a != b for a, b in zip(names[1:], names, strict=False)) + bool(names),
        "mean_turn": float(turns.mean() / seconds) if len(turns) else 0.0,
    }
