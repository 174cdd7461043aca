"""What is too heavy for one hand: both take it from opposite sides, carry it, and put it down.

The hands take the object one after another where it lies. From then on both move by the same displacement
(`Phase.both`), so that the object keeps its orientation in the frame of the robot, and turns only with the robot.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Generator, Iterator, Sequence

import numpy as np

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.clearance import Obstacles, straight
from ig2mj.planning.driving import go, stretch
from ig2mj.planning.free_floor import NEAR_START
from ig2mj.planning.grasps import GraspPose, grasp_poses
from ig2mj.planning.moves import (
    ATTEMPTS,
    OPENS,
    OVER,
    RETREAT,
    UP,
    Primitive,
    Program,
    ahead,
    first_way,
    from_home,
    hand_path,
    rest,
    travel,
    vector3,
)
from ig2mj.planning.opening_around import Tried, open_around
from ig2mj.planning.phases import Phase, Until
from ig2mj.planning.spots import Spot, grip_for, put_there, spots_for
from ig2mj.planning.stances import reaching_with
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.taking import closing_on, entries, way_to
from ig2mj.planning.world import PlannedWorld, Rotation, Stance, Vector

BETWEEN = 0.15
"""m, horizontal, between both hands, at least."""

LARGEST_SHARE = 0.7
"""Share of the weight that one of the hands bears, at most."""

OFF_LINE, SLANT, SHARED = 4.0, 2.0, 2.0
"""Discomfort of a pair of grasps: for each metre by which the centre of mass is off the line between them, for each by
which one is higher than the other, and of bearing all of the weight with one hand."""

PAIRS, FACING = 60, (0.0, 0.4, -0.4)
"""Pairs that are tried, and rad off the normal of the line between both hands that the robot may look along."""

NEAREST, FARTHEST = 0.4, 1.0
"""m, horizontal, from the middle between both hands to the robot's axis."""

FLOOR, STANCES, WAYS = 0.05, 4, 40
"""m from a place to free floor up to which the robot stands there; stances for each pair, and pairs with stances that
ways are looked for."""

SLOW, LOWERING = 0.03, 0.02
"""m in an agent step of hands that lift together, and that put down."""

EXTENDED = (0.0, 0.15, 0.3, 0.45)
"""m that both hands move what they hold ahead of where it is carried, to put it down."""

TILTED = 0.95
"""Cosine of the turn of an object's vertical up to which a spot keeps it level: hands together do not tilt it."""

SPOTS = 60
"""Spots of a placement that are looked at."""

UNBORNE, BORNE, BELOW = 4.0, 5, 0.02
"""m of way that a spot counts as farther whose support bears nothing of the object; points along each side of its box
that are looked at, and m below them within which something bears it."""

SINKS, PRESSES = 0.008, 5
"""m by which hands go below a place, so that what they let go of lies on it, and agent steps that they press there."""


def holds_with_both(world: PlannedWorld, name: str) -> bool:
    """Whether two hands hold an object."""
    return world.held.count(name) > 1


def grasp_with_both(world: PlannedWorld, name: str) -> Primitive:
    """Both hands take an object, one after another, and lift it together."""
    if holds_with_both(world, name):
        return Outcome()
    mass = world.mass(name)
    if mass > 2 * world.body.lifts:
        return Outcome("no_grasp", f"{name} is too heavy for both hands: {mass:.0f} kg")
    if name in world.held:  # the other hand lost it
        yield _opened(world, world.held.index(name))
    if others := [n for n in world.held if n]:
        return Outcome("no_grasp", f"both hands are needed for {name} ({mass:.0f} kg), and they hold {others[0]}")
    reason, detail, tried = "no_grasp", f"both hands find no room on opposite sides of {name}", list[_Pair]()
    moved = Tried()
    for attempt in range(ATTEMPTS):
        found = _plan(world, name, tried)
        while isinstance(found, str) and (yield from open_around(world, name, moved)):
            found = _plan(world, name, tried)
        if isinstance(found, str):
            if not tried:
                reason = found
                detail = detail if found == "no_grasp" else f"no free floor from which both hands have a way to {name}"
            break
        stance, pair = found
        tried.append(pair)
        if reason := (yield from go(world, stance)):
            detail = f"no path leads to where both hands reach {name}"
            continue
        reason, detail = yield from _take(world, name, pair)
        if holds_with_both(world, name):
            return Outcome(attempts=attempt + 1)
    return Outcome(reason or "no_grasp", detail, attempts=max(1, len(tried)))


