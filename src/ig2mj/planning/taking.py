"""How a hand comes to a grasp from where the robot stands, and closes there."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.grasps import GraspPose
from ig2mj.planning.moves import (
    CLOSING,
    COMING,
    GRIPPING,
    NEAR,
    THIN,
    TOUCHING,
    UP,
    Program,
    goes_on,
    hand_path,
    towards,
    travel,
    vector3,
)
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.world import PlannedWorld, Vector

STRAIGHT, TURNED = 0.006, 0.06
"""m and rad within which a gripper is before a grasp, when it goes on to it: its fingers are little wider apart than
what they close on."""

SWEEPING = 0.1
"""Share of its way by which a hand closes in an agent step that sweeps something towards its palm: at once, the fingers
would knock it away."""


GENTLY = 0.2
"""The same of a floating hand that takes hold of something. What is held meets its fingers no longer: at once, they
would close through thin sides, and catch on them, or throw the thing, when they open."""


def closing_on(
    world: PlannedWorld,
    name: str,
    hand: int,
    pose: GraspPose,
    way: Sequence[Vector],
    attempt: int = 0,
    slowly: bool = False,
) -> Program:
    """The hand goes along a way to before a grasp, on until it touches the object, and closes until it holds it.

    Args:
      attempt: number of the try. A floating hand closes at once on what is thin, and gently on other things; in odd
        tries the other way. slowly: a floating hand comes as slowly as to what is thin, and closes where it touches:
        else it pushes over what stands.
    """
    index, quat = world.index(name), world.body.turned(hand, pose.fingers, pose.palm)
    deep, floats = vector3(pose.at(-pose.deep)), world.body.opening is None
    thin = floats and float(np.ptp(world.vertices(name) @ pose.palm)) < THIN
    gently = floats and thin == bool(attempt % 2)
    slow = thin or slowly
    near = Phase(
        hand=hand,
        pos=vector3(pose.at(min(NEAR, pose.before))),
        quat=quat,
        tolerance=0.01,
        limit=12,
        after="",
        speed=COMING,
    )
    before = dataclasses.replace(near, pos=vector3(way[-1]), tolerance=STRAIGHT, turn_tolerance=TURNED)
    if pose.sweeps:
        return [
            *travel(hand, way, quat),
            Phase(hand=hand, pos=deep, quat=quat, tolerance=0.004, limit=25, after="", speed=TOUCHING),
            Phase(hand=hand, pos=deep, quat=quat, until=Until.HELD, object=index, close=True, closes=SWEEPING,
                  limit=int(2 / SWEEPING), after="no_grasp", speed=CLOSING),
        ]  # fmt: skip
    return [
        *travel(hand, way, quat),
        *([near] if slow else []),
        *([] if floats else [before]),
        Phase(hand=hand, pos=deep, quat=quat, until=Until.TOUCHED, object=index, close=False, limit=25, after="",
              speed=TOUCHING if slow else COMING),
        Phase(hand=hand, pos=None if slowly else deep, quat=quat, until=Until.HELD, object=index, close=True, limit=15,
              after="no_grasp", closes=GENTLY if gently else 1.0, speed=CLOSING if floats else GRIPPING),
    ]  # fmt: skip


def way_to(
    world: PlannedWorld, name: str, hand: int, pose: GraspPose, obstacles: Obstacles | None = None
) -> list[Vector] | None:
    """The hand's way to before a grasp, from where the robot stands; None: there is none.

    Args:
      obstacles: None: everything but the object.
    """
    obstacles, spheres = obstacles or world.obstacles([name]), spheres_of(world, pose)
    follows = world.follows(hand, world.body.turned(hand, pose.fingers, pose.palm), obstacles)
    back = entries(pose, world.base[0])
    way = hand_path(obstacles, spheres, world.grip(hand), pose.at(pose.before), back, search=True, follows=follows)
    return way if goes_on(way, pose.at(0.0), follows, strays=True) else None


def spheres_of(world: PlannedWorld, pose: GraspPose) -> Float[np.ndarray, "S 4"]:
    """What keeps clear about the grasp point of a hand on its way to a pose, m."""
    return world.spheres(pose.fingers, pose.palm) * (1.0, 1.0, 1.0, pose.room)


def entries(pose: GraspPose, xy: Sequence[float] | np.ndarray) -> list[Vector]:
    """Directions from which a hand of a robot that stands at `xy` may come to a grasp: back to the robot, off the
    object's side, up."""
    return [-towards(xy, pose.point), -pose.palm, UP]
