"""Water sources as a robot uses them: where the water comes out, room below it, and what is held there."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

import numpy as np

from ig2mj.planning.grasping import held_again, put_down_others
from ig2mj.planning.holding import Hold, hold_at, wait_until
from ig2mj.planning.moves import Primitive, Program, carry, hand_with, travel
from ig2mj.planning.placing import bring_out, regrasp
from ig2mj.planning.steps import Outcome
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.scene.tables import LinkKind


def source_of(world: PlannedWorld, tap: str) -> Vector:
    """Where water comes out of a tap, m, world frame."""
    tables = world.domain.model.tables
    links = np.flatnonzero((tables.link_object == world.index(tap)) & (tables.link_kind == LinkKind.WATER_SOURCE))
    return np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)


def hold_below_tap(
    world: PlannedWorld,
    name: str,
    tap: str,
    holds: Callable[[int, Vector], Sequence[Hold]],
    condition: tuple[str, ...],
    seconds: float,
) -> Primitive:
    """Holds an object below a tap that runs, in one way after another, until a predicate holds.

    Args:
      holds: ways of holding it, from the number of the hand and where the water comes out (m, world frame).
      condition: the predicate and its arguments. seconds: for which each way is held, at most.
    """
    hand, source = hand_with(world, name), source_of(world, tap)
    reason, failed, again, moved = "", set[int](), False, set[str]()
    for attempt in range(WAYS + MOST_MOVED + 1):
        if not (yield from held_again(world, name)):
            return Outcome("slipped", f"the hand lost {name}", attempts=attempt)
        hand = hand_with(world, name)
        left = lambda hand=hand: [h for h in holds(hand, source) if h.number not in failed]  # noqa: E731
        reason, way, number = yield from hold_at(world, name, hand, left)
        if reason == "slipped" and name not in world.held:
            continue
        if number < 0 and (yield from others_brought_out(world, name)):
            continue
        if number < 0 and ((yield from clear_basin(world, source, moved)) or name not in world.held):
            continue
        if number < 0 and not again and (yield from regrasp(world, name, hand)):  # by another side
            again = True
            continue
        if number < 0:
            return Outcome(reason, f"the hand has no way with {name} below {tap}")
        reason = reason or (yield from wait_until(world, condition, seconds, world.index(name)))
        if name in world.held:
            yield [*travel(hand, way[-2::-1], None), carry(world, hand)]
        if world.facts.holds(*condition):
            return Outcome()
        failed.add(number)
    return Outcome(reason or "not_true_after", f"{name} did not take enough water")


def others_brought_out(world: PlannedWorld, name: str) -> Generator[Program, str, bool]:
    """Where no hand is free, puts what others hold than an object onto open floor: it is in the way as well. Returns
    whether there was such a thing, and a hand is free."""
    others = [n for n in world.held if n and n != name] if all(world.held) else []
    for other in others:
        yield from bring_out(world, other)
    yield from put_down_others(world, name)
    return bool(others) and not all(world.held)


WAYS = 3
"""Ways of holding an object below a tap that are tried."""


def clear_basin(world: PlannedWorld, source: Vector, moved: set[str]) -> Generator[Program, str, bool]:
    """Puts what stands or lies below a source of water, the nearest first, onto open floor; returns whether it did."""
    if len(moved) == MOST_MOVED or all(world.held):
        return False
    near = list[tuple[float, str]]()
    for other in world.domain.loose:
        if other in world.held or other in moved or not world.domain.graspable(other):
            continue
        low, high = world.facts.box(other)
        apart = float(np.linalg.norm(source[:2] - np.clip(source[:2], low[:2], high[:2])))
        if apart < BASIN and low[2] < source[2] and high[2] > source[2] - DEPTH:
            near.append((apart, other))
    if not near:
        return False
    moved.add(min(near)[1])
    return (yield from bring_out(world, min(near)[1])).done


BASIN, DEPTH, MOST_MOVED = 0.25, 0.5, 3
"""m, horizontal, from a source of water, and below it, within which things are put elsewhere where nothing else can be
held below it, and how many."""
