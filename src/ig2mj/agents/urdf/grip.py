"""How a converted robot's hands hold: rays between the inner faces of fingers, and at which limits grippers are closed.

A hand is one of three kinds:

- A gripper with two fingers or more. Rays run from one finger to the others: to one of two, and to the two nearest
  tips of a hand with more, from the finger that stands apart from them.
- A gripper with one finger that closes against a part of the hand that does not move, as on many small arms.
- A suction cup. Rays run a short way out of it.
"""

from __future__ import annotations

import dataclasses
import itertools

import mujoco
import numpy as np

from ig2mj.agents.hand_rays import HandRays
from ig2mj.agents.urdf.body import RobotBody
from ig2mj.agents.urdf.layout import Gripper, Layout

INSIDE = 0.8
"""Share of a fingertip's half size at which rays begin and end."""

FINGERTIP = 0.5
"""Share of a finger's length, from its end, by which it holds."""

NEARER = 1e-3
"""m by which fingers are nearer to each other at one limit of a joint, so that it counts as the closed one."""

OPPOSITE = 2
"""Most fingers that another one closes against."""

FAR = 0.9
"""Share of the farthest finger's distance from the hand up to which a part of it is a finger."""

NEARLY = 0.1
"""Share of its way by which a jaw is open that is about to meet the hand."""

OUTER, JAW_LENGTH = (0.95, 0.8, 0.65, 0.5), 0.6
"""Shares of the length of the only finger at which rays begin, and at which it holds."""

JAW_HOLDS, ALONG_FACE = 0.026, 0.012
"""m between the fixed part of a gripper with one jaw and the middle of what it is to hold; m before and beyond that
middle at which the direction of the fixed part's face is measured."""

CUP, SUCTION_REACH = 0.006, 0.03
"""m: half the distance between the rays of a suction cup, and how far they lead out of it."""


def with_closed_limits(body: RobotBody, layout: Layout) -> Layout:
    """The layout with the limit at which each gripper is closed, where it does not say so.

    That at which its fingers are nearer to each other, or to the hand where there is just one; the lower one where it
    makes no difference.
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
    high = [name for name in gripper.joints if _closes_high(body, gripper, name)]
    if len(high) == len(gripper.joints):
        return dataclasses.replace(gripper, closed="upper")
    return dataclasses.replace(gripper, closed="lower", reversed=tuple(high))


def _closes_high(body: RobotBody, gripper: Gripper, joint: str) -> bool:
    """Fingers are nearer to each other at a joint's upper limit, the other joints half way."""
    half = _half_way(body, gripper)
    at_lower, at_upper = (_opening(body, gripper, body.posed(half | {joint: limit})) for limit in body.limits(joint))
    return at_upper < at_lower - NEARER


def _half_way(body: RobotBody, gripper: Gripper) -> dict[str, float]:
    return {name: sum(body.limits(name)) / 2 for name in gripper.joints}


def _opening(body: RobotBody, gripper: Gripper, data: mujoco.MjData) -> float:
    """m: mean distance between the fingers' middles; of a single finger, between its tip and the hand."""
    tips = finger_tips(body, gripper)
    if len(tips) == 1:
        tip = _to_base(body, tips[0], _outermost(body, tips[0])[None], data)
        return float(np.linalg.norm(_to_base(body, *_palm_points(body, gripper), data) - tip, axis=1).min())
    middles = [_to_base(body, tip, body.shapes.box(tip)[0][None], data)[0] for tip in tips]
    apart = [float(np.linalg.norm(a - b)) for a, b in itertools.combinations(middles, 2)]
    return float(np.mean(apart)) if apart else 0.0


def _outermost(body: RobotBody, finger: str) -> np.ndarray:
    """The point [3] of a finger that is farthest from its joint, in its frame."""
    points = body.shapes.points(finger)
    return points[np.argmax(np.linalg.norm(points, axis=1))]


def _palm_points(body: RobotBody, gripper: Gripper) -> tuple[str, np.ndarray]:
    """The link that moves a hand, and its points."""
    hand = body.frame(gripper.hand)[0]
    points = body.shapes.points(hand)
    return hand, points if len(points) else np.zeros((1, 3))


def _to_base(body: RobotBody, link: str, points: np.ndarray, data: mujoco.MjData) -> np.ndarray:
    """Points [n, 3] of a link in the base's frame."""
    pos, turn = body.pose(link, data)
    return pos + points @ turn.T


def hand_rays(name: str, body: RobotBody, layout: Layout) -> tuple[HandRays, ...]:
    """Of all hands that can hold something: of grippers, then of suction; each palm's once. name: of the agent."""
    found = [gripper_rays(name, body, gripper) for gripper in layout.grippers]
    found += [suction_rays(name, body, link) for link in layout.suction]
    return tuple({hand.palm: hand for hand in found if hand is not None}.values())


