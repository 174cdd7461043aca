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
from collections.abc import Callable, Generator, Iterator, Sequence

import mujoco
import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_about, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.clearance import straight
from ig2mj.planning.driving import shift
from ig2mj.planning.grasping import grasp, is_graspable, release
from ig2mj.planning.grasps import GraspPose
from ig2mj.planning.hanging_open import hung_open, sinking_flap
from ig2mj.planning.joints import OPEN_TO, OpenableJoint
from ig2mj.planning.moves import LET_GO, OPENS, RETREAT, TOUCHES, UP, Primitive, Program, ahead, vector3
from ig2mj.planning.occupancy import RESOLUTION
from ig2mj.planning.opening import joints_of, set_open, withdraw
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.placing import place
from ig2mj.planning.steadying import is_thrown_over
from ig2mj.planning.steps import Step
from ig2mj.planning.world import BODY_SPARE, PlannedWorld, Rotation, Stance, Vector

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

STOOD = 0.97
"""Cosine of the angle of a container's own vertical up to which it stands."""

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

BACK = (0.0, 0.15, 0.3, 0.45, 0.6)
"""m by which the base goes back, so that it is not in the way of what is turned over."""

HIGHER = (0.0, 0.2, 0.4)
"""m by which it is turned over higher above where it stood, past what stands next to it."""

OFFSETS = sorted(itertools.product((0.0, 0.15, 0.3), (0.0, 0.15, -0.15, 0.3, -0.3)), key=lambda o: np.hypot(*o))
"""m ahead and to the side of where something is carried, at which it may be turned over."""


def opens(world: PlannedWorld, step: Step) -> Primitive:
    """The primitive that opens: what opens when it is turned over is turned over, a box that a gripper takes is held so
    that its flap sinks open, all else is opened by `set_open`."""
    name = step.object
    if world.body.opening is not None and not world.facts.holds("open", name) and sinking_flap(world, name) is not None:
        yield from hung_open(world, name)
    yield from _with_empty_hands(world, name)
    for _ in range(TURNS if world.body.opening is None else 0):
        if world.facts.holds("open", name) or falling_flap(world, name) is None:
            break
        yield from turned_open(world, name)
    return (yield from set_open(True)(world, step))


def closes(world: PlannedWorld, step: Step) -> Primitive:
    """The primitive that closes."""
    yield from _with_empty_hands(world, step.object)
    return (yield from set_open(False)(world, step))


def _with_empty_hands(world: PlannedWorld, name: str) -> Generator[Program, str, None]:
    """Puts down what hands hold where both are needed: one holds the container, and the other moves its lid."""
    for other in dict.fromkeys(n for n in world.held if n and n != name) if is_thrown_over(world, name) else ():
        yield from release(world, Step("release", (other,)))


