"""Turning over a flat tool that lies with the side up that cleans, with one hand.

It is held upright by its edge, leaning to the hand, and let go, so that it falls onto that side.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ig2mj.planning.cleaning_area import cleaning_area
from ig2mj.planning.moves import UP, Program, ahead
from ig2mj.planning.placing import let_fall
from ig2mj.planning.world import PlannedWorld, Rotation, Vector

LEANS = 0.4
"""rad from upright at which what is turned over is let go."""


def turn_over(world: PlannedWorld, tool: str, hand: int) -> Generator[Program, str, bool]:
    """Lets a tool fall onto its side that cleans; returns whether it lies on that side."""
    area, out = cleaning_area(world, tool)
    if area is None:
        return False
    edge = world.grip(hand) - world.com(tool)
    if not (yield from let_fall(world, tool, hand, leaning(out, edge, ahead(world.base[1])))):
        return False
    return float(cleaning_area(world, tool)[1] @ UP) < 0.0


def leaning(out: Vector, edge: Vector, front: Vector) -> Rotation:
    """The rotation after which a flat tool is upright, but for `LEANS` to the robot, which its side that cleans faces.

    Args:
      out: where that side faces now. edge: from the tool's middle to where it is held: that is its top then. front:
        where the robot looks; unit vector.
    """
    edge = edge - (edge @ out) * out
    if np.linalg.norm(edge) < 1e-6:
        edge = np.cross(out, np.cross(front, out))
    c, s = np.cos(LEANS), np.sin(LEANS)
    now = _frame(out, edge / np.linalg.norm(edge))
    return _frame(-c * front - s * UP, c * UP - s * front) @ now.T


def _frame(one: Vector, two: Vector) -> Rotation:
    return np.stack([one, two, np.cross(one, two)], axis=1)