@dataclasses.dataclass(frozen=True, eq=False)
class _Pair:
    """Grasps of the left and the right hand of a robot that looks along the normal of the line between them, `yaw`,
    rad."""

    poses: tuple[GraspPose, GraspPose]
    yaw: float

    @property
    def middle(self) -> Vector:
        return (self.poses[0].point + self.poses[1].point) / 2

    def is_like(self, other: _Pair) -> bool:
        """Whether both hands are about where those of another pair are."""
        return all(np.linalg.norm(a.point - b.point) < 0.03 for a, b in zip(self.poses, other.poses, strict=True))


def _pairs(world: PlannedWorld, name: str, poses: Sequence[GraspPose]) -> list[_Pair]:
    """Pairs of grasps that share the weight, those from opposite sides and level with each other first."""
    if len(poses) < 2:
        return []
    centre, points = world.com(name), np.array([p.point for p in poses])
    palms, burden = np.array([p.palm for p in poses]), np.array([p.burden for p in poses])
    left, right = np.indices((len(poses), len(poses))).reshape(2, -1)
    line = (points[right] - points[left])[:, :2]
    apart = np.linalg.norm(line, axis=1)
    unit = line / np.maximum(apart, 1e-9)[:, None]
    offset = centre[:2] - points[left][:, :2]
    share = (offset * unit).sum(1) / np.maximum(apart, 1e-9)
    off = np.abs(offset[:, 0] * unit[:, 1] - offset[:, 1] * unit[:, 0])
    most = min(LARGEST_SHARE, world.body.lifts / world.mass(name))
    good = (apart > BETWEEN) & (np.maximum(share, 1 - share) <= most)
    cost = (
        1.0
        + (palms[left] * palms[right]).sum(1)
        + OFF_LINE * off
        + SLANT * np.abs(points[left][:, 2] - points[right][:, 2])
        + SHARED * np.abs(share - 0.5)
        + burden[left]
        + burden[right]
    )
    cost = np.where(good, cost, np.inf)
    found = list[_Pair]()
    for k in np.argsort(cost, kind="stable")[:PAIRS]:
        if np.isfinite(cost[k]):
            across = unit[k]  # from the left hand to the right one
            yaw = float(np.arctan2(across[0], -across[1]))
            found.append(_Pair((poses[int(left[k])], poses[int(right[k])]), yaw))
    return found


