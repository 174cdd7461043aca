"""A hand of the humanoid: a palm that floats, pulled with 300 N, and five fingers of two joints each."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np

from ig2mj.agents.humanoid.frames import (
    FINGER_CLOSED,
    FINGERS,
    SEGMENTS,
    THUMB_CLOSED,
    mirrored,
)
from ig2mj.agents.parts import GEOM, add_pulled_joints, collision, normalized, servo, set_inertia, visual

HAND_FORCE = 300.0
"""N, and N m for turning, of each axis (paper, appendix A.1)."""

HAND_LIFTS = 0.85 * HAND_FORCE / 9.81
"""kg that a hand lifts and carries: the rest of its force is for its own weight and for speeding up."""

FINGER_TORQUE = 3.0
"""N m of each finger joint."""

FRICTION = 2.5
"""Sliding friction of palm and fingers."""

PALM_MASS, LINK_MASS = 1.1, 0.1
"""kg: iGibson's base (1) and palm (0.1), here one body; each finger link."""

HAND_MASS = PALM_MASS + 2 * len(FINGERS) * LINK_MASS

TURN_INERTIA = 0.1
"""kg m^2 added to the hand's turning, as of a forearm: a servo of 300 N m cannot hold a lone hand of 3 g m^2 at
1/120 s."""

FINGER_ARMATURE, FINGER_RATE = 0.002, 35.0
"""kg m^2 and 1/s: inertia and natural frequency of a finger's servo."""

PALM_INERTIA = (0.002, 0.0, 0.0, 0.002, 0.0, 0.002)
"""kg m^2 about its centre of mass."""

PALM_HALF, PALM_AT = (0.040, 0.045, 0.012), (0.0, -0.040, -0.004)
"""m: half size and centre of the palm, right hand."""

RADIUS = (0.0100, 0.0092)
"""m: of proximal and outer links."""

PROXIMAL_LENGTH, OUTER = 0.040, (0.0, -0.048, 0.016)
"""m: a proximal link; the line of an outer one, whose end with its radius is the tip of `frames.TIP`."""

KNUCKLES = {
    "index": (-0.030, -0.084, -0.004),
    "middle": (-0.010, -0.088, -0.004),
    "ring": (0.010, -0.086, -0.004),
    "pinky": (0.030, -0.080, -0.004),
}
LENGTHS = {"index": 1.0, "middle": 1.1, "ring": 1.03, "pinky": 0.85}
"""Where fingers begin, m, right hand; how long their proximal links are, relative to `PROXIMAL_LENGTH`."""

THUMB_ROOT, THUMB_ALONG, THUMB_CLOSES_TO = (-0.036, -0.022, 0.0), (-0.60, -0.75, 0.28), (0.25, -0.62, 0.74)
"""m and directions, right hand: the thumb when open, and where it points when both its joints have turned."""


@dataclasses.dataclass(frozen=True)
class HandParts:
    """Names: the palm's body, links (proximal and outer of thumb, index, middle, ring, pinky), their joints."""

    palm: str
    links: tuple[str, ...]
    joints: tuple[str, ...]


