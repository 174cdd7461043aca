"""Where an object is put so that a placement predicate holds."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.geometry.host_rotations import matrix_to_quat, quat_conjugate, quat_multiply, turn_onto, yaw_quat
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.arm_orientations import ARM_TURNS, level_orientations
from ig2mj.planning.bodies import CORNER
from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.facts import Facts
from ig2mj.planning.free_floor import NEAR_START
from ig2mj.planning.joints import AJAR, OpenableJoint, openable_joints
from ig2mj.planning.occupancy import RESOLUTION
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld, Rotation, Vector
from ig2mj.sampling.areas import WITHOUT_CONTACT, areas_for
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.placement import Placer
from ig2mj.scene.manifest import OrientationEntry

EASY = 0.35
"""m, horizontal, from the floor where a robot can stand up to which no spot is harder to reach than another."""

EACH, SPREAD = 4, 0.04
"""Spots of a placement in each area of its rule, and m between them, at least."""

ROOFED, COLUMN = 1.0, np.arange(0.15, 0.8, 0.08)
"""m of way that a spot counts as farther which nothing can be let down to, and heights above it that are looked at."""

WIDE = 0.8
"""Share of the middle edge of an object's box that has to have room above a spot."""

FAR_SPOTS, LATER_SPOTS, ELSEWHERE, LEVEL = 32, 8, 0.1, 0.1
"""Candidates of an area of which the predicate is asked, at most, and once more where it is false at all of these; m
from one at which it is false within which it is asked once more only, and of height of places that are about as high:
on the open door of a dishwasher nothing is inside of it."""

TURNS = (0.0, np.pi / 2, -np.pi / 2, np.pi)
"""rad about the vertical that an object may be turned by, from how it is held in front of the robot."""

ORIENTATIONS, ORIENTATION_SPREAD = 2, 1.7
"""Orientations at rest that are tried, and rad by which they may be farther from the present one than the nearest;
others where something has no place inside of something in these."""

OPEN = 0.25
"""m to spare for the robot where it could stand, from which on floor is open."""

UPON = ((0.0, 0.0), (0.05, 0.0), (-0.05, 0.0), (0.0, 0.05), (0.0, -0.05))
"""m from an object's centre of mass at which something is put upon it."""

STANDS = 0.8
"""Cosine of the angle of an object's own vertical up to which it stands upright."""

LOWER = 1.1
"""Height of an orientation, as a share of the lowest one's, up to which the object lies flat."""

LONGER = 1.3
"""Times that something is longer than it is wide, from which on it is put with an end first into what is narrow."""

CLOSE = 0.001
"""m, slack of heights."""

UP = np.array([0.0, 0.0, 1.0])


@dataclasses.dataclass(frozen=True, eq=False)
class Spot:
    """Where an object is to be: position (m) and orientation (w-x-y-z) of its main body, world frame; `roofed`: inside
    something, with a part of it above; `drop`: m above it at which the hand lets go; `tight`: it touches the sides on
    its way down; `outs`: horizontal directions out from below what it is under, for a hand on an arm."""

    pos: Vector
    quat: Float[np.ndarray, "4"]
    roofed: bool = False
    drop: float = 0.0
    tight: bool = False
    outs: tuple[Vector, ...] = ()


