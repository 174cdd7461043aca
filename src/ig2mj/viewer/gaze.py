"""Where a camera that moves through a home looks: to where there is something to see, and never abruptly.

A camera that always looks along its way looks at a wall where the way bends. Here the whole course of directions is
found at once (Viterbi's algorithm over `DIRECTIONS` directions at each of N stations): directions in which much of the
image is near cost most, then those far from what is wished, then fast turns.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.viewer.sight_lines import SightLines

DIRECTIONS = 72
"""Directions around the circle."""

TILTS = (2.0, -16.0, -30.0)
"""Degrees below the horizon (negative) of the rays that are cast in each direction."""

NEAR, TOO_NEAR = 2.2, 0.7
"""m: what is farther away does not fill an image; what is nearer fills it wholly. Between them, in proportion."""

WEIGHT_NEAR, WEIGHT_TURN = 14.0, 1.0
"""Cost of an image that is full of near things, and of a second of turning by `COMFORTABLE`; per second."""

COMFORTABLE, FASTEST = 40.0, 110.0
"""Degrees in a second: a turn that viewers follow with ease, and the fastest one."""


def plan_gaze(
    lines: SightLines,
    data: mujoco.MjData,
    eyes: Float[np.ndarray, "N 3"],
    wishes: Float[np.ndarray, "N"],
    weights: Float[np.ndarray, "N"],
    *,
    rate: float | int,
    field: float,
) -> Float[np.ndarray, "N"]:
    """Directions of view (azimuths in degrees, continuous over full turns) at stations of a camera's way.

    Args:
      lines, data: what stops a ray, with up-to-date positions. eyes: of the camera, world frame, m.
      wishes: azimuths in degrees to look in where that shows enough. weights: cost in each second of looking 90 degrees
        off. rate: stations in a second. field: field of view, degrees, horizontal.
    """
    step = 360.0 / DIRECTIONS
    angles = np.arange(DIRECTIONS) * step
    off = (angles[None] - np.asarray(wishes)[:, None] + 180.0) % 360.0 - 180.0
    costs = WEIGHT_NEAR * nearness(lines, data, eyes, field) + np.asarray(weights)[:, None] * (off / 90.0) ** 2
    reach = max(1, int(FASTEST / rate / step))
    turns = np.arange(-reach, reach + 1)
    turning = WEIGHT_TURN * (turns * step * rate / COMFORTABLE) ** 2
    best, before = costs[0], np.zeros((len(eyes), DIRECTIONS), int)
    for k in range(1, len(eyes)):
        options = np.stack([np.roll(best, t) + c for t, c in zip(turns, turning, strict=True)])
        before[k] = turns[np.argmin(options, axis=0)]
        best = options.min(axis=0) + costs[k]
    chosen = np.zeros(len(eyes))
    at = chosen[-1] = int(np.argmin(best))
    for k in range(len(eyes) - 1, 0, -1):
        chosen[k - 1] = chosen[k] - before[k, at]
        at = int(chosen[k - 1]) % DIRECTIONS
    return _smooth(chosen * step, rate)


def nearness(
    lines: SightLines, data: mujoco.MjData, eyes: Float[np.ndarray, "N 3"], field: float
) -> Float[np.ndarray, "N DIRECTIONS"]:
    """How much of an image (0..1) near things fill, for each station and direction of view."""
    turn = np.radians(np.arange(DIRECTIONS) * 360.0 / DIRECTIONS)[:, None]
    tilt = np.radians(TILTS)[None]
    rays = np.stack(np.broadcast_arrays(np.cos(turn) * np.cos(tilt), np.sin(turn) * np.cos(tilt), np.sin(tilt)), -1)
    far = np.stack([lines.cast(data, eye, rays.reshape(-1, 3))[1] for eye in np.asarray(eyes, float)])
    near = np.clip((NEAR - far) / (NEAR - TOO_NEAR), 0.0, 1.0).reshape(-1, DIRECTIONS, len(TILTS)).mean(-1)
    half = round(0.5 * field / (360.0 / DIRECTIONS))
    return np.mean([np.roll(near, k, axis=1) for k in range(-half, half + 1)], axis=0)


def _smooth(angles: Float[np.ndarray, "N"], rate: float | int) -> Float[np.ndarray, "N"]:
    """Without the steps of `DIRECTIONS`: a running mean over 0.8 s, twice; the ends stay where they are."""
    half = min(round(0.4 * rate), (len(angles) - 1) // 2)
    for _ in range(2):
        if half:
            padded = np.concatenate([np.full(half, angles[0]), angles, np.full(half, angles[-1])])
            angles = np.convolve(padded, np.full(2 * half + 1, 1 / (2 * half + 1)), mode="valid")
    return angles