def add_hand(
    spec: mujoco.MjSpec,
    name: str,
    hand: int,
    pos: np.ndarray,
    quat: np.ndarray,
    skin: str,
    joint: str,
) -> HandParts:
    """Adds a hand to the world, with 16 actuators: six of the palm (`add_pulled_joints`), then the fingers' positions.

    Args:
      name: of the palm's body; prefix of all others.
      hand: 0 left, 1 right.
      pos, quat: of the hand frame in the world.
      skin, joint: materials.
    """
    palm = spec.worldbody.add_body(name=name, pos=list(pos), quat=list(quat))
    add_pulled_joints(spec, palm, HAND_MASS, TURN_INERTIA, HAND_FORCE)
    centre = mirrored(hand, PALM_AT)
    collision(palm, GEOM.mjGEOM_BOX, PALM_HALF, 0.0, centre, friction=FRICTION)
    _draw_palm(palm, hand, centre, skin, joint)

    unit = np.rad2deg(1.0) if spec.compiler.degree else 1.0  # MjSpec takes ranges in the compiler's unit
    links, joints, moment, origin = [], [], np.zeros(3), np.zeros(3)
    for finger in FINGERS:
        thumb = finger == "thumb"
        closed = THUMB_CLOSED if thumb else FINGER_CLOSED
        for place, axis, end, (segment, radius) in zip(
            *_line(finger, hand), zip(SEGMENTS, RADIUS, strict=True), strict=True
        ):
            parent = spec.body(links[-1]) if segment == "middle" else palm
            link = parent.add_body(name=f"{name}_{finger}_{segment}", pos=list(place))
            hinge = f"{link.name}_joint"
            link.add_joint(
                name=hinge,
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=list(axis),
                range=[-0.05 * unit, (closed + 0.05) * unit],
                limited=mujoco.mjtLimited.mjLIMITED_TRUE,
                armature=FINGER_ARMATURE,
            )
            stiffness, damping = FINGER_ARMATURE * FINGER_RATE**2, 2 * FINGER_ARMATURE * FINGER_RATE
            servo(spec, hinge, stiffness, damping, FINGER_TORQUE, name=link.name)
            collision(link, GEOM.mjGEOM_CAPSULE, (radius,), LINK_MASS, end=end, friction=FRICTION)
            visual(link, GEOM.mjGEOM_CAPSULE, (radius,), skin, end=end)
            visual(link, GEOM.mjGEOM_SPHERE, (radius * 1.12,), joint)
            origin = np.asarray(place) if segment == "proximal" else origin + np.asarray(place)
            moment += LINK_MASS * (origin + 0.5 * np.asarray(end))
            links.append(link.name)
            joints.append(hinge)
    # The palm's own mass lies behind the wrist, as a forearm's does, so that the open hand is in balance there.
    set_inertia(palm, PALM_MASS, -moment / PALM_MASS, PALM_INERTIA)
    return HandParts(name, tuple(links), tuple(joints))


def _line(finger: str, hand: int) -> tuple[list, list, list]:
    """Of both links of a finger: origin in the parent's frame, hinge axis, end of the link's line."""
    if finger == "thumb":
        along, inward = normalized(THUMB_ALONG), normalized(THUMB_CLOSES_TO)
        axis = normalized(np.cross(along, inward))
        root, first, outer = np.array(THUMB_ROOT), along * 0.040, along * 0.038
    else:
        axis, root = np.array([-1.0, 0.0, 0.0]), np.array(KNUCKLES[finger])
        first, outer = np.array([0.0, -PROXIMAL_LENGTH * LENGTHS[finger], 0.0]), np.array(OUTER)
    turned = axis * ((1.0, 1.0, 1.0) if hand == 1 else (-1.0, 1.0, -1.0))  # a mirror in y turns the other way
    root, first, outer = (mirrored(hand, v) for v in (root, first, outer))
    return [root, first], [turned, turned], [first, outer]


def _draw_palm(palm: mujoco.MjsBody, hand: int, centre: np.ndarray, skin: str, joint: str) -> None:
    """A rounded back of the hand, a darker pad, and a wrist."""
    x, y, z = PALM_HALF
    visual(palm, GEOM.mjGEOM_ELLIPSOID, (x * 1.12, y * 1.14, z * 1.5), skin, centre)
    visual(palm, GEOM.mjGEOM_ELLIPSOID, (x * 0.80, y * 0.85, z * 0.8), joint, centre + np.array((0.0, 0.0, 0.008)))
    visual(
        palm,
        GEOM.mjGEOM_CAPSULE,
        (0.021,),
        joint,
        mirrored(hand, (0.0, 0.004, -0.004)),
        end=mirrored(hand, (0.0, 0.028, -0.004)),
    )
    visual(
        palm,
        GEOM.mjGEOM_CYLINDER,
        (0.027,),
        skin,
        mirrored(hand, (0.0, 0.030, -0.004)),
        end=mirrored(hand, (0.0, 0.062, -0.004)),
    )
    for finger, knuckle in KNUCKLES.items():
        start = mirrored(hand, np.array(knuckle) * (0.75, 0.45, 1.0))
        visual(
            palm,
            GEOM.mjGEOM_CAPSULE,
            (0.0125 if finger != "pinky" else 0.0115,),
            skin,
            start,
            end=mirrored(hand, knuckle),
        )
    visual(
        palm,
        GEOM.mjGEOM_CAPSULE,
        (0.0135,),
        skin,
        mirrored(hand, (-0.015, -0.018, 0.0)),
        end=mirrored(hand, THUMB_ROOT),
    )
