"""Where a gripper takes an object: with all of its width between the fingers, or with one of its edges.

A gripper with assisted grasping holds what a finger presses on and a ray from one finger to the other meets. What is
wider than the fingers open, and so thin that no finger gets below it, as a cloth or a book that lies flat, is taken by
an edge: one finger stands next to it, the other, raised by a tilt of the gripper, is above it. A sheet of a few
millimetres, above which all rays of such a gripper pass, is taken by a corner: the gripper points almost level, with a
side of both fingers on what the sheet lies on, so that rays from these sides meet the corner between them.

Axes: N, M poses, V corners.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.planning.clearance import Obstacles

BITE, SHALLOW, SPARE_OPENING, SLICES = 0.02, 0.005, 0.012, 25
"""m beyond a surface at which the width of an object is looked at, and of one that is thin, m that open fingers are
wider than it, and points between the fingers that are looked at."""

OUTWARD, TILTS = 16, (0.25, 0.45)
"""Horizontal directions in which edges are looked for, and rad by which a gripper is tilted over one."""

BESIDE, ABOVE_SUPPORT, DEEP = 0.008, 0.003, 0.025
"""m from an edge to the inner face of the finger next to it, from the finger's lowest point to what the object lies on,
and below the object's top that this finger reaches at most."""

AT_EDGE, LONG = 0.012, 0.06
"""m from the outermost corner of a side up to which others are on the same edge, and from which on an edge is taken
away from its middle, too."""

THIRDS = (0.0, 1 / 3, -1 / 3)
"""Parts of a long edge at which it is taken, from its middle."""

SHEET, INTO, SLANTS = 0.008, 0.02, (0.3, 0.45)
"""m of height up to which an object is taken by its corners, m from such a corner to the fingertips on both sides of
it, and rad by which the gripper points down there."""

ENTERED = 0.004
"""m by which a finger over an edge may seem to enter the object."""

UP = np.array([0.0, 0.0, 1.0])

Corners = Callable[[np.ndarray, np.ndarray], Float[np.ndarray, "n 3"]]
"""Corners of an open gripper about its grasp point, m, from the direction between its fingers and that in which it
points (`HandedBody.hand_corners`)."""


def between_fingers(
    own: Obstacles,
    points: Float[np.ndarray, "N 3"],
    fingers: Float[np.ndarray, "N 3"],
    palms: Float[np.ndarray, "N 3"],
    opening: float,
    bite: float = BITE,
) -> tuple[Int[np.ndarray, "M"], Float[np.ndarray, "M 3"]]:
    """Poses with the object between the fingers of a gripper: numbers of those from which they come, and points with
    the object in the middle, and near the one finger and the other, as what lies flat has to be. Poses in which the
    object is too wide, or misses the fingers, have none.

    Args:
      own: the object alone. opening: m between the fingers. bite: m beyond the points at which its width is looked at.
    """
    along = np.linspace(-opening / 2, opening / 2, SLICES)
    at = (points + bite * palms)[:, None] + along[:, None] * fingers[:, None]
    inside = own.distance(at) < 0.0
    low = np.where(inside, along, opening).min(1)
    high = np.where(inside, along, -opening).max(1)
    fits = np.flatnonzero((high >= low) & (high - low <= opening - 2 * SPARE_OPENING))
    middle, aside = (low + high)[fits] / 2, (opening - (high - low)[fits]) / 2 - SPARE_OPENING
    shifts = middle[:, None] + aside[:, None] * np.array([0.0, 1.0, -1.0])
    moved = points[fits, None] + shifts[..., None] * fingers[fits, None]
    return np.repeat(fits, 3), moved.reshape(-1, 3)


