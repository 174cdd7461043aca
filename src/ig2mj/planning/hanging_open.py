"""Opening loose boxes with a gripper on an arm, which finds nothing to hook below a flap that is flush with its box: it
takes the box and holds it turned so that the flap sinks open by its own weight, until it is past upright, from where it
does not fall shut when the box stands again.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Generator, Iterator, Sequence

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical, turn_about, turn_onto
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.driving import FAR_BACK_STEPS, shift
from ig2mj.planning.grasping import grasp, is_graspable, lowered, release
from ig2mj.planning.joints import OPEN_TO, OpenableJoint
from ig2mj.planning.moves import TOUCHES, UP, Program, ahead, vector3
from ig2mj.planning.occupancy import RESOLUTION
from ig2mj.planning.opening import joints_of
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.placing import place
from ig2mj.planning.stances import clear_with_held
from ig2mj.planning.steps import Step
from ig2mj.planning.world import HELD_MARGIN, PlannedWorld, Rotation, Vector

TILTS, DIRECTIONS = (np.pi / 2, 0.75 * np.pi, np.pi), 8
"""rad by which a box is turned from how it is held, and horizontal axes about which."""

SINKS = 0.2
"""Share of the torque of a level flap's weight that opens it, at least, on its way."""

OFFSETS = tuple(itertools.product((0.0, 0.15), (0.0, 0.2, -0.2), (0.0, 0.15, -0.15)))
"""m ahead, to the side and up from where a box is carried at which it is turned."""

BACK, SPACING = np.arange(0.1, 1.25, 0.1), 0.1
"""m that the base goes back to where there is room for the turns, and m between the points at which it is looked
whether there is room."""

DROP = 0.15
"""m that a box may fall when it is let go: from higher, it falls over."""

TURNING, TURNED = 100, 0.15
"""Agent steps of a turn, at most, and rad within which it is done."""

LOOK, LOOKS, CREEPS = 20, 25, 0.002
"""Agent steps between looks at a flap that sinks, and looks; share of its range by which it sinks in between at least.
"""


def sinking_flap(world: PlannedWorld, name: str) -> OpenableJoint | None:
    """The flap of a box that a hand takes and that nothing is in; None: it has none."""
    if world.domain.fixed(name) or world.domain.hands_for(name) > 1 or not is_graspable(world, name):
        return None
    flaps = [j for j in joints_of(world, name) if j.hinge]
    return None if not flaps or world.facts.things_in(name) else flaps[0]


def hung_open(world: PlannedWorld, name: str) -> Generator[Program, str, None]:
    """Takes a box, holds it so that its flap sinks open, and puts it down."""
    if name not in world.held and (all(world.held) or not (yield from grasp(world, Step("grasp", (name,)))).done):
        return
    hand, index = world.held.index(name), world.index(name)
    yield from _where_there_is_room(world, name, hand)
    if name not in world.held:
        return
    if (found := _hanging(world, name, hand)) is not None:
        turns = _turned(world, hand, index, *found)
        held = dataclasses.replace(turns, until=Until.WAITED, limit=LOOK)
        lost = yield [turns]
        before = -1.0
        for _ in range(LOOKS):
            flap = sinking_flap(world, name)
            if lost or flap is None or flap.fraction > OPEN_TO or flap.fraction - before < CREEPS:
                break
            before = flap.fraction
            lost = yield [held]
    if name in world.held and (stands := _standing(world, name, hand)) is not None:
        yield [_turned(world, hand, index, *stands)]
    if name in world.held and _drop(world, name, hand) > DROP:
        room = world.facts.room(name)
        yield from place("on_floor", turns_over=False)(world, Step("place_on_floor", (name, room)))
    if name in world.held:
        yield from release(world, Step("release", (name,)))


def _where_there_is_room(world: PlannedWorld, name: str, hand: int) -> Generator[Program, str, None]:
    """The base goes straight back to where what a hand carries has room all around and down to the floor, or the most:
    on its turns it comes to where it is neither before nor after them, and it is let down there."""
    floor, now, obstacles = world.floor(), world.stance, world.obstacles([name])
    grip, far = world.carried(hand, now), float(np.linalg.norm(world.points(name) - world.grip(hand), axis=1).max())
    behind = [now]
    for apart in BACK:
        x, y = np.array(now.xy) - apart * ahead(now.yaw)[:2]
        there = dataclasses.replace(now, xy=(float(x), float(y)))
        if floor.nearest(there.xy, RESOLUTION) is None or not clear_with_held(world, [there], TOUCHES):
            break
        behind.append(there)
    off = [np.array([*np.subtract(there.xy, now.xy), 0.0]) for there in behind]
    best = behind[int(np.argmax([_points_with_room(obstacles, grip + o, far) for o in off]))]
    if best is not now:
        yield [shift(best, keeps=world.index(name), within=FAR_BACK_STEPS)]