def gripper_rays(name: str, body: RobotBody, gripper: Gripper) -> HandRays | None:
    """Four corners of each finger's inner face, as iGibson's of Fetch; None where no finger has a shape.

    name: of the agent.
    """
    tips = finger_tips(body, gripper)
    if not tips:
        return None
    hand = body.frame(gripper.hand)[0]
    data = body.posed(_half_way(body, gripper))
    if len(tips) == 1:
        one, starts, others = tips[0], *_against_palm(body, gripper, tips[0], data)
    else:
        one, opposite = _opposed(body, tips, data)
        middles = {tip: _to_base(body, tip, body.shapes.box(tip)[0][None], data)[0] for tip in tips}
        towards = np.mean([middles[other] for other in opposite], axis=0)
        palm = body.pose(hand, data)[0]
        starts = _face(body, gripper, one, towards - middles[one], palm, data)
        others = [(other, _face(body, gripper, other, middles[one] - middles[other], palm, data)) for other in opposite]
    ends = np.concatenate([points for _, points in others])
    inner = [_to_base(body, one, starts, data).mean(0), np.mean([_to_base(body, *o, data).mean(0) for o in others], 0)]
    palm_pos, palm_turn = body.pose(hand, data)
    return HandRays(
        palm=_named(name, body, hand),
        grasp_point=palm_turn.T @ (np.mean(inner, axis=0) - palm_pos),
        start_bodies=(_named(name, body, one),) * len(starts),
        starts=starts,
        end_bodies=tuple(_named(name, body, other) for other, points in others for _ in points),
        ends=ends,
    )


def _opposed(body: RobotBody, tips: list[str], data: mujoco.MjData) -> tuple[str, list[str]]:
    """The finger that stands apart from the others, and the two nearest to it of those; the first of two."""
    middles = {tip: _to_base(body, tip, body.shapes.box(tip)[0][None], data)[0] for tip in tips}
    apart = {t: sum(float(np.linalg.norm(middles[t] - middles[o])) for o in tips) for t in tips}
    one = max(tips, key=lambda tip: ("thumb" in tip.lower(), round(apart[tip], 6))) if len(tips) > 2 else tips[0]
    others = sorted((t for t in tips if t != one), key=lambda t: float(np.linalg.norm(middles[t] - middles[one])))
    return one, others[:OPPOSITE]


def _face(
    body: RobotBody, gripper: Gripper, link: str, inward: np.ndarray, palm: np.ndarray, data: mujoco.MjData
) -> np.ndarray:
    """Four points [4, 3] on the side of a fingertip's box that faces `inward`, in the frame of the finger's last link.

    inward: in the base's frame. palm: where the hand is, in the base's frame, m.
    """
    (pos, turn), points = body.pose(link, data), body.shapes.edge_points(link)
    local = turn.T @ inward
    outward = points.mean(0) - turn.T @ (palm - pos)
    along = local / max(float(np.linalg.norm(local)), 1e-9)
    outward = outward - along * (outward @ along)
    outward = outward / max(float(np.linalg.norm(outward)), 1e-9)
    branch = body.branch(link, gripper)
    inner = [part for part in body.fingers(gripper) if part != link and body.branch(part, gripper) == branch]
    whole = np.concatenate(
        [points, *((_to_base(body, part, body.shapes.points(part), data) - pos) @ turn for part in inner)]
    )
    reach = points @ outward
    tip = points[reach >= reach.max() - FINGERTIP * np.ptp(whole @ outward)]
    centre, half = (tip.min(0) + tip.max(0)) / 2, np.ptp(tip, axis=0) / 2
    across = int(np.argmax(np.abs(local)))
    sides = [k for k in range(3) if k != across]
    spots = []
    for first, second in itertools.product((-INSIDE, INSIDE), repeat=2):
        spot = centre.copy()
        spot[across] += np.sign(local[across]) * half[across]
        spot[sides[0]] += first * half[sides[0]]
        spot[sides[1]] += second * half[sides[1]]
        spots.append(spot)
    return np.array(spots)


def _against_palm(
    body: RobotBody, gripper: Gripper, finger: str, data: mujoco.MjData
) -> tuple[np.ndarray, list[tuple[str, np.ndarray]]]:
    """Points of the only finger, in its frame, and points of the hand that they meet when it closes."""
    closed = body.posed({n: body.limits(n)[0 if gripper.closes_low(n) else 1] for n in gripper.joints})
    hand, palm = _palm_points(body, gripper)
    own = body.shapes.points(finger)
    outer = own[np.argsort(-np.linalg.norm(own, axis=1))]
    starts = np.array([outer[0] * share for share in OUTER])
    there = _to_base(body, hand, palm, closed)
    ends = [palm[np.argmin(np.linalg.norm(there - p, axis=1))] for p in _to_base(body, finger, starts, closed)]
    return starts, [(hand, np.array(ends))]


@dataclasses.dataclass(frozen=True)
class JawFrame:
    """Of a gripper whose only finger closes against the hand, in the palm's frame: the middle of what it holds (m), and
    unit vectors from the finger to the hand, at right angles to the hand's face, and along that face."""

    point: np.ndarray
    across: np.ndarray
    ahead: np.ndarray


