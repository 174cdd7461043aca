"""Where the cameras of a converted robot's hands are: above the hand as it is held at the start, looking past it at
the point where it grasps."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.agents.parts import normalized
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.grip import hand_rays
from ig2mj.agents.urdf.layout import Layout
from ig2mj.agents.wrist_cameras import LEFT, RIGHT

ABOVE = 0.06
"""m between the hand's collision geometry and the camera."""

BEYOND = 0.04
"""m beyond the grasp point at which the camera looks."""

SMALL = 1e-3
"""m or a share: shorter vectors have no direction."""


@dataclasses.dataclass(frozen=True)
class WristView:
    """In the frame of a link: where a camera is and what it looks at (m), and what is up in its image."""

    link: str
    eye: Float[np.ndarray, "3"]
    at: Float[np.ndarray, "3"]
    up: Float[np.ndarray, "3"]


def wrist_views(body: RobotBody, layout: Layout, holding: Sequence[str], name: str) -> dict[str, WristView]:
    """By name of the camera. `holding`: links that hold something. `name`: of the agent."""
    if not holding:
        return {}
    data = body.posed({joint: body.start_of(joint, layout) for joint in (*layout.arm, *layout.gripper)})
    points = {rays.palm: np.asarray(rays.grasp_point, float) for rays in hand_rays(name, body, layout)}

    def view(link: str) -> WristView:
        centre, half = body.shapes.box(link)
        turn = body.pose(link, data)[1]
        grasp = points.get(name if link == body.base else f"{name}_{link}", centre + half)
        along = grasp - centre
        along = normalized(along) if np.linalg.norm(along) > SMALL else normalized(turn.T @ np.array([1.0, 0, 0]))
        for axis in np.eye(3)[[2, 0, 1]]:  # above the hand; in front of one that points down
            up = turn.T @ axis
            up = up - along * (up @ along)
            if np.linalg.norm(up) > 0.3:
                break
        up = normalized(up)
        return WristView(link, centre + up * (np.abs(up) @ half + ABOVE), grasp + BEYOND * along, up)

    if len(holding) == 1:
        return {RIGHT: view(holding[0])}
    sides = sorted(holding, key=lambda link: float(body.pose(link, data)[0][1]))
    return {RIGHT: view(sides[0]), LEFT: view(sides[-1])}