def _points_with_room(obstacles: Obstacles, grip: Vector, far: float) -> int:
    """How many points have room within `far` (m) of the upright line from above a hand's grasp point to the floor."""
    level, heights = np.arange(-far, far + SPACING / 2, SPACING), np.arange(SPACING, grip[2] + far, SPACING)
    x, y, z = np.stack(np.meshgrid(level, level, heights), axis=-1).reshape(-1, 3).T
    around = np.column_stack([x + grip[0], y + grip[1], z])[np.hypot(x, y) <= far]
    return int(np.sum(obstacles.distance(around) > HELD_MARGIN))


def _drop(world: PlannedWorld, name: str, hand: int) -> float:
    """m that what a hand holds would fall if it were lowered straight and let go."""
    down = lowered(world, name, hand)
    end = world.grip(hand) if not down or down[-1].pos is None else np.array(down[-1].pos)
    return float(world.vertices(name)[:, 2].min() - (world.grip(hand) - end)[2])


def _turned(world: PlannedWorld, hand: int, keeps: int, point: Vector, rotation: Rotation) -> Phase:
    """The hand goes to a point, and is turned by a rotation from how it is now."""
    return Phase(hand=hand, pos=vector3(point), quat=world.turned_hand(hand, rotation), keeps=keeps, tolerance=0.05,
                 turn_tolerance=TURNED, limit=TURNING, after="")  # fmt: skip


def _hanging(world: PlannedWorld, name: str, hand: int) -> tuple[Vector, Rotation] | None:
    """Where a hand holds a box, and the rotation by which it is turned there, so that its flap sinks; None: there is no
    such pose with room that the arm reaches."""
    flap = sinking_flap(world, name)
    if flap is None:
        return None
    rotations = [r for r in _rotations() if sinks(flap, r) >= SINKS]
    return _held_so(world, name, hand, flap, sorted(rotations, key=lambda r: -sinks(flap, r)))


def _standing(world: PlannedWorld, name: str, hand: int) -> tuple[Vector, Rotation] | None:
    """The same so that the box is upright."""
    frame = matrices_on_host(world.pose(name)[1][None])[0]
    turns = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    rotations = [about_vertical(float(turn)) @ turn_onto(frame[:, 2], UP) for turn in turns]
    return _held_so(world, name, hand, sinking_flap(world, name), rotations)


def _held_so(
    world: PlannedWorld, name: str, hand: int, flap: OpenableJoint | None, rotations: Sequence[Rotation]
) -> tuple[Vector, Rotation] | None:
    """Where a hand holds a box turned by the first of some rotations for which it has room, with its flap open as well,
    and that the arm reaches."""
    obstacles, grip = world.obstacles([name], world.stance), world.grip(hand)
    wide = np.zeros((0, 3))
    if flap is not None:
        wide = flap.moved(flap.vertices, flap.closed + OPEN_TO * (flap.open - flap.closed) - flap.now) - grip
    carried, front = world.carried(hand, world.stance), ahead(world.stance.yaw)
    for rotation in rotations:
        spheres = world.spheres(*world.hand_axes(hand, rotation), holding=name, hand=hand, rotation=rotation)
        flaps = np.column_stack([wide @ rotation.T, np.full(len(wide), HELD_MARGIN)])
        held = np.concatenate([spheres, flaps])
        follows = world.follows(hand, world.turned_hand(hand, rotation), obstacles)
        for more, aside, up in OFFSETS:
            point = carried + more * front + aside * np.cross(UP, front) + up * UP
            if obstacles.clear(held + np.array([*point, 0.0])) and (follows is None or follows.reaches(point)):
                return point, rotation
    return None


def _rotations() -> Iterator[Rotation]:
    yield np.eye(3)
    for turn in np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS):
        axis = about_vertical(float(turn))[:, 0]
        for tilt in TILTS:
            yield turn_about(axis, tilt)


def sinks(flap: OpenableJoint, rotation: Rotation) -> float:
    """Share of the torque of a level flap's weight that opens it, at least, on its way from where it is to where it is
    open, if its box is turned by a rotation, world frame."""
    sign, found = np.sign(flap.open - flap.closed), []
    axis = rotation @ flap.axis
    for share in np.linspace(flap.fraction, OPEN_TO, 3):
        corners = flap.moved(flap.vertices, flap.closed + share * (flap.open - flap.closed) - flap.now)
        arm = rotation @ (corners.mean(0) - flap.anchor)
        arm = arm - (arm @ axis) * axis
        found.append(float(sign * axis @ np.cross(arm / np.linalg.norm(arm), -UP)))
    return min(found)