def _stood(world: PlannedWorld, name: str) -> tuple[Vector, Rotation] | None:
    """Position and orientation of an object that stands; None: it does not."""
    pos, quat = world.pose(name)
    frame = matrices_on_host(quat[None])[0]
    return (pos, frame) if frame[2, 2] > STOOD else None


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
    as it takes two hands, or something is in it."""
    if world.domain.fixed(name) or world.domain.hands_for(name) > 1 or not is_graspable(world, name):
        return None
    joints = [j for j in joints_of(world, name) if j.hinge]
    if len(joints) != 1 or _has_content(world, name):
        return None
    joint, model = joints[0], world.stage.scene.model
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint.name)
    body, sign = int(model.jnt_bodyid[number]), np.sign(joint.open - joint.closed)
    weight = float(model.body_mass[body]) * float(np.linalg.norm(model.opt.gravity))
    centre = turn_about(model.jnt_axis[number], -float(model.qpos0[model.jnt_qposadr[number]]) + joint.closed)
    axis, arm = sign * model.jnt_axis[number], centre @ (model.body_ipos[body] - model.jnt_pos[number])
    arm = arm - (arm @ axis) * axis
    friction = float(model.dof_frictionloss[model.jnt_dofadr[number]])
    torque = weight * float(np.linalg.norm(arm))
    if friction > FALLS * torque or abs(float(axis @ UP)) > LEVEL:
        return None
    shut = np.arctan2(arm @ UP, arm @ np.cross(UP, axis))
    to = min(np.pi / 2, shut + OPEN_TO * abs(joint.open - joint.closed)) - ONWARD
    return Flap(joint, float(1.5 * np.pi - to - np.arcsin(friction / torque)))


def _has_content(world: PlannedWorld, name: str) -> bool:
    """Whether something loose is in the box about a container: what lies in one that has fallen over may not count as
    inside."""
    low, high = world.facts.box(name)
    others = (other for other in world.domain.loose if other not in (name, *world.held))
    return any((low <= (at := world.com(other))).all() and (at <= high).all() for other in others)


def turned_open(world: PlannedWorld, name: str) -> Generator[Program, str, None]:
    """Takes a container, turns it over and back, and puts it down where it stood, or else there: while a base turns,
    its flap would swing."""
    flap, home = falling_flap(world, name), None
    if flap is None or (name not in world.held and all(world.held)):
        return
    if name not in world.held:
        home = _stood(world, name)
        by_side = functools.partial(_is_by_side, world, name, flap.joint.axis)
        if not (yield from grasp(world, Step("grasp", (name,)), by_side)).done:
            return
    hand, flap = world.held.index(name), falling_flap(world, name)
    program = None if flap is None else _turning(world, name, hand, flap, home)
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


def _turning(
    world: PlannedWorld, name: str, hand: int, flap: Flap, home: tuple[Vector, Rotation] | None
) -> Program | None:
    """The program in which a hand turns what it holds over and back, and puts it down; None: it has no room.

    Args:
      home: position and orientation of the object where it stood; None: it did not.
    """
    (own, quat), grip, joint = world.pose(name), world.grip(hand), flap.joint
    frame, sign = matrices_on_host(quat[None])[0], np.sign(joint.open - joint.closed)
    axis = sign * frame.T @ joint.axis
    swung = joint.moved(joint.vertices, joint.closed + OPEN_TO * (joint.open - joint.closed) - joint.now)
    points = np.concatenate([world.points(name), swung]) - grip
    far, stance = float(np.linalg.norm(points, axis=1).max()), world.stance
    radius, obstacles = np.full((len(points), 1), TOUCHES * BODY_SPARE), world.obstacles([name])

    def plan(upright: Rotation, end: Callable[[Rotation], Iterator[tuple[Stance, Vector, Vector]]]) -> Program | None:
        """With the container turned from upright, at the first places with room, of those from where and where it is
        turned, and where it is let go (given the rotation from now to the last orientation)."""
        rotations = [r @ frame.T for r in turns(upright, axis, flap.turn)]
        turned = [np.concatenate([points @ r.T, radius], axis=1) for r in rotations]
        for at, point, there in end(rotations[-1]):
            around = obstacles.about(at.xy, *world.body.trunk)
            free = all(around.clear(some + np.array([*point, 0.0])) for some in turned)
            if free and straight(around, turned[-1], point, there, LET_GO):
                goes = [shift(at, keeps=world.index(name))] if at is not stance else []
                return [*goes, *_program(world, name, hand, point, there, rotations)]
        return None

    def above_home(last: Rotation) -> Iterator[tuple[Stance, Vector, Vector]]:
        assert home is not None
        there, floor = home[0] + last @ (grip - own) + LET_GO * UP, world.floor()
        for back, more in itertools.product(BACK, HIGHER):
            x, y = np.array(stance.xy) - back * ahead(stance.yaw)[:2]
            at = dataclasses.replace(stance, xy=(float(x), float(y))) if back > 0.0 else stance
            point = np.array([*there[:2], float(home[0][2]) + far + ABOVE_FLOOR + more])
            stands = back == 0.0 or floor.nearest(at.xy, RESOLUTION) is not None
            if stands and world.reaches(hand, at, point) and world.reaches(hand, at, there):
                yield at, point, there

    def in_front(last: Rotation) -> Iterator[tuple[Stance, Vector, Vector]]:
        low = float(((world.vertices(name) - grip) @ last.T)[:, 2].min())
        x, y = world.body.trunk[0] + BODY_SPARE + far, float(world.body.carry[hand][1])
        for more, aside in OFFSETS:
            point = world.from_body(np.zeros(3)) + about_vertical(world.stance.yaw) @ (x + more, y + aside, 0.0)
            floor = obstacles.below(point[:2], float(point[2]), range(len(world.domain.model.tables.object_names)))
            point[2] = max(floor + far + ABOVE_FLOOR, float(grip[2]))
            yield stance, point, np.array([*point[:2], floor - low + LET_GO])

    program = None
    if home is not None:
        program = plan(home[1] @ turns(np.eye(3), axis, flap.turn)[-1].T, above_home)
    return program or plan(turn_onto(frame[:, 2], UP) @ frame, in_front)


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
    stands = dataclasses.replace(program[-2], turn_tolerance=UPRIGHT, limit=60)
    return [
        *program,
        dataclasses.replace(stands, pos=vector3(there), tolerance=0.03),
        dataclasses.replace(stands, pos=vector3(there), tolerance=0.015, limit=20, speed=0.03),
        Phase(hand=hand, close=False, until=Until.EMPTY, limit=10),
        Phase(hand=hand, close=False, until=Until.WAITED, limit=OPENS),
        Phase(hand=hand, pos=vector3(there - RETREAT * palm), tolerance=0.03, limit=20, after="", speed=SLOW),
    ]


def turns(upright: Rotation, axis: Vector, turn: float) -> list[Rotation]:
    """Orientations one after another of a container that is turned from upright about a level axis of its own frame,
    then onto its side, and from there up."""
    over = [upright @ turn_about(axis, (turn - 2 * np.pi) * share) for share in np.linspace(0.0, 1.0, PARTS + 1)]
    down = over[-1].T @ -UP  # in the container's frame
    side = np.cross(down, axis)
    half = np.pi / 2 * np.array([0.5, 1.0])
    onto = [over[-1] @ turn_about(side, -angle) for angle in half]
    return [*over, *onto, *(onto[-1] @ turn_about(np.cross(axis, -UP), -angle) for angle in half)]