def spots_for(
    world: PlannedWorld,
    predicate: str,
    name: str,
    where: str,
    also: Sequence[Condition] = (),
    hanging: Rotation | None = None,
    flat: bool = False,
) -> Iterator[Spot]:
    """Poses of an object's main body that make a placement true. Orientations in which it rests come first, those
    nearest to how it is held before others, each turned about the vertical.

    Args:
      also: further placements that are to be true there.
      hanging: at these places the object keeps the orientation in which it hangs from the hand, after this rotation
        and turned about the vertical, with its lowest point where it would stand: it falls over when it is let go.
      flat: of the orientations at rest just those in which it is lowest.
    """
    world.query.load(world.stage.snapshot(world.world))
    index = world.index(name)
    requested = [Condition(predicate, (name, where)), *also]
    areas = areas_for(world.query, world.domain.model, name, [c for c in requested if c.value])
    without_contact = [c for c in requested if c.predicate in WITHOUT_CONTACT]
    placer, farther = Placer(world.query), out_of_reach(world)
    middle = _middle_of_fixed_part(world, where) if predicate == "inside" else None
    own = (
        openable_joints(world.stage.scene, world.view, world.index(where), world.world) if predicate == "inside" else []
    )
    drawers = [j for j in own if not j.hinge]
    outs = out_from(world, where) if predicate == "under" and world.body.opening is not None else ()
    around = world.obstacles([name], stays=False)
    wide = max(CORNER, WIDE * float(np.sort(np.ptp(world.vertices(name), axis=0))[1]) / 2)
    orientations = _upright(world, name, flat, every=predicate == "inside")
    turned = [(quat, angle) for quat in orientations for angle in TURNS]
    if world.body.opening is not None:
        level = level_orientations(world, name) if predicate in ("inside", "under") else []
        turned = [(quat, angle) for angle in ARM_TURNS for quat in (*level, *_upright(world, name, flat))]
    proposed = 0
    for number, (quat, angle) in enumerate(turned):
        if proposed and number >= len(TURNS) * ORIENTATIONS and world.body.opening is None:
            return
        new = _yawed(quat, angle)
        refused = list[Vector]()
        for support in ("full", "balanced", "loose") if predicate == "inside" else ("full", "balanced"):
            found = list[Vector]()
            sample = functools.partial(_sampled, placer, index, areas, new, world.rng, support)
            key = ("spots", predicate, name, where, tuple(also), new.tobytes(), support)
            positions = sample() if world.body.opening is None else world.kept(key, sample)
            cost = farther(positions)
            if predicate == "on_floor":
                cost += _cramped(world, positions)
            roofed = np.zeros(len(positions), bool)
            if middle is not None:  # below openings, and away from where doors shut
                roofed = _roofed(positions, around, wide)
                cost += np.linalg.norm((positions - middle)[:, :2], axis=1) + ROOFED * roofed
                cost[_shut_away(positions, drawers)] = np.inf
            for k in _varied(positions, cost, found, refused):
                at, turn = (
                    (positions[k], new) if hanging is None else _hanging(world, name, positions[k], new, hanging, angle)
                )
                if not without_contact or _would_hold(world, without_contact, name, at, turn):
                    found.append(positions[k])
                    proposed += 1
                    yield Spot(at, turn, bool(roofed[k]), outs=outs)
            if found:
                break


def out_from(world: PlannedWorld, where: str) -> tuple[Vector, ...]:
    """Horizontal directions of the sides of an object."""
    frame = matrices_on_host(world.pose(where)[1][None])[0]
    ahead = frame[:, int(np.argmin(np.abs(frame[2])))] * (1.0, 1.0, 0.0)
    ahead = ahead / np.linalg.norm(ahead)
    aside = np.cross(UP, ahead)
    return ahead, -ahead, aside, -aside


def _sampled(placer: Placer, *arguments: Any) -> Float[np.ndarray, "n 3"]:
    """All positions that `Placer.spots` gives. Those of an arm are kept: it asks for the same again to let things fall
    there, or down narrow ways."""
    return np.array(list(placer.spots(*arguments))).reshape(-1, 3)


def _varied(
    positions: Float[np.ndarray, "n 3"], cost: Float[np.ndarray, "n"], found: Sequence[Vector], refused: list[Vector]
) -> Iterator[int]:
    """Numbers of positions, the cheapest first, of which the caller puts those that are right into `found`: `SPREAD`
    apart, and `ELSEWHERE` from those that were not right, of which at most `LATER_SPOTS` are about as high; where none
    of these is right, closer ones.

    Args:
      refused: those that were not right before, to which these are added.
    """
    order = np.argsort(cost, kind="stable")
    left = np.isfinite(cost)[order]
    level = np.round(positions[order, 2] / LEVEL)
    for apart, most in ((ELSEWHERE, FAR_SPOTS), (0.0, LATER_SPOTS)):
        free = left.copy()
        for other in refused if apart else ():
            free &= np.linalg.norm(positions[order] - other, axis=1) >= apart
        for _ in range(most):
            if len(found) == EACH or not free.any():
                break
            place = int(np.argmax(free))
            k, known = int(order[place]), len(found)
            yield k
            if len(found) == known:
                refused.append(positions[k])
            far = np.linalg.norm(positions[order] - positions[k], axis=1)
            free &= far >= (SPREAD if len(found) > known else apart)
            left[place] = free[place] = False
            own = level == level[place]
            if apart and not len(found) and np.count_nonzero(own & ~left & np.isfinite(cost[order])) >= LATER_SPOTS:
                free &= ~own
        if len(found):
            break