def _plan(world: PlannedWorld, name: str, tried: Sequence[_Pair]) -> tuple[Stance, _Pair] | str:
    """A stance and a pair of grasps to which both hands have ways from there; else the reason of the failure."""
    obstacles, floor = world.obstacles([name], stays=False), world.floor()
    pairs = [p for p in _pairs(world, name, grasp_poses(world, name, obstacles)) if not any(map(p.is_like, tried))]
    if not pairs:
        return "no_grasp"
    here, _ = world.base
    distance = floor.distances(here, NEAR_START)

    def stances_of(pair: _Pair) -> Iterator[Stance]:
        cells = floor.within(pair.middle[:2], FARTHEST)
        middles = floor.occupancy.middles(cells)
        offset = pair.middle[:2] - middles
        apart = np.linalg.norm(offset, axis=1)
        turned = (np.arctan2(offset[:, 1], offset[:, 0]) - pair.yaw + np.pi) % (2 * np.pi) - np.pi
        cost = 0.6 * distance[tuple(cells.T)] + 2.0 * apart + np.abs(turned)
        cost[(apart < NEAREST) | (np.abs(turned) > max(FACING))] = np.inf
        count = 0
        for k in np.argsort(cost):
            if not np.isfinite(cost[k]) or count == STANCES:
                return
            x, y = middles[k]
            stance = Stance((float(x), float(y)), pair.yaw + float(turned[k]))
            goals = [(h, p.at(away)) for h, p in enumerate(pair.poses) for away in (0.0, p.before)]
            if (reaching := reaching_with(world, stance, goals, obstacles)) is not None:
                count += 1
                yield reaching

    def candidates() -> Iterator[tuple[Stance, _Pair]]:
        for pair in pairs:
            for stance in stances_of(pair):
                yield stance, pair

    def has_way(candidate: tuple[Stance, _Pair], search: bool) -> bool:
        stance, pair = candidate
        for hand, pose in enumerate(pair.poses):
            spheres, back = world.spheres(pose.fingers, pose.palm), entries(pose, stance.xy)
            standing, rests = world.standing(obstacles, stance, hand), world.resting(hand, stance)
            if hand_path(standing, spheres, rests, pose.at(pose.before), back, search=search) is None:
                return False
        return True

    found = first_way(candidates(), has_way, WAYS)
    return "no_base" if found is None else found


def _take(world: PlannedWorld, name: str, pair: _Pair) -> Generator[Program, str, tuple[str, str]]:
    """Both hands take an object from where the robot stands, and lift it; returns why not, as a reason and in words."""
    index, ways = world.index(name), dict[int, list[Vector]]()
    reason, detail = "", ""
    for hand, pose in enumerate(pair.poses):
        way = yield from from_home(world, hand, functools.partial(way_to, world, name, hand, pose))
        if way is None:
            reason, detail = "no_path", f"a hand has no path to {name}"
            break
        ways[hand] = way
        if reason := (yield closing_on(world, name, hand, pose, way)):
            detail = f"a hand closed on {name} and does not hold it" if reason == "no_grasp" else ""
            break
    if not reason and holds_with_both(world, name):
        up = world.grip(0) + _raised(world) * UP
        reason = yield [*_moved_to(up, index, SLOW), stretch(0.0)]
        if holds_with_both(world, name):
            return "", ""
        detail = f"both hands together lose {name}"
    for hand, way in ways.items():
        back = vector3(world.grip(hand) - pair.poses[hand].before * pair.poses[hand].palm)
        off = Phase(hand=hand, close=False, pos=back, limit=10, after="")
        yield [off, *travel(hand, way[-2::-1], None), *rest(hand)]
    return reason or "slipped", detail


def _raised(world: PlannedWorld) -> float:
    """m that both hands lift what they hold: to where a hand carries things."""
    return max(float(world.body.stands + world.body.carry[0][2] - world.grip(0)[2]), 0.0)


def _moved_to(point: Vector, index: int, speed: float, tolerance: float = 0.03, limit: int = 80) -> Program:
    """Both hands move what they hold by the same, until the left one is at a point."""
    return [
        Phase(hand=0, pos=vector3(point), both=True, keeps=index, speed=speed, tolerance=tolerance, limit=limit,
              after="")
    ]  # fmt: skip


def _lowered(start: Vector, low: Vector, index: int) -> Program:
    """Both hands go straight down until what they hold lies. Targets below a support add up, and pull the hands off, so
    that this lasts no longer than it takes."""
    limit = int(np.ceil(np.linalg.norm(start - low) / LOWERING)) + PRESSES
    return _moved_to(low, index, LOWERING, tolerance=SINKS, limit=limit)


def _opened(world: PlannedWorld, hand: int) -> Program:
    """A hand lets go, goes back the way its back looks, and rests."""
    off = vector3(world.grip(hand) - RETREAT * world.hand_axes(hand)[1])
    return [
        Phase(hand=hand, close=False, until=Until.EMPTY, limit=15, after=""),
        Phase(hand=hand, close=False, until=Until.WAITED, limit=OPENS),
        Phase(hand=hand, pos=off, tolerance=0.04, limit=15, after=""),
        *rest(hand),
    ]


