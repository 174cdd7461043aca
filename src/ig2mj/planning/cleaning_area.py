"""The part of a tool that cleans, and which side of it a hand is on."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.grasps import GraspPose
from ig2mj.planning.moves import UP
from ig2mj.planning.world import PlannedWorld, Vector

COVERED = 0.5
"""Cosine of the angle between where the hand is and where the cleaning area faces, above which the hand covers it."""

FLAT = 0.3
"""Share of its width that a tool is thick at most which is flat, as a cloth is."""

BEHIND = 0.6
"""Cosine of the angle between where a gripper points and where the cleaning area faces, from which on it is behind the
tool."""


def cleaning_area(world: PlannedWorld, tool: str) -> tuple[Float[np.ndarray, "8 3"] | None, Vector]:
    """Corners of a tool's cleaning area, and the direction out of the tool that it faces: along its thinnest side, away
    from the middle; no corners, where the whole tool cleans."""
    p, tables = world.domain.model.parameters, world.domain.model.tables
    number = np.flatnonzero(p.tool_object == world.index(tool))
    link = int(p.tool_link[number[0]]) if len(number) else -1
    if link < 0 or not (tables.link_half[link] > 0).any():
        return None, UP
    half = tables.link_half[link]
    frame = matrices_on_host(np.asarray(world.view.link_quat)[world.world, [link]])[0]
    middle = np.asarray(world.view.link_pos)[world.world, link].astype(float)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    axis, corners = frame[:, int(np.argmin(half))], world.vertices(tool)
    away = (middle - (corners.min(0) + corners.max(0)) / 2) @ axis
    return middle + (signs * half) @ frame.T, axis * (1.0 if away >= 0 else -1.0)


def is_covered(world: PlannedWorld, tool: str, hand: int) -> bool:
    """Whether the hand is on the side of a tool that cleans."""
    area, out = cleaning_area(world, tool)
    return area is not None and float(world.hand_axes(hand)[1] @ out) < -COVERED


def is_behind(world: PlannedWorld, tool: str, palm: Vector) -> bool:
    """Whether a gripper that points along `palm` is behind the side of a flat tool that cleans, and so points at what
    it cleans: one that holds the tool by its rim, more level, does not come down to a floor with it. True of other
    tools."""
    area, out = cleaning_area(world, tool)
    return area is None or not is_flat(world.vertices(tool), out) or float(palm @ out) > BEHIND


def is_flat(corners: Float[np.ndarray, "n 3"], out: Vector) -> bool:
    """Whether an object with such corners is thin along a direction, and wide in all others."""
    across = corners - corners.mean(0)
    across = across - (across @ out)[:, None] * out
    narrow = np.ptp(across @ np.linalg.svd(across, full_matrices=False)[2][1])
    return bool(np.ptp(corners @ out) < FLAT * narrow)


def leaves_free(world: PlannedWorld, tool: str, pose: GraspPose) -> bool:
    """Whether a hand at a pose leaves the side of a tool free that cleans."""
    area, out = cleaning_area(world, tool)
    return area is None or float(pose.palm @ out) >= -COVERED