def spots_upon(world: PlannedWorld, name: str, where: str) -> Iterator[Spot]:
    """Poses in which an object comes to touch another from above, the middle of its box above or near the other's
    centre of mass, whatever else bears it: nothing says that it lies there level."""
    own_pos, own_quat = world.pose(name)
    corners = (world.vertices(name) - own_pos) @ matrices_on_host(own_quat[None])[0]
    obstacles, index, centre = world.obstacles([name]), world.index(where), world.com(where)
    top = float(world.vertices(where)[:, 2].max())
    for quat, angle in [(quat, angle) for quat in _upright(world, name) for angle in TURNS]:
        new = _yawed(quat, angle)
        there = corners @ matrices_on_host(new[None])[0].T
        low, high = there.min(0), there.max(0)
        for aside in UPON:
            xy = centre[:2] + np.array(aside)
            height = obstacles.below(xy, top + CLOSE, [index])
            if np.isfinite(height):
                yield Spot(np.array([*(xy - (low + high)[:2] / 2), height - low[2]]), new)


def put_there(facts: Facts, step: Step, relation: str) -> tuple[bool, str]:
    """Whether the object of a placement is where it was put, by the relation that ends it, and what of the step is
    false, in words; "": nothing."""
    name, where = step.arguments
    if not facts.holds(relation, name, where):
        return False, f"{name} is not where it was put"
    lacking = [c for c in step.also if facts.holds(c.predicate, *c.arguments) != c.value]
    return True, f"{name} was put there, and {lacking[0]} is false" if lacking else ""


def grip_for(world: PlannedWorld, hand: int, name: str, spot: Spot) -> tuple[Vector, Float[np.ndarray, "4"], Rotation]:
    """Grasp point and orientation of a hand that holds an object, if the object were at a spot, and the rotation
    that brings both there."""
    own_pos, own_quat = world.pose(name)
    turn = np.asarray(quat_multiply(spot.quat, quat_conjugate(own_quat)), float)
    rotation = matrices_on_host(turn[None])[0]
    target = spot.pos + rotation @ (world.grip(hand) - own_pos)
    return target, np.asarray(quat_multiply(turn, world.hand_quat(hand)), float), rotation


def ends_down(world: PlannedWorld, name: str, hand: int) -> list[Rotation]:
    """Rotations after which what a hand holds points down with an end, that away from the hand first: so it falls
    through the mouth of what is narrower than it is long. None of what is not longer than wide."""
    points = world.vertices(name)
    points = points - points.mean(0)
    axes = np.linalg.svd(points, full_matrices=False)[2]
    along, across = (float(np.ptp(points @ axis)) for axis in axes[:2])
    if along < LONGER * across:
        return []
    away = axes[0] if (world.com(name) - world.grip(hand)) @ axes[0] >= 0.0 else -axes[0]
    return [turn_onto(end, -UP) for end in (away, -away)]


