"""Opening bags and other loose containers by turning them over: their flap falls open by its own weight.

A hand that lifts the flap of a light bag with its fingers pushes the bag along until it falls over, and takes hold of
no flap. A bag that is held head down opens until the friction of its hinge holds the flap. It is turned just as far as
brings the flap up over its hinge, and back over a side, where gravity does not turn the flap: wide open, a flap as
heavy as its bag would make that fall over, and one that leans forward falls shut.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Generator, Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.clearance import straight
from ig2mj.planning.grasping import grasp, is_graspable
from ig2mj.planning.grasps import GraspPose
from ig2mj.planning.joints import OPEN_TO, OpenableJoint
from ig2mj.planning.moves import LET_GO, OPENS, RETREAT, TOUCHES, UP, Primitive, Program, vector3
from ig2mj.planning.opening import joints_of, set_open, withdraw
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.placing import place
from ig2mj.planning.steps import Step
from ig2mj.planning.world import BODY_SPARE, PlannedWorld, Rotation, Vector

TURNS = 2
"""Times that a container is turned over."""

PARTS = 5
"""Turns one after another in which a container is turned head down; four more take it onto its side, and up."""

ONWARD = 0.2
"""rad by which a flap goes on in the jerks of the turns after it has fallen open."""

LEVEL = 0.2
"""Sine of the angle of a hinge with the horizontal up to which it is level."""

FALLS = 0.8
"""Share of the torque of a flap's weight that the friction of its hinge may be, so that it falls."""

SIDE = 0.9
"""Cosine of the angle between a palm and a hinge up to which the palm is at an end of the hinge."""

SLOW = 0.04
"""m in an agent step of a hand that goes off what it has let go."""

UPRIGHT = 0.05
"""rad from upright at which it is let go."""

HANGS = 8
"""Agent steps in which a flap falls open."""

ABOVE_FLOOR = 0.1
"""m above the floor that is left below what is turned over."""

OFFSETS = sorted(itertools.product((0.0, 0.15, 0.3), (0.0, 0.15, -0.15, 0.3, -0.3)), key=lambda o: np.hypot(*o))
"""m ahead and to the side of where something is carried, at which it may be turned over."""


def opens(world: PlannedWorld, step: Step) -> Primitive:
    """The primitive that opens: what opens when it is turned over is turned over, all else is opened by `set_open`."""
    name = step.object
    for _ in range(TURNS if world.body.opening is None else 0):
        if world.facts.holds("open", name) or falling_flap(world, name) is None:
            break
        yield from turned_open(world, name)
    return (yield from set_open(True)(world, step))


@dataclasses.dataclass(frozen=True, eq=False)
class Flap:
    """A flap that falls open when its container is turned over.

    Attributes:
      joint: its hinge. turn: rad about the hinge, in the direction in which it opens, by which the container is turned
        from upright, so that the flap falls to where it is to be.
    """

    joint: OpenableJoint
    turn: float


def falling_flap(world: PlannedWorld, name: str) -> Flap | None:
    """The flap of a container that falls open when that is turned over; None: it has none, or is not to be turned over,
    as nobody lifts it with one hand, or something is in it."""
    if world.domain.fixed(name) or world.domain.hands_for(name) > 1 or not is_graspable(world, name):
        return None
    joints = [j for j in joints_of(world, name) if j.hinge]
    if len(joints) != 1 or world.facts.things_in(name):
        return None
    joint, model = joints[0], world.stage.scene.model
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint.name)
    body, sign = int(model.jnt_bodyid[number]), np.sign(joint.open - joint.closed)
    weight = float(model.body_mass[body]) * float(np.linalg.norm(model.opt.gravity))
    centre = _about(model.jnt_axis[number], -float(model.qpos0[model.jnt_qposadr[number]]) + joint.closed)
    axis, arm = sign * model.jnt_axis[number], centre @ (model.body_ipos[body] - model.jnt_pos[number])
    arm = arm - (arm @ axis) * axis
    friction = float(model.dof_frictionloss[model.jnt_dofadr[number]])
    torque = weight * float(np.linalg.norm(arm))
    if friction > FALLS * torque or abs(float(axis @ UP)) > LEVEL:
        return None
    shut = np.arctan2(arm @ UP, arm @ np.cross(UP, axis))
    to = min(np.pi / 2, shut + OPEN_TO * abs(joint.open - joint.closed)) - ONWARD
    return Flap(joint, float(1.5 * np.pi - to - np.arcsin(friction / torque)))


def turned_open(world: PlannedWorld, name: str) -> Generator[Program, str, None]:
    """Takes a container, turns it over and back, and puts it down there: on a way, its flap would swing."""
    flap = falling_flap(world, name)
    if flap is None or (name not in world.held and all(world.held)):
        return
    if name not in world.held:
        by_side = functools.partial(_is_by_side, world, name, flap.joint.axis)
        if not (yield from grasp(world, Step("grasp", (name,)), by_side)).done:
            return
    hand, flap = world.held.index(name), falling_flap(world, name)
    program = None if flap is None else _turning(world, name, hand, flap)
    if program is None:  # it is taken to where there is more room
        yield from place("on_floor")(world, Step("place_on_floor", (name, world.facts.room(name))))
        return
    yield program
    if name not in world.held:
        yield withdraw(world, hand)


