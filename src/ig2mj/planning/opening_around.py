"""Doors and drawers that are in the way of a hand: which of those around a thing, or of a container, are moved."""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Generator

import numpy as np

from ig2mj.planning.joints import AJAR, OPEN_TO, OpenableJoint
from ig2mj.planning.moves import Program, free_hand
from ig2mj.planning.opening import MOVED, joints_of, move_joint, progress
from ig2mj.planning.world import PlannedWorld

WIDE, FAR_OUT, TRIES = 0.5, 0.8, 2
"""Shares of their ranges from which on a door, and a drawer, is not in the way of a hand, and times that it is moved
out of the way."""

AT_END = 0.9
"""Share of its range from which on a door is not opened further: at last it is opened to its end, where its leaf stands
next to what it shuts and leaves the robot room in front of that."""

Tried = collections.Counter[str]
"""How often joints were moved out of the way in vain, by their names."""


def open_around(world: PlannedWorld, name: str, tried: Tried) -> Generator[Program, str, bool]:
    """Opens the drawer that an object is in, else doors in front of it, the nearest first; shuts drawers above one that
    it is in, first for hands that float, and where all are open, drawers that it is not in. Returns whether there was
    one that has not been tried `TRIES` times, and a free hand."""
    return (yield from _move(world, _in_front(world, name, tried), tried))


def bars(world: PlannedWorld, name: str, tried: Tried) -> bool:
    """Whether there is a joint that `open_around` would move with a free hand."""
    return _in_front(world, name, tried) is not None


@dataclasses.dataclass(frozen=True, eq=False)
class _Move:
    """A joint, whether it is opened, else it is shut, to which share of its range, and the name under which tries of
    this are counted."""

    joint: OpenableJoint
    opens: bool
    to: float
    key: str


def _in_front(world: PlannedWorld, name: str, tried: Tried) -> _Move | None:
    near, facts = world.com(name), world.facts
    containers = [c for c in facts.containers(name) if world.domain.opens(c)]
    found = [j for c in containers for j in joints_of(world, c)]
    for other in world.domain.openable:  # what is in a drawer that is pulled out far may not count as inside
        low, high = facts.box(other)
        if other not in (name, *containers) and (low <= near).all() and (near <= high).all():
            own = joints_of(world, other)
            found += own if any(not j.hinge and j.surrounds(near) for j in own) else []
    found.sort(key=lambda j: float(np.linalg.norm(j.vertices.mean(0) - near)))
    around = [j for j in found if not j.hinge and j.surrounds(near)]
    opened = around or [j for j in found if j.hinge] or found
    others = [j for j in found if not j.hinge and j not in around]
    above = [j for j in others if float(j.vertices[:, 2].min()) > float(near[2])]
    first = bool(around) and world.body.opening is None
    return _one(opened, above if around else others, tried, closes_first=first)


def open_into(world: PlannedWorld, where: str, tried: Tried) -> Generator[Program, str, bool]:
    """Opens a door or drawer of a container, the largest first, after those that were open without one above them had
    no place; shuts drawers above it before. Arguments and result as of `open_around`."""
    return (yield from _move(world, _into(world, where, tried), tried))


def is_shut(world: PlannedWorld, where: str, tried: Tried) -> bool:
    """Whether there is a joint that `open_into` would move with a free hand."""
    return _into(world, where, Tried(tried)) is not None


def _into(world: PlannedWorld, where: str, tried: Tried) -> _Move | None:
    """What `open_into` moves; drawers that are open without one above them count as full in `tried`."""
    found = joints_of(world, where) if world.domain.opens(where) else []
    out = [j for j in found if not j.hinge and j.fraction > AJAR]
    for joint in out:
        tried[f"{joint.name} full"] += not any(o.is_above(joint) for o in out)
    left = [j for j in found if j.hinge or not tried[f"{j.name} full"]]
    for joint in [j for j in left if not j.hinge][:1]:
        above = [o for o in out if o.is_above(joint)]
        if (move := _one([joint], above, tried, closes_first=True)) is not None:
            return move
    return _one(left, [], tried)


def _one(
    opened: list[OpenableJoint], closed: list[OpenableJoint], tried: Tried, closes_first: bool = False
) -> _Move | None:
    """The first that is not wide open, to be opened, else the first that is open, to be shut, else a door that is to be
    opened to its end; `closes_first`: shuts before it opens, as below an open drawer hands have little room."""
    shut = [j for j in opened if j.fraction < (WIDE if j.hinge else FAR_OUT) and tried[j.name] < TRIES]
    out = [j for j in closed if j.fraction > AJAR and tried[f"{j.name} shut"] < TRIES]
    wider = [j for j in opened if j.hinge and WIDE <= j.fraction < AT_END and tried[f"{j.name} wider"] < TRIES]
    if not shut and not out and not wider:
        return None
    if out and (not shut or closes_first):
        return _Move(out[0], False, 0.0, f"{out[0].name} shut")
    return _Move(shut[0], True, OPEN_TO, shut[0].name) if shut else _Move(wider[0], True, 1.0, f"{wider[0].name} wider")


def _move(world: PlannedWorld, found: _Move | None, tried: Tried) -> Generator[Program, str, bool]:
    """Moves what `_one` found, where a hand is free; returns whether it tried to."""
    if found is None or all(world.held):
        return False
    joint, opens, key = found.joint, found.opens, found.key
    yield from move_joint(world, joint, free_hand(world, tried[key]), opens, tried[key], found.to)
    now = {j.name: j.fraction for j in joints_of(world, joint.object)}
    tried[key] += progress(joint, now, opens) < MOVED  # else the same way again, from where it is now
    return True
