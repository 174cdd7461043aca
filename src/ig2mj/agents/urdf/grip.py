"""A URDF robot's grippers: rays between the inner faces of two fingers, and at which limits they are closed."""

from __future__ import annotations

import dataclasses

import numpy as np

from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.layout import Gripper, Layout

INSIDE = 0.8
"""Share of a finger's half size at which rays begin and end."""


NEARER = 1e-3
"""m by which two fingers are nearer to each other at one limit of a joint, so that it counts as the closed one."""


def with_closed_limits(body: RobotBody, layout: Layout) -> Layout:
    """The layout with the limit at which each gripper is closed, where it does not say so.

    That of two fingers which are nearer to each other there; the lower one where there are no two, or where it makes no
    difference.
    """
    if layout.several:
        return dataclasses.replace(layout, several=tuple(_with_closed_limit(body, one) for one in layout.several))
    found = [_with_closed_limit(body, one) for one in layout.grippers]
    if not found:
        return dataclasses.replace(layout, closed=layout.closed or "lower")
    return dataclasses.replace(layout, closed=found[0].closed, reversed=found[0].reversed)


def _with_closed_limit(body: RobotBody, gripper: Gripper) -> Gripper:
    if gripper.closed:
        return gripper
    pair = _facing(body, gripper) if len(_tips(body, gripper)) == 2 else None
    high = [] if pair is None else [name for name in gripper.joints if _closes_high(body, gripper, name, pair)]
    if len(high) == len(gripper.joints):
        return dataclasses.replace(gripper, closed="upper")
    return dataclasses.replace(gripper, closed="lower", reversed=tuple(high))


def _closes_high(body: RobotBody, gripper: Gripper, joint: str, pair: tuple[str, str]) -> bool:
    """Two fingers are nearer to each other at a joint's upper limit, the other joints half way."""
    half = {name: sum(body.limits(name)) / 2 for name in gripper.joints}
    at_lower, at_upper = (body.distance(*pair, half | {joint: limit}) for limit in body.limits(joint))
    return at_upper < at_lower - NEARER


def gripper_rays(name: str, body: RobotBody, gripper: Gripper) -> HandRays | None:
    """Sixteen rays, as iGibson's of Fetch: four corners of each finger's inner face; none with fewer than two fingers.

    name: of the agent.
    """
    pair = _facing(body, gripper)
    if pair is None:
        return None
    one, other = pair
    hand = body.frame(gripper.hand)[0]
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
    return HandRays(
        palm=_named(name, body, hand),
        grasp_point=between,
        start_bodies=(_named(name, body, one),) * 4,
        starts=corners[one],
        end_bodies=(_named(name, body, other),) * 4,
        ends=corners[other],
    )


def _facing(body: RobotBody, gripper: Gripper) -> tuple[str, str] | None:
    """Two fingers between which something is held: the tips of the first two that hang on the hand."""
    pair = _tips(body, gripper)[:2]
    return (pair[0], pair[1]) if len(pair) == 2 else None


def _tips(body: RobotBody, gripper: Gripper) -> list[str]:
    """The last link with a shape of each finger, in the order of the file's.

    Where branches of a hand have different numbers of links, fingers are those with the most: the others guide them, as
    the inner knuckles of a four-bar linkage do.
    """
    tips: dict[str, str] = {}
    links: dict[str, int] = {}
    for link in body.fingers(gripper):  # the first of each finger, then what hangs on it
        branch = body.branch(link, gripper)
        links[branch] = links.get(branch, 0) + 1
        if body.has_shape(link):
            tips[branch] = link
    if len(tips) > 2:
        most = sorted((links[branch] for branch in tips), reverse=True)[1]
        tips = {branch: link for branch, link in tips.items() if links[branch] >= most}
    return list(tips.values())


def _named(name: str, body: RobotBody, link: str) -> str:
    return name if link == body.base else f"{name}_{link}"
