"""Placing what a hand holds, so that a relation becomes true."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.host_rotations import about_vertical
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.arm_orientations import points_ahead
from ig2mj.planning.clearance import HELD, Obstacles, straight
from ig2mj.planning.driving import go, nearer
from ig2mj.planning.grasping import grasp, is_graspable, put_down_others, release, with_free_hand
from ig2mj.planning.letting_go import SPARE, entries_to, letting_go, spheres_at, way_to_spot
from ig2mj.planning.moves import (
    ATTEMPTS,
    LET_GO,
    OVER,
    UP,
    Primitive,
    PrimitiveFailed,
    Program,
    first_way,
    from_home,
    hand_path,
    hand_with,
    turning_point,
)
from ig2mj.planning.opening_around import Tried, is_shut, open_into
from ig2mj.planning.over_mouths import is_deep, over_mouth
from ig2mj.planning.spots import Spot, ends_down, grip_for, is_tipped, put_there, spots_for, spots_upon
from ig2mj.planning.stances import stances
from ig2mj.planning.steadying import is_thrown_over, steadied
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.two_hands import place_with_both
from ig2mj.planning.world import PlannedWorld, Rotation, Stance, Vector
from ig2mj.sampling.conditions import Condition

DEEP = 0.4
"""m above a spot in a container that is open above, from which an object is let down to it."""

LOW_DROPS, DEEP_DROPS = (0.0, 0.05, 0.1), (0.0, 0.05, 0.1, 0.16, 0.22, 0.28, 0.35, 0.42)
"""m above its place at which an object is let go where the hand has no room lower: onto something, and into it."""

TIGHT = 0.12
"""m above its place from which on what is let go into something narrow may touch its sides."""

DROPS = {"inside": DEEP_DROPS, "on_top": LOW_DROPS, "on_floor": LOW_DROPS, "next_to": LOW_DROPS, "under": (0.0,)}

FALLS_OVER = ("on_floor", "on_top", "inside")
"""Placements that stay true where an object falls over."""

UNDER = 0.85
"""m, horizontal, that the base of hands that float would like to be from what is put below something: it is let down
before that, and goes straight in."""

STANCES, AROUND, WAYS, ARM_WAYS, FEWEST_WAYS = 3, 12, 30, 200, 50
"""Stances for each spot, those among which they are looked for where a gripper has to point ahead, and ways of a hand
that are looked for, at most: of one that floats, and of one on an arm, of which there are fewer where earlier requests
have found none, and these at least."""


def place(predicate: str, until: str = "", turns_over: bool = True) -> Callable[[PlannedWorld, Step], Primitive]:
    """The primitive that makes a placement true.

    Args:
      until: the relation that ends it, if it is another. turns_over: where the hand has no way, it takes the object by
        another side, once.
    """

    def place(world: PlannedWorld, step: Step) -> Primitive:
        name, where = step.arguments
        hand_with(world, name)
        if world.domain.hands_for(name) > 1:
            return (yield from place_with_both(world, predicate, step, until))
        turned_over, righted = not turns_over, predicate != "inside"
        reason, detail, opened, tries = "no_base", "", Tried(), 0
        for attempt in range(ATTEMPTS):
            if name not in world.held:  # it fell, or was put where the relation is false
                again = yield from grasp(world, Step("grasp", (name,)))
                if not again.done:
                    break
            if predicate == "inside" and is_thrown_over(world, where):
                yield from put_down_others(world, name)
                if (yield from set_upright(world, where)) and name not in world.held:
                    continue
            if (
                not righted
                and world.body.opening is not None
                and is_graspable(world, where)
                and is_tipped(world, where)
            ):
                righted = True  # an arm's only hand puts down what it holds for that
                yield from with_free_hand(world, set_upright(world, where))
                if name not in world.held:
                    continue
            hand = hand_with(world, name)
            found, also = yield from _find(world, predicate, step, hand, opened, until)
            if isinstance(found, str):
                reason, detail = _lacking(found), f"{found} {predicate}({name}, {where}) would be true"
                if found != _NO_STANCE and not righted:
                    righted = True
                    if (yield from set_upright(world, where)):
                        continue
                if name not in world.held:  # a hand that opened something for it, or set that up, has met it
                    reason, detail, tries = "slipped", f"the hand lost {name}", tries + 1
                    continue
                if found == _NO_WAY and not turned_over and (yield from regrasp(world, name, hand)):
                    turned_over = True
                    continue
                if predicate == "on_floor" and world.facts.room(name) == where and name in world.held:
                    yield from release(world, Step("release", (name,)))  # where the robot stands, in that room
                    placed, detail = put_there(world.facts, step, until or predicate)
                    if placed and not detail:
                        return Outcome(attempts=tries + 1)
                world.missed[f"{predicate} {name}"] += found == _NO_WAY
                break
            tries += 1  # to take it by another side, or to set a container upright, is none
            stance, spot = found
            if reason := (yield from go(world, stance)):
                continue
            if name not in world.held:
                reason, detail = "slipped", f"the hand lost {name}"
                continue
            before = world.pose(where)[0] if where in world.domain.loose else None
            bring = _bring(world, name, hand, spot, where, before)
            reason = yield from (steadied(world, where, hand, bring) if predicate == "inside" else bring)
            if reason == "no_path":
                detail = f"the hand has no way with {name} to its place"
                continue
            placed, detail = put_there(world.facts, step, until or predicate)
            if not placed:
                reason = reason or "not_true_after"
                continue
            if not detail:
                return Outcome(attempts=tries)
            reason = "not_true_after"
            if not also or attempt > 0:
                break
        return Outcome(reason or "not_true_after", detail, attempts=max(tries, 1))

    return place


def _bring(
    world: PlannedWorld, name: str, hand: int, spot: Spot, where: str, before: Vector | None
) -> Generator[Program, str, str]:
    """A hand brings what it holds to a spot from where the robot stands, as `letting_go`; "no_path": it has no way.
    Where another hand holds the container, the base goes no nearer.

    Args:
      before: where a container was for which the spot is, m; the spot moves with what another hand has taken hold of.
    """
    if name not in world.held:
        return "slipped"
    if before is not None and where in world.held:
        spot = dataclasses.replace(spot, pos=spot.pos + world.pose(where)[0] - before)
    find = functools.partial(way_to_spot, world, name, hand, spot)
    planned = yield from from_home(world, hand, find)
    if planned is None and name in world.held and where not in world.held:
        target, quat, _ = grip_for(world, hand, name, spot)
        if (yield from nearer(world, hand, quat, target + (LET_GO + spot.drop) * UP)) and name in world.held:
            planned = find()
    if planned is None:
        return "no_path"
    return (yield from letting_go(world, name, hand, planned, falls=spot.drop > 0.0))


def _find(
    world: PlannedWorld, predicate: str, step: Step, hand: int, opened: Tried, until: str = ""
) -> Generator[Program, str, tuple[tuple[Stance, Spot] | str, tuple[Condition, ...]]]:
    """What `_plan` finds, and the further conditions that are true there: with those of the step, else without; what is
    in the way of a container is opened before ways are searched for, and at last the object is let go as it hangs. Of
    what is only to touch something, `until` is that, places where it does not lie level are taken, too."""
    name, where = step.arguments
    mouth = predicate == "inside" and world.body.opening is not None
    first = mouth and not step.also and is_deep(world, where)
    while True:
        if first and (over := _plan_over_mouth(world, name, hand, where)) is not None:
            return over, ()
        for also in dict.fromkeys((step.also, ())):
            spots = _Remembered(spots_for(world, predicate, name, where, also, flat=step.flat))
            found = _plan(world, predicate, name, hand, spots)
            if not isinstance(found, str):
                return found, also
        if mouth and not first and (over := _plan_over_mouth(world, name, hand, where)) is not None:
            return over, ()
        if predicate != "inside" or not (yield from _opened(world, where, opened)) or name not in world.held:
            break
    if isinstance(found, str) and until == "in_contact_with":
        upon = _plan(world, predicate, name, hand, spots_upon(world, name, where), search=True)
        found = found if isinstance(upon, str) else upon
    if found == _NO_WAY and name in world.held:
        found = _plan(world, predicate, name, hand, spots, search=True)
        if found == _NO_WAY and predicate in FALLS_OVER:
            ends = ends_down(world, name, hand) if predicate == "inside" and world.body.opening is None else []
            for tilt in (np.eye(3), *ends):
                spots = spots_for(world, predicate, name, where, hanging=tilt)
                found = _plan(world, predicate, name, hand, spots)
                if not isinstance(found, str):
                    break
        if found == _NO_WAY and predicate == "inside":
            tight = (dataclasses.replace(spot, tight=True) for spot in spots_for(world, predicate, name, where))
            found = _plan(world, predicate, name, hand, tight)
    return found, ()


def _opened(world: PlannedWorld, where: str, opened: Tried) -> Generator[Program, str, bool]:
    """As `open_into`; where no hand is free, what one holds is put down for it."""
    if not is_shut(world, where, opened):
        return False
    return (yield from with_free_hand(world, open_into(world, where, opened)))


def set_upright(world: PlannedWorld, where: str) -> Generator[Program, str, bool]:
    """Puts a container that has fallen over onto open floor as it stands; returns whether it did."""
    if world.domain.fixed(where) or where in world.held or all(world.held) or not is_tipped(world, where):
        return False
    try:
        return is_graspable(world, where) and (yield from bring_out(world, where)).done
    except PrimitiveFailed:
        return False


class _Remembered:
    """Spots that are gone through again without being sampled again."""

    def __init__(self, spots: Iterator[Spot]):
        self._left, self._known = spots, list[Spot]()

    def __iter__(self) -> Iterator[Spot]:
        yield from self._known
        for spot in self._left:
            self._known.append(spot)
            yield spot


def regrasp(world: PlannedWorld, name: str, hand: int) -> Generator[Program, str, bool]:
    """Puts down what a hand holds, and takes it by its rim, as far as possible from where the hand had it."""
    pos, quat = world.pose(name)
    before = matrices_on_host(quat[None])[0].T @ (world.grip(hand) - pos)
    put = yield from place("on_floor", turns_over=False)(world, Step("place_on_floor", (name, world.facts.room(name))))
    if not put.done:
        return False
    pos, quat = world.pose(name)
    there = pos + matrices_on_host(quat[None])[0] @ before
    taken = yield from grasp(world, Step("grasp", (name,)), lambda pose: float(np.linalg.norm(pose.point - there)))
    return taken.done


def _has_room(obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"], goal: Vector) -> bool:
    """Whether the hand with what it holds has room right before its place, on some side."""
    turns = np.arange(8) * (np.pi / 4)
    level = np.stack([np.cos(turns), np.sin(turns), np.zeros(8)], axis=1)
    points = goal + np.concatenate([[OVER * UP], SPARE * np.concatenate([[UP], level])])
    return any(obstacles.clear(np.column_stack([spheres[:, :3] + point, spheres[:, 3]])) for point in points)


def _drop(
    obstacles: Obstacles, spheres: Float[np.ndarray, "S 4"], goal: Vector, drops: Sequence[float], over: float = OVER
) -> float | None:
    """The least of some heights above a place at which the hand has room, and from where what it holds falls freely to
    `over` (m) above the place, m; None: there is none."""
    held = spheres[spheres[:, 3] < HELD]
    for drop in drops:
        if _has_room(obstacles, spheres, goal + drop * UP):
            free = drop <= over or straight(obstacles, held, goal + drop * UP, goal + over * UP)
            return drop if free else None
    return None


def bring_out(world: PlannedWorld, name: str) -> Primitive:
    """Puts an object onto open floor of the room where it is."""
    if name not in world.held:
        taken = yield from grasp(world, Step("grasp", (name,)))
        if not taken.done:
            return taken
    return (yield from place("on_floor")(world, Step("place_on_floor", (name, world.facts.room(name)))))


def let_fall(world: PlannedWorld, name: str, hand: int, tilt: Rotation) -> Generator[Program, str, bool]:
    """Lets what a hand holds fall over on open floor, tilted from how it is held now; returns whether it did."""
    for _ in range(ATTEMPTS):
        spots = spots_for(world, "on_floor", name, world.facts.room(name), hanging=tilt)
        found = _plan(world, "on_floor", name, hand, spots)
        if isinstance(found, str):
            return False
        stance, spot = found
        yaw = world.base[1]
        if (yield from go(world, stance)) or name not in world.held:
            return False
        planned = yield from from_home(world, hand, functools.partial(way_to_spot, world, name, hand, spot))
        if planned is not None:
            yield from letting_go(world, name, hand, planned, falls=True)
            return name not in world.held
        turn = about_vertical(world.base[1] - yaw)
        tilt = turn @ tilt @ turn.T
    return False


_NO_SPOT, _NO_STANCE = "there is no room for a place where", "no free floor is in reach of a place where"
_NO_WAY = "the hand has no path to a place where"


def _lacking(found: str) -> str:
    """The reason of a failure whose words these are."""
    return "no_path" if found == _NO_WAY else "no_base"


def _plan(
    world: PlannedWorld, predicate: str, name: str, hand: int, proposed: Iterable[Spot], search: bool = False
) -> tuple[Stance, Spot] | str:
    """A stance and a pose of the object's main body, of those with a way for the hand; else what is lacking.

    Args:
      proposed: spots. search: ways are searched for where via points find none.
    """
    obstacles, floor = world.obstacles([name], stays=False), world.floor()
    lacking, seen, floats = _NO_SPOT, list[Stance](), world.body.opening is None

    def spots() -> Iterator[tuple[Spot, Vector, np.ndarray]]:
        """Spots with room for the hand, with its grasp point and spheres; those above which the object is dropped come
        later, and those that are open above, and that the hand cannot be let down to, at last."""
        nonlocal lacking
        later, last = [], []
        for spot in proposed:
            target, _, _ = grip_for(world, hand, name, spot)
            spheres = spheres_at(world, name, hand, spot)
            lacking = _NO_WAY if lacking == _NO_SPOT else lacking
            drop = _drop(obstacles, spheres, target + LET_GO * UP, DROPS[predicate], TIGHT if spot.tight else OVER)
            if drop is None:
                continue
            target = target + drop * UP
            found, over = (dataclasses.replace(spot, drop=drop), target, spheres), target + (LET_GO + OVER) * UP
            if drop > 0.0:
                later.append(found)
            elif predicate == "inside" and not spot.roofed and not straight(obstacles, spheres, over + DEEP * UP, over):
                last.append(found)
            else:
                yield found
        yield from sorted(later, key=lambda found: found[0].drop)
        yield from last

    def candidates() -> Iterator[tuple[Stance, Spot]]:
        nonlocal lacking
        for spot, target, spheres in spots():
            lacking = _NO_STANCE if lacking == _NO_WAY and not seen else lacking
            palm = world.hand_axes(hand, grip_for(world, hand, name, spot)[2])[1]
            away = world.away(spheres, palm)
            if predicate == "under" and floats:
                away = max(away, UNDER)
            count = 0
            for stance in stances(world, hand, target, floor, away, most=STANCES if floats else AROUND):
                lacking = _NO_WAY
                if points_ahead(world, palm, stance.yaw):
                    seen.append(stance)
                    yield stance, spot
                    count += 1
                if count == STANCES:
                    break

    has_way = functools.partial(_has_way, world, name, hand, obstacles)
    return first_way(candidates(), has_way, _ways(world, predicate, name), search) or lacking


def _plan_over_mouth(world: PlannedWorld, name: str, hand: int, where: str) -> tuple[Stance, Spot] | None:
    """As `_plan`, of a gripper that lets go over the mouth of a container; None: there is no such way."""
    obstacles = world.obstacles([name], stays=False)
    proposed = over_mouth(world, name, hand, where, obstacles, world.floor())
    has_way = functools.partial(_has_way, world, name, hand, obstacles)
    return first_way(proposed, has_way, _ways(world, "inside", name), search=False)


def _ways(world: PlannedWorld, predicate: str, name: str) -> int:
    """Ways of a hand that are looked for, at most."""
    if world.body.opening is None:
        return WAYS
    return max(FEWEST_WAYS, ARM_WAYS // (1 + world.missed[f"{predicate} {name}"]))


def _has_way(
    world: PlannedWorld, name: str, hand: int, obstacles: Obstacles, candidate: tuple[Stance, Spot], search: bool
) -> bool:
    """Whether the hand has a way to a spot from a stance."""
    stance, spot = candidate
    target, quat, _ = grip_for(world, hand, name, spot)
    spheres = spheres_at(world, name, hand, spot)
    back, standing = entries_to(spot, stance.yaw), world.standing(obstacles, stance, hand)
    start = turning_point(standing, spheres, world.carried(hand, stance), stance.yaw)
    follows = world.follows(hand, quat, standing, stance)
    goal = target + (LET_GO + spot.drop) * UP
    return hand_path(standing, spheres, start, goal, back, SPARE, search, follows, turns=True) is not None
