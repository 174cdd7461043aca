"""Where a URDF robot's gripper looks for what is in it: rays between the inner faces of two fingers."""

from __future__ import annotations

import numpy as np

from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.layout import Layout

INSIDE = 0.8
"""Share of a finger's half size at which rays begin and end."""


def gripper_rays(name: str, body: RobotBody, layout: Layout) -> tuple[HandRays, ...]:
    """Sixteen rays, as iGibson's of Fetch: four corners of each finger's inner face; none with fewer than two fingers.

    Args:
      name: of the agent.
    """
    links = body.fingers(layout)
    if len(links) < 2 or layout.hand is None:
        return ()
    one, other = links[:2]
    hand = body.frame(layout.hand)[0]
    ends = {link: (body.pose(link), body.box(link)) for link in (one, other)}
    middle = {link: pose[0] + pose[1] @ box[0] for link, (pose, box) in ends.items()}
    corners = {}
    for link, towards in ((one, other), (other, one)):
        (_, turn), (centre, half) = ends[link]
        inward = turn.T @ (middle[towards] - middle[link])
        across = int(np.argmax(np.abs(inward)))
        spots = []
        for first in (-INSIDE, INSIDE):
            for second in (-INSIDE, INSIDE):
                spot, sides = centre.copy(), [k for k in range(3) if k != across]
                spot[across] += np.sign(inward[across]) * half[across]
                spot[sides[0]] += first * half[sides[0]]
                spot[sides[1]] += second * half[sides[1]]
                spots.append(spot)
        corners[link] = np.array(spots)
    palm_pos, palm_turn = body.pose(hand)
    between = palm_turn.T @ ((middle[one] + middle[other]) / 2 - palm_pos)
    return (
        HandRays(
            palm=_named(name, body, hand),
            grasp_point=between,
            start_bodies=(_named(name, body, one),) * 4,
            starts=corners[one],
            end_bodies=(_named(name, body, other),) * 4,
            ends=corners[other],
        ),
    )


def _named(name: str, body: RobotBody, link: str) -> str:
    return name if link == body.base else f"{name}_{link}"