def _hanging(
    world: PlannedWorld, name: str, pos: Vector, quat: Float[np.ndarray, "4"], tilt: Rotation, angle: float
) -> tuple[Vector, Float[np.ndarray, "4"]]:
    """Pose of an object that is turned as it is now, but for a tilt and an angle about the vertical, above where it
    would rest at a pose: the middle of its box there, its lowest point as low."""
    own_pos, own_quat = world.pose(name)
    corners = (world.vertices(name) - own_pos) @ matrices_on_host(own_quat[None])[0]
    tilted = np.asarray(quat_multiply(np.asarray(matrix_to_quat(tilt), float), own_quat), float)
    turn = _yawed(tilted, angle)
    there = corners @ matrices_on_host(quat[None])[0].T
    hung = corners @ matrices_on_host(turn[None])[0].T
    middle = pos[:2] + (there.min(0) + there.max(0))[:2] / 2 - (hung.min(0) + hung.max(0))[:2] / 2
    return np.array([*middle, pos[2] + there[:, 2].min() - hung[:, 2].min()]), turn


def _roofed(positions: Float[np.ndarray, "n 3"], around: Obstacles, wide: float) -> Bool[np.ndarray, "n"]:
    """Above which positions something is in the way of what is let down to them, and is so wide (m, to each side)."""
    if not len(positions):
        return np.zeros(0, bool)
    points = positions[:, None] + np.stack([np.zeros(len(COLUMN)), np.zeros(len(COLUMN)), COLUMN], axis=1)
    return np.any(around.distance(points) < wide, axis=1)


def _drawers(world: PlannedWorld, name: str) -> list[OpenableJoint]:
    found = openable_joints(world.stage.scene, world.view, world.index(name), world.world)
    return [joint for joint in found if not joint.hinge]


def _shut_away(positions: Float[np.ndarray, "n 3"], drawers: Sequence[OpenableJoint]) -> Bool[np.ndarray, "n"]:
    """Which positions are in a drawer that is shut, or behind one that is pulled out, where it is to be shut."""
    out, shut = np.zeros(len(positions), bool), np.zeros(len(positions), bool)
    for drawer in drawers:
        for found, corners in ((out, drawer.vertices), (shut, drawer.shut)):
            if found is shut or drawer.fraction > AJAR:
                found |= ((corners.min(0) <= positions) & (positions <= corners.max(0))).all(1)
    return shut & ~out


