"""Spots of a home where an activity could be done: in front of which furniture, and where the robot stands.

Of all pieces of furniture that an activity can use (`Task.fit`), and of all positions of free floor in front of them,
those count from which a robot's hand reaches what it needs. Everything follows from the home's geometry at its start.

Axis: N points.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
import re
from collections.abc import Iterator

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.errors import EngineError
from ig2mj.scene.bare_scenes import bare_scene
from ig2mj.tasks.household import SITS, Household, axes_of
from ig2mj.tasks.task import Fit

SHOULDER = (-0.15, -0.15, 0.85)
"""m ahead, to the left and above the floor of the robot: from where the right hand reaches, as at home."""

STEP = 0.05
"""m between positions that are tried, and between points of a surface that count."""

AROUND = 1.2
"""m around the furniture within which the robot may stand."""

MARGIN = 0.06
"""m from the edge of a surface on which nothing is put."""

AHEAD, ASIDE = (0.28, 0.95), 0.55
"""m ahead of the robot, least and most, and to either side, where it sees what lies before it."""

VIEW = (0.05, 1.0)
"""m from the middle of a robot to its camera, ahead, and the tangent of half the angle that the camera sees."""

SEEN = 0.7
"""Share of a surface in reach that the camera sees, at least."""

ENOUGH = 24
"""Points of a surface in reach: 0.06 m2. With fewer, hardly any sampled state would count."""

FOR_ARM = 0.12
"""m to the right of an arm's base within which the middle of what is in reach lies. Fetch's gripper begins on its
right: farther to that side, its forearm sweeps what it is to take."""

ALIKE = 0.0
"""Likeness of spots that are further places of a home, at least."""


@dataclasses.dataclass(frozen=True)
class Spot:
    """Where a task could be done.

    Attributes:
      surface, anchor: objects of the home; anchor "" where none is needed. x, y: m. quarter: turns by 90 degrees of
        what the robot faces, from x. height: m of the floor there. top: m above the floor of the surface.
      likeness: larger is more like the task's own home. arm: m further to the left where a robot stands that reaches
        with an arm.
    """

    surface: str
    anchor: str
    x: float
    y: float
    quarter: int
    height: float
    top: float
    likeness: float
    arm: float = 0.0


@functools.lru_cache(maxsize=256)
def best_spot(name: str, fit: Fit, folder: str) -> Spot:
    """The best spot in a home. Raises EngineError: there is none."""
    home = Household(bare_scene(folder))
    label = home.scene.name
    anchors = _anchors(home, fit)
    surfaces = [(s, rank) for rank, kind in enumerate(fit.surfaces) for s in home.of(kind)]
    if not anchors:
        raise EngineError(f"{name} cannot be done in '{label}': it has no {' and no '.join(fit.anchors)}")
    if not surfaces:
        raise EngineError(f"{name} cannot be done in '{label}': it has no {', '.join(fit.surfaces)}")
    found: list[Spot] = []
    for rank in range(len(fit.surfaces)):  # the next kind only where there is nothing of the one before
        pairs = [(a, s) for a in anchors for s, of in surfaces if of == rank]
        found += [spot for a, s in pairs for spot in _spots(home, fit, a, s, rank)]
        if found and not anchors[0]:
            break
    if not found:
        words = f"with {' or '.join(fit.anchors)} " if fit.anchors else ""
        raise EngineError(
            f"{name} cannot be done in '{label}': nowhere on its free floor is a {' or '.join(fit.surfaces)} {words}"
            "within a robot's reach"
        )
    return _for_arm(home, fit, max(found, key=lambda spot: spot.likeness))


def _anchors(home: Household, fit: Fit) -> list[str]:
    """Furniture at which an activity can be done; a single "" where none is needed."""
    return [a for kind in fit.anchors for a in home.of(kind)] if fit.anchors else [""]


def _points(low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> Float[np.ndarray, "N 3"]:
    """Points of the top of a box."""
    spread = np.array([*np.meshgrid(*(np.arange(low[k] + MARGIN, high[k] - MARGIN, STEP) for k in (0, 1)))])
    return np.column_stack([spread.reshape(2, -1).T, np.full(spread[0].size, high[2])])


def _in_view(ahead: Float[np.ndarray, "N"], left: Float[np.ndarray, "N"]) -> Bool[np.ndarray, "N"]:
    """Whether a robot's camera sees points so many metres ahead and to the left of it."""
    return np.abs(left) < VIEW[1] * (ahead - VIEW[0])


def _spots(home: Household, fit: Fit, anchor: str, surface: str, rank: int) -> Iterator[Spot]:
    """Positions from which a surface and an anchor are in reach."""
    if anchor == surface:
        return
    low, high = home.box(surface)
    if fit.on_floor:
        high = high.copy()
        if high[2] > SITS:
            return
    elif not fit.heights[0] <= high[2] <= fit.heights[1]:
        return
    target, quarters = None, range(4)
    if anchor and fit.link is not None:
        target, facing = home.link(anchor, fit.link), home.facing(anchor)
        if target is None or facing is None:
            return
        quarters = [(facing + 2) % 4]
    elif anchor:
        box = home.box(anchor)
        target = np.array([*(0.5 * (box[0] + box[1]))[:2], box[1][2]])
    points = _points(low, high)
    if not len(points):
        return
    middle = np.array([*(0.5 * (low + high))[:2]]) if target is None else target[:2]
    reach = AROUND + (0.5 * (high - low)[:2].max() if target is None else 0.0)
    for quarter in quarters:
        ahead, left = axes_of(quarter)
        step = STEP if anchor else 2 * STEP
        ticks = np.arange(-reach, reach + step, step)
        at = np.round((middle + np.array(np.meshgrid(ticks, ticks)).reshape(2, -1).T) / STEP) * STEP
        if target is None:  # in front of the surface
            outside = np.maximum(low[:2] - at, at - high[:2])
            at = at[np.linalg.norm(np.maximum(outside, 0.0), axis=1) < fit.gap + 0.1]
        if not len(at):
            continue
        at = at[home.free(at, 0.0)]
        if target is not None:
            off = target[:2] - at
            seen = (off @ ahead[:2] > 0.2) & (np.abs(off @ left[:2]) < fit.aside)
            at = at[seen]
        for x, y in at:
            spot = _judged(home, fit, anchor, surface, rank, (float(x), float(y), quarter), points, target)
            if spot is not None:
                yield spot