def over_edges(
    gripper: Corners, opening: float, own: Obstacles, corners: Float[np.ndarray, "V 3"]
) -> tuple[Float[np.ndarray, "M 3"], Float[np.ndarray, "M 3"], Float[np.ndarray, "M 3"]]:
    """Grasp points of a gripper over edges of an object, directions from the outer finger to the inner one, and those
    in which it points: down, and in over the object.

    Args:
      opening: m between the fingers. own: the object alone. corners: its own.
    """
    points, fingers, palms = [], [], []
    for angle in np.arange(OUTWARD) * (2 * np.pi / OUTWARD):
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        along = np.cross(UP, out)
        outermost = float((corners @ out).max())
        edge = corners[corners @ out > outermost - AT_EDGE]
        top, bottom = float(edge[:, 2].max()), float(edge[:, 2].min())
        ends = (edge @ along).min(), (edge @ along).max()
        length = float(ends[1] - ends[0])
        lowest = max(bottom + ABOVE_SUPPORT, top - DEEP)
        for share in THIRDS if length > LONG else THIRDS[:1]:
            outside = (sum(ends) / 2 + share * length) * along + (outermost + BESIDE) * out
            for tilt in TILTS:
                finger = np.sin(tilt) * UP - np.cos(tilt) * out
                palm = -np.cos(tilt) * UP - np.sin(tilt) * out
                hand = gripper(finger, palm)
                tip = float((hand @ palm).max()) * palm - opening / 2 * finger  # of the outer finger's inner face
                at = outside - (tip - tip[2] * UP) + (lowest - float(hand[:, 2].min())) * UP
                points.append(at)
                fingers.append(finger)
                palms.append(palm)
    points, fingers, palms = np.array(points), np.array(fingers), np.array(palms)
    held = holds(gripper, opening, own, points, fingers, palms)
    return points[held], fingers[held], palms[held]


def around_corners(
    gripper: Corners, opening: float, own: Obstacles, corners: Float[np.ndarray, "V 3"]
) -> tuple[Float[np.ndarray, "M 3"], Float[np.ndarray, "M 3"], Float[np.ndarray, "M 3"]]:
    """Grasp points of a gripper whose fingers are on both sides of a corner of a thin object that lies flat, and on
    what it lies on, directions between the fingers, and those in which it points.

    Args:
      opening: m between the fingers. own: the object alone. corners: its own.
    """
    points, fingers, palms = [], [], []
    bottom, height = float(corners[:, 2].min()), float(np.ptp(corners[:, 2]))
    along = np.linspace(-opening / 2, opening / 2, SLICES)
    for angle in np.arange(OUTWARD) * (2 * np.pi / OUTWARD) if height < SHEET else ():
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        across, outermost = np.cross(UP, out), float((corners @ out).max())
        tip = corners[corners @ out > outermost - INTO / 2] @ across
        inner = (outermost - INTO) * out + (tip.min() + tip.max()) / 2 * across + (bottom + height / 2) * UP
        inside = along[own.distance(inner + along[:, None] * across) < 0.0]
        if not len(inside) or np.ptp(inside) > opening - 2 * SPARE_OPENING:
            continue
        inner = inner + (inside.min() + inside.max()) / 2 * across
        for slant in SLANTS:
            palm = -np.cos(slant) * out - np.sin(slant) * UP
            hand = gripper(across, palm)
            lowest = hand[hand[:, 2] < hand[:, 2].min() + ENTERED].mean(0)
            at = inner - (lowest @ out) * out
            at[2] = bottom - float(hand[:, 2].min())
            points.append(at)
            fingers.append(across)
            palms.append(palm)
    return np.array(points).reshape(-1, 3), np.array(fingers).reshape(-1, 3), np.array(palms).reshape(-1, 3)


def holds(
    gripper: Corners,
    opening: float,
    own: Obstacles,
    points: Float[np.ndarray, "N 3"],
    fingers: Float[np.ndarray, "N 3"],
    palms: Float[np.ndarray, "N 3"],
) -> Bool[np.ndarray, "N"]:
    """Poses of an open gripper in which a line between its fingers meets an object, and its hand does not enter it.

    Args:
      opening: m between the fingers. points: grasp points. own: the object alone.
    """
    if not len(points):
        return np.zeros(0, bool)
    hands = np.stack([gripper(f, p) for f, p in zip(fingers, palms, strict=True)])
    free = own.distance(hands + points[:, None]).min(1) > -ENTERED
    tip = float(np.einsum("nkc,nc->nk", hands, palms).max())
    share, half = np.linspace(0.0, 1.0, SLICES)[:, None, None], opening / 2
    lines = [
        points + (x + share * (y - x)) * palms + (2 * share - 1.0) * half * fingers
        for x in (tip, 0.0)
        for y in (tip, 0.0, -tip)
    ]
    return free & (own.distance(np.concatenate(lines)) < 0.0).any(0)