def _let_go(world: PlannedWorld, target: Sequence[Vector], palms: Sequence[Vector]) -> Program:
    """Both hands open together where their grasp points are, and go back one after another."""
    program = [
        Phase(hand=0, close=False, both=True, until=Until.EMPTY, limit=15, after=""),
        Phase(hand=0, close=False, both=True, until=Until.WAITED, limit=OPENS),
    ]
    for hand, (point, palm) in enumerate(zip(target, palms, strict=True)):
        program.append(Phase(hand=hand, pos=vector3(point - RETREAT * palm), tolerance=0.04, limit=15, after=""))
    for hand in range(len(target)):
        program += rest(hand)
    return program


def release_with_both(world: PlannedWorld, name: str) -> Primitive:
    """Lowers what both hands hold onto what is below it, and opens them."""
    obstacles, low = world.obstacles([name], world.stance), world.grip(0)
    spheres = _spheres(world, name, np.eye(3))
    while world.reaches(0, world.stance, low - LOWERING * UP) and straight(
        obstacles, spheres, low, low - LOWERING * UP
    ):
        low = low - LOWERING * UP
    down, palms = low - world.grip(0) - SINKS * UP, [world.hand_axes(hand)[1] for hand in (0, 1)]
    yield [
        *_lowered(world.grip(0), world.grip(0) + down, world.index(name)),
        *_let_go(world, [world.grip(hand) + down for hand in (0, 1)], palms),
    ]
    return Outcome() if name not in world.held else Outcome("not_true_after", "the hands did not open")


def _spheres(world: PlannedWorld, name: str, rotation: Rotation) -> np.ndarray:
    """Of both hands and what they hold, from the left hand's grasp point, turned by a rotation."""
    own = world.spheres(*world.hand_axes(0, rotation), holding=name, hand=0, rotation=rotation)
    other = world.body.hand_spheres(*world.hand_axes(1, rotation)).copy()
    other[:, :3] += rotation @ (world.grip(1) - world.grip(0))
    return np.concatenate([own, other])


@dataclasses.dataclass(frozen=True, eq=False)
class _Placing:
    """Where a robot stands to put something down, and m that its hands go ahead and then down, from how they carry."""

    stance: Stance
    spot: Spot
    extended: float


def place_with_both(world: PlannedWorld, predicate: str, step: Step, until: str = "") -> Primitive:
    """Both hands put what they hold where a placement is true. `until`: the relation that ends it, if another."""
    name, where = step.arguments
    reason, detail = "no_base", ""
    for attempt in range(ATTEMPTS):
        if not holds_with_both(world, name):
            yield [phase for hand in (0, 1) for phase in _opened(world, hand)]
            again = yield from grasp_with_both(world, name)
            if not again.done:
                return dataclasses.replace(again, attempts=attempt + 1)
        found = _place_for(world, predicate, step)
        if isinstance(found, str):
            reason, detail = "no_base", f"{found} {predicate}({name}, {where}) would be true, with both hands"
            break
        if reason := (yield from go(world, found.stance)):
            continue
        if not holds_with_both(world, name):
            reason, detail = "slipped", f"the hands lost {name}"
            continue
        target, _, rotation = grip_for(world, 0, name, found.spot)
        index, grips = world.index(name), [world.grip(0), world.grip(1)]
        above = np.array([*target[:2], max(grips[0][2], target[2] + OVER)])
        low = target - SINKS * UP
        other = low + rotation @ (grips[1] - grips[0])
        palms = [world.hand_axes(hand, rotation)[1] for hand in (0, 1)]
        reason = yield [
            *_moved_to(above, index, SLOW, tolerance=0.015),
            *_lowered(above, low, index),
            *_let_go(world, [low, other], palms),
            Phase(until=Until.WAITED, limit=6),
        ]
        if name in world.held:  # one of the hands lost it on the way down
            yield _let_go(world, [world.grip(hand) for hand in (0, 1)], [world.hand_axes(hand)[1] for hand in (0, 1)])
        placed, detail = put_there(world.facts, step, until or predicate)
        if not placed:
            reason = reason or "not_true_after"
            continue
        if not detail:
            return Outcome(attempts=attempt + 1)
        reason = "not_true_after"
        break
    return Outcome(reason or "not_true_after", detail, attempts=ATTEMPTS)