def out_of_reach(
    world: PlannedWorld, without: Sequence[int] = ()
) -> Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n"]]:
    """How far positions are from where a hand is comfortable, m, for a robot on floor that it has a way to;
    infinite: no hand reaches there.

    Args:
      without: objects, by number, that are in no way.
    """
    import scipy.ndimage  # takes long to import

    floor, (here, _) = world.floor(without=without), world.base
    reached = np.isfinite(floor.distances(here, NEAR_START))
    apart = np.full(reached.shape, np.inf)
    if reached.any():
        apart = RESOLUTION * np.asarray(scipy.ndimage.distance_transform_edt(~reached))
    _, aside, height = np.abs(world.body.shoulders[0])
    shoulder = world.body.stands + height

    def farther(pos: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        if not len(pos):
            return np.zeros(0)
        cells = np.clip(floor.occupancy.cells(pos[:, :2]), 0, np.array(reached.shape) - 1)
        away = apart[tuple(np.moveaxis(cells, -1, 0))]
        above = pos[:, 2] - shoulder
        level = np.maximum(away - aside, 0.0)
        far = np.hypot(level, above - np.clip(above, *world.body.rises)) > world.body.reach
        return np.where(far, np.inf, np.maximum(away - EASY, 0.0))

    return farther


def _cramped(world: PlannedWorld, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """By how much less than `OPEN` the robot has to spare where an object comes to lie, m: there hands and tools reach
    it from few sides."""
    if not len(positions):
        return np.zeros(0)
    floor = world.floor()
    cells = np.clip(floor.occupancy.cells(positions[:, :2]), 0, np.array(floor.spare.shape) - 1)
    return np.clip(OPEN - floor.spare[tuple(np.moveaxis(cells, -1, 0))], 0.0, 2 * OPEN)


def fixed_part(world: PlannedWorld, name: str) -> Float[np.ndarray, "V 3"]:
    """Corners of an object without its doors, drawers and lids, m."""
    tables, model = world.domain.model.tables, world.stage.scene.model
    index = world.index(name)
    joints = np.isin(model.jnt_qposadr, tables.openable_qposadr[tables.openable_object == index])
    own = tables.piece_object == index
    fixed = np.flatnonzero(own & ~np.isin(tables.piece_body, model.jnt_bodyid[joints]))
    return world.vertices_of_pieces(fixed if len(fixed) else np.flatnonzero(own))


def _middle_of_fixed_part(world: PlannedWorld, name: str) -> Vector:
    """Middle of the box about `fixed_part`, m."""
    corners = fixed_part(world, name)
    return (corners.min(0) + corners.max(0)) / 2


def is_tipped(world: PlannedWorld, name: str) -> bool:
    """Whether an object's own vertical is not upright."""
    return float(matrices_on_host(world.pose(name)[1][None])[0][2, 2]) < STANDS


def _upright(world: PlannedWorld, name: str, flat: bool = False, every: bool = False) -> list[Float[np.ndarray, "4"]]:
    """Orientations in which an object rests, each the nearest to its present one, at most `ORIENTATIONS`; that, where
    none is known. Of what opens, those come first in which it stands, so that it can be filled.

    Args:
      flat: just those in which it is lowest. every: all of them, and also those farther from the present one.
    """
    _, now = world.pose(name)
    frame = matrices_on_host(now[None])[0]
    own = [matrices_on_host(np.array([e.quat], float))[0][2] for e in _orientations(world, name)]
    standing, others = [v for v in own if v[2] > STANDS], list[Vector]()
    if world.domain.opens(name) and standing:
        own, others = standing, [v for v in own if v[2] <= STANDS]
    if flat and own:
        heights = np.ptp(world.vertices(name) @ frame @ np.stack(own, 1), axis=0)
        own = [vertical for vertical, height in zip(own, heights, strict=True) if height < LOWER * heights.min()]
    found, further = ([_nearest(frame, now, v) for v in verticals] for verticals in (own, others))
    found.sort(key=lambda pair: pair[0])
    kept = [quat for angle, quat in found if angle < found[0][0] + ORIENTATION_SPREAD][:ORIENTATIONS]
    if every and world.body.opening is None:
        kept += [quat for _, quat in found if not any(quat is k for k in kept)]
        if further:
            kept += kept[:1] * (ORIENTATIONS - len(kept))  # the first ones are tried in any case
            kept += [quat for _, quat in sorted(further, key=lambda pair: pair[0])]
    return kept or [now]


def _nearest(frame: Rotation, now: Float[np.ndarray, "4"], vertical: Vector) -> tuple[float, Float[np.ndarray, "4"]]:
    """The orientation nearest to the present one, `frame` and `now`, in which a direction of an object points up; and
    how far it is from that, rad."""
    up = frame @ vertical
    axis, angle = np.cross(up, UP), float(np.arccos(np.clip(up[2], -1.0, 1.0)))
    axis = axis / np.linalg.norm(axis) if np.linalg.norm(axis) > 1e-6 else np.array([1.0, 0.0, 0.0])
    tilt = np.concatenate([[np.cos(angle / 2)], np.sin(angle / 2) * axis])
    return angle, np.asarray(quat_multiply(tilt, now), float)


def _orientations(world: PlannedWorld, name: str) -> Sequence[OrientationEntry]:
    return world.stage.scene.manifest.objects[world.index(name)].orientations


def _would_hold(
    world: PlannedWorld, conditions: Sequence[Condition], name: str, pos: Vector, quat: Float[np.ndarray, "4"]
) -> bool:
    """Whether placements that do not depend on contact would be true."""
    index, before = world.index(name), world.pose(name)
    world.query.place(index, pos, quat)
    states = Facts(world.domain, world.stage.states, world.view, world.world).states
    truth = Facts(world.domain, states, world.query.view).truth([c.atom for c in conditions])
    world.query.place(index, *before)
    return all(truth[c.atom] == c.value for c in conditions)


def _yawed(quat: Float[np.ndarray, "4"], angle: float) -> Float[np.ndarray, "4"]:
    turned = np.asarray(quat_multiply(yaw_quat(angle), quat), float)
    return turned / np.linalg.norm(turned)