def jaw_frame(body: RobotBody, gripper: Gripper) -> JawFrame | None:
    """That of a gripper with one finger; None: it has several, or none.

    Such a jaw turns by up to 90 degrees: where it is open its way does not lead across the hand. What it holds comes to
    lie against the part that does not move.
    """
    tips = finger_tips(body, gripper)
    if len(tips) != 1:
        return None
    hand, places, turns, ends = body.frame(gripper.hand)[0], [], [], np.zeros(3)
    for share in (NEARLY, 0.0):
        limits = {n: body.limits(n)[:: 1 if gripper.closes_low(n) else -1] for n in gripper.joints}
        data = body.posed({n: shut + share * (wide - shut) for n, (shut, wide) in limits.items()})
        pos, turn = body.pose(hand, data)
        starts, [(_, meets)] = _against_palm(body, gripper, tips[0], data)
        places.append((_to_base(body, tips[0], starts, data) - pos) @ turn)
        turns.append(turn.T @ body.pose(tips[0], data)[1])
        ends = meets.mean(0)
    across = _unit((places[1] - places[0]).mean(0))
    tip, foot = places[1][0], places[1][-1]
    finger = tip + (OUTER[0] - JAW_LENGTH) / (OUTER[0] - OUTER[-1]) * (foot - tip)
    point = finger + across * (ends - finger) @ across - JAW_HOLDS * across
    hinge, towards = _axis(turns[0].T @ turns[1]), places[1][0] - places[1][-1]
    if hinge is not None:  # what lies across the jaw does not lead along it
        side = turns[1] @ hinge
        points = (_to_base(body, tips[0], body.shapes.points(tips[0]), data) - pos) @ turn
        spread = points @ side
        point = point + side * ((spread.min() + spread.max()) / 2 - point @ side)
        towards = towards - side * (towards @ side)
    ahead = _unit(towards - across * (towards @ across))
    data = body.posed({})
    to_face = [
        body.shapes.distance_along(hand, point + share * ALONG_FACE * ahead, across, data) for share in (-1.0, 1.0)
    ]
    if None not in to_face:
        near, far = to_face
        assert near is not None and far is not None
        if abs(far - near) < 2 * ALONG_FACE:
            ahead = _unit(2 * ALONG_FACE * ahead + (far - near) * across)
            across = _unit(across - ahead * (across @ ahead))
            point = point + across * ((near + far) / 2 - JAW_HOLDS)
    return JawFrame(point, across, ahead)


def _axis(turn: np.ndarray) -> np.ndarray | None:
    """Unit vector about which a rotation matrix turns; None: it does not."""
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, turn.ravel())
    size = float(np.linalg.norm(quat[1:]))
    return quat[1:] / size if size > NEARER else None


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / max(float(np.linalg.norm(vector)), 1e-9)


def suction_rays(name: str, body: RobotBody, link: str) -> HandRays:
    """Out of a suction cup. name: of the agent."""
    palm, pos, quat = body.frame(link)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, quat)
    axes = turn.reshape(3, 3).T
    signed = np.concatenate([axes[[2, 0, 1]], -axes[[2, 0, 1]]])  # z before x and y, where it is open
    outward = pos / max(float(np.linalg.norm(pos)), 1e-9)
    axis = signed[int(np.argmax(np.round(signed @ outward, 3)))]
    side = axes[int(np.argmin(np.abs(axes @ axis)))]
    other = np.cross(axis, side)
    spots = np.array([pos + CUP * (a * side + b * other) for a, b in itertools.product((-1, 1), repeat=2)])
    body_name = _named(name, body, palm)
    return HandRays(body_name, pos, (body_name,) * 4, spots, (body_name,) * 4, spots + SUCTION_REACH * axis)


def finger_tips(body: RobotBody, gripper: Gripper) -> list[str]:
    """The last link with a shape of each finger, in the order of the file's.

    Where branches of a hand have different numbers of links, fingers are those with the most: the others guide them, as
    the inner knuckles of a four-bar linkage do. Of more than two, those are no fingers that end nearer to the hand.
    """
    tips: dict[str, str] = {}
    links: dict[str, int] = {}
    for link in body.fingers(gripper):  # the first of each finger, then what hangs on it
        branch = body.branch(link, gripper)
        links[branch] = links.get(branch, 0) + 1
        if body.shapes.has_shape(link):
            tips[branch] = link
    if len(tips) > 2:
        most = sorted((links[branch] for branch in tips), reverse=True)[1]
        tips = {branch: link for branch, link in tips.items() if links[branch] >= most}
    found = list(tips.values())
    if len(found) > 2:
        data, hand = body.posed(_half_way(body, gripper)), body.frame(gripper.hand)[0]
        origin = body.pose(hand, data)[0]
        ends = {tip: _to_base(body, tip, body.shapes.points(tip), data) - origin for tip in found}
        reach = {tip: float(np.linalg.norm(points, axis=1).max()) for tip, points in ends.items()}
        far = [tip for tip in found if reach[tip] >= FAR * max(reach.values())]
        found = far if len(far) >= 2 else found
    return found


def _named(name: str, body: RobotBody, link: str) -> str:
    return name if link == body.base else f"{name}_{link}"