def _shoulder(ahead: Float[np.ndarray, "3"], left: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """From a robot's middle to its shoulder."""
    return SHOULDER[0] * ahead + SHOULDER[1] * left + np.array([0, 0, SHOULDER[2]])


def _in_reach(
    fit: Fit, off: Float[np.ndarray, "N 3"], ahead: Float[np.ndarray, "3"], left: Float[np.ndarray, "3"]
) -> tuple[Bool[np.ndarray, "N"], Bool[np.ndarray, "N"]]:
    """Which points count: those in reach before a robot, and all in reach. `off`: from its middle to them."""
    in_reach = np.linalg.norm(off - _shoulder(ahead, left), axis=1) < fit.within
    least, most = AHEAD
    seen = (off @ ahead > least) & (off @ ahead < most) & (np.abs(off @ left) < ASIDE)
    return seen & in_reach, in_reach


def _judged(
    home: Household,
    fit: Fit,
    anchor: str,
    surface: str,
    rank: int,
    pose: tuple[float, float, int],
    points: Float[np.ndarray, "N 3"],
    target: Float[np.ndarray, "3"] | None,
) -> Spot | None:
    """A position, if it will do. `points`: of the surface. `target`: what of the anchor must be in reach."""
    x, y, quarter = pose
    ahead, left = axes_of(quarter)
    here = np.array([x, y, 0.0])
    if target is not None and np.linalg.norm(target - here - _shoulder(ahead, left)) > fit.reach:
        return None
    off = points - here
    near, in_reach = _in_reach(fit, off, ahead, left)
    if near.sum() < ENOUGH:
        return None
    visible = 1.0 if fit.on_floor else float(_in_view(off @ ahead, off @ left)[in_reach].mean())
    height = home.floor(here[:2])
    likeness = min(float(near.sum()), 120.0) / 120.0 - 0.3 * rank
    if fit.target is not None and target is not None:
        offset = target - here
        likeness -= 2.0 * float(np.hypot(offset @ ahead - fit.target[0], offset @ left - fit.target[1]))
    likeness -= 2.0 * max(0.0, SEEN - visible)
    gap = float((off[near] @ ahead).min())
    likeness -= 2.0 * max(0.0, gap - fit.gap)
    return Spot(
        surface, anchor, round(x, 3), round(y, 3), quarter, round(height, 3), round(float(points[0, 2]), 3), likeness
    )


def _for_arm(home: Household, fit: Fit, spot: Spot) -> Spot:
    """A spot with the place of an arm: the nearest to its right from where what is in reach is within `FOR_ARM`."""
    if not spot.anchor or fit.link is None:
        return spot
    (ahead, left), here = axes_of(spot.quarter), np.array([spot.x, spot.y, 0.0])
    off = _points(*home.box(spot.surface)) - here
    aside = float((off[_in_reach(fit, off, ahead, left)[0]] @ left).mean())
    target = home.link(spot.anchor, fit.link)
    assert target is not None
    shift = min(0.0, -STEP * np.ceil((-FOR_ARM - aside) / STEP))
    reaches = abs((target - here) @ left - shift) < fit.aside
    free = home.free((here + shift * left)[None, :2], 0.0)[0]
    return dataclasses.replace(spot, arm=round(float(shift), 3)) if reaches and free else spot


@functools.lru_cache(maxsize=256)
def further_spots(fit: Fit, folder: str, surface: str, anchor: str) -> tuple[Spot, ...]:
    """The best spot at every other pair of surface and anchor, the most alike first.

    An anchor on the other side of the robot than at home counts as one on the same: the robot then turns the other way.

    Args:
      surface, anchor: of the home's first place.
    """
    home = Household(bare_scene(folder))
    anchors = _anchors(home, fit)
    sides = [fit]
    if fit.target is not None:
        sides.append(dataclasses.replace(fit, target=(fit.target[0], -fit.target[1])))
    found = list[Spot]()
    for rank, kind in enumerate(fit.surfaces):
        for a, s in [(a, s) for a in anchors for s in home.of(kind) if (s, a) != (surface, anchor)]:
            spots = [spot for side in sides for spot in _spots(home, side, a, s, rank)]
            if spots and (best := max(spots, key=lambda spot: spot.likeness)).likeness > ALIKE:
                found.append(_for_arm(home, fit, best))
    return tuple(sorted(found, key=lambda spot: -spot.likeness))


def home_and_place(home: str | os.PathLike) -> tuple[str | os.PathLike, int]:
    """A home, and the number of the place there: "birch:1" is the second place of birch, "birch" the first."""
    numbered = re.fullmatch(r"(.+):(\d+)", home) if isinstance(home, str) else None
    if numbered is None or pathlib.Path(home).exists():
        return home, 0
    return numbered[1], int(numbered[2])