def _place_for(world: PlannedWorld, predicate: str, step: Step) -> _Placing | str:
    """Where both hands put down what they hold as they carry it, turned with the robot; else what is lacking."""
    name, where = step.arguments
    obstacles, floor = world.obstacles([name], stays=False), world.floor()
    here, yaw = world.base
    distance, lacking = floor.distances(here, NEAR_START), "there is no room for a place where"
    found: list[tuple[float, _Placing]] = []
    for also in dict.fromkeys((step.also, ())):
        for spot in itertools.islice(spots_for(world, predicate, name, where, also, flat=step.flat), SPOTS):
            target, _, rotation = grip_for(world, 0, name, spot)
            if rotation[2, 2] < TILTED:
                continue
            angle = float(np.arctan2(rotation[1, 0], rotation[0, 0]))
            held = about_vertical(angle) @ (world.grip(0) - np.array([*here, 0.0]))
            spheres = _spheres(world, name, rotation)
            lacking = "no free floor is in reach of a place where"
            for extended in EXTENDED:
                xy = (target - held)[:2] - extended * ahead(yaw + angle)[:2]
                placing = _standing(world, spot, Stance((float(xy[0]), float(xy[1])), yaw + angle), extended)
                cell = floor.nearest(xy, FLOOR)
                if placing is None or cell is None or not np.isfinite(distance[tuple(cell)]):
                    continue
                if _has_way(world, obstacles.about(placing.stance.xy, *world.body.trunk), spheres, placing, target):
                    borne = _borne(world, obstacles, name, spot)
                    found.append((float(distance[tuple(cell)]) + extended - UNBORNE * borne, placing))
                    break
        if found:
            return min(found, key=lambda pair: pair[0])[1]
    return lacking


def _borne(world: PlannedWorld, obstacles: Obstacles, name: str, spot: Spot) -> float:
    """Share of the lower side of an object's box that has something right below it, if it were at a spot."""
    pos, quat = world.pose(name)
    corners = (world.vertices(name) - pos) @ matrices_on_host(quat[None])[0] @ matrices_on_host(spot.quat[None])[0].T
    low, high = corners.min(0) + spot.pos, corners.max(0) + spot.pos
    grid = np.stack(np.meshgrid(*np.linspace(low[:2], high[:2], BORNE).T), axis=-1).reshape(-1, 2)
    return float(np.mean(obstacles.distance(np.column_stack([grid, np.full(len(grid), low[2])])) < BELOW))


def _standing(world: PlannedWorld, spot: Spot, stance: Stance, extended: float) -> _Placing | None:
    """A placement from a stance, if both hands reach it; None: they do not."""
    rotation = about_vertical(stance.yaw - world.base[1])
    name = next(n for n in world.held if n)
    target = grip_for(world, 0, name, spot)[0]
    other = target + rotation @ (world.grip(1) - world.grip(0))
    goals = [(h, p + up * UP) for h, p in ((0, target), (1, other)) for up in (0.0, OVER)]
    reaching = reaching_with(world, stance, goals, world.obstacles([name], stays=False))
    return None if reaching is None else _Placing(reaching, spot, extended)


def _has_way(world: PlannedWorld, obstacles: Obstacles, spheres: np.ndarray, placing: _Placing, target: Vector) -> bool:
    """Whether what both hands hold goes ahead as high as it is carried, and straight down to its place."""
    over = target + OVER * UP
    high = np.array([*target[:2], max(world.grip(0)[2], over[2])])
    start = high - placing.extended * ahead(placing.stance.yaw)
    return straight(obstacles, spheres, start, high) and straight(obstacles, spheres, high, over)