def _is_by_side(world: PlannedWorld, name: str, axis: Vector, pose: GraspPose) -> float:
    """1 for a pose at an end of the hinge, in the upper half of a container that would stand: there a hand is in the
    way neither of the flap nor of what bears the container."""
    frame, corners = matrices_on_host(world.pose(name)[1][None])[0][:, 2], world.vertices(name)
    along = corners @ frame
    return float(abs(float(pose.palm @ axis)) > SIDE and float(pose.point @ frame) > (along.min() + along.max()) / 2)


def _turning(world: PlannedWorld, name: str, hand: int, flap: Flap) -> Program | None:
    """The program in which a hand turns what it holds over and back, and puts it down; None: it has no room."""
    frame, grip = matrices_on_host(world.pose(name)[1][None])[0], world.grip(hand)
    joint, sign = flap.joint, np.sign(flap.joint.open - flap.joint.closed)
    rotations = [r @ frame.T for r in turns(turn_onto(frame[:, 2], UP) @ frame, sign * frame.T @ joint.axis, flap.turn)]
    swung = joint.moved(joint.vertices, joint.closed + OPEN_TO * (joint.open - joint.closed) - joint.now)
    points = np.concatenate([world.points(name), swung]) - grip
    spheres = np.column_stack([points, np.full(len(points), TOUCHES * BODY_SPARE)])
    far, obstacles = float(np.linalg.norm(points, axis=1).max()), world.obstacles([name], world.stance)
    turned = [np.column_stack([spheres[:, :3] @ r.T, spheres[:, 3]]) for r in rotations]
    low = float(((world.vertices(name) - grip) @ rotations[-1].T)[:, 2].min())
    x, y = world.body.trunk[0] + BODY_SPARE + far, float(world.body.carry[hand][1])
    every = range(len(world.domain.model.tables.object_names))
    for ahead, aside in OFFSETS:
        point = world.from_body(np.zeros(3)) + about_vertical(world.stance.yaw) @ (x + ahead, y + aside, 0.0)
        floor = obstacles.below(point[:2], float(point[2]), every)
        point[2] = max(floor + far + ABOVE_FLOOR, float(grip[2]))
        there = np.array([*point[:2], floor - low + LET_GO])
        free = all(obstacles.clear(some + np.array([*point, 0.0])) for some in turned)
        if free and straight(obstacles, turned[-1], point, there):
            return _program(world, name, hand, point, there, rotations)
    return None


def _program(
    world: PlannedWorld, name: str, hand: int, point: Vector, there: Vector, rotations: Sequence[Rotation]
) -> Program:
    """A hand goes to a point, turns what it holds by rotations one after another, and lets it go at another place."""
    at, keeps = vector3(point), world.index(name)
    program = [Phase(hand=hand, pos=at, keeps=keeps, tolerance=0.05, limit=40, after="")]
    for rotation in rotations:
        quat = world.turned_hand(hand, rotation)
        program += [
            Phase(hand=hand, pos=at, quat=quat, keeps=keeps, tolerance=0.08, turn_tolerance=0.2, limit=40, after=""),
            Phase(hand=hand, until=Until.WAITED, keeps=keeps, limit=HANGS),
        ]
    palm = world.hand_axes(hand, rotations[-1])[1]
    down = Phase(hand=hand, pos=vector3(there), quat=program[-2].quat, keeps=keeps, turn_tolerance=UPRIGHT, after="")
    return [
        *program,
        dataclasses.replace(down, limit=60),
        dataclasses.replace(down, tolerance=0.015, limit=20, speed=0.03),
        Phase(hand=hand, close=False, until=Until.EMPTY, limit=10),
        Phase(hand=hand, close=False, until=Until.WAITED, limit=OPENS),
        Phase(hand=hand, pos=vector3(there - RETREAT * palm), tolerance=0.03, limit=20, after="", speed=SLOW),
    ]


def turns(upright: Rotation, axis: Vector, turn: float) -> list[Rotation]:
    """Orientations one after another of a container that is turned from upright about a level axis of its own frame,
    then onto its side, and from there up."""
    over = [upright @ _about(axis, (turn - 2 * np.pi) * share) for share in np.linspace(0.0, 1.0, PARTS + 1)]
    down = over[-1].T @ -UP  # in the container's frame
    side = np.cross(down, axis)
    half = np.pi / 2 * np.array([0.5, 1.0])
    onto = [over[-1] @ _about(side, -angle) for angle in half]
    return [*over, *onto, *(onto[-1] @ _about(np.cross(axis, -UP), -angle) for angle in half)]


def _about(axis: Float[np.ndarray, "3"], angle: float) -> Rotation:
    """Matrix of a rotation about a unit vector."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
