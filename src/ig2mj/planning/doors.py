"""Doors between rooms that are shut in a robot's way, found by the search for a way."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
from jaxtyping import Float

from ig2mj.planning.bodies import HoveringBody
from ig2mj.planning.motion_planner import NEAR_START
from ig2mj.planning.moves import Primitive
from ig2mj.planning.occupancy import door_objects
from ig2mj.planning.opening import joints_of
from ig2mj.planning.steps import Step
from ig2mj.planning.world import PlannedWorld

WIDE = 0.9
"""Share of its range from which on a door between rooms counts as wide open."""

NEAR = 0.6
"""m from what a step is about that a robot without hands wants to come."""

BESIDE = 0.6
"""m between a way and the middle of a door's leaf that it leads through, at most."""


def naming_doors(world: PlannedWorld, step: Step, inner: Primitive) -> Primitive:
    """A primitive, whose failure to find floor or a way names the shut door that is in the way."""
    outcome = yield from inner
    if outcome.reason in ("no_base", "no_path") and (door := door_in_the_way(world, step)):
        return dataclasses.replace(outcome, reason="no_path", detail=f"{door} is shut in the way")
    return outcome


def door_in_the_way(world: PlannedWorld, step: Step) -> str | None:
    """The first shut door without which the robot could come near what a step is about; None: there is none."""
    names = world.domain.model.tables.object_names
    doors = [int(d) for d in door_objects(world.domain.model.tables) if not _is_wide(world, names[d])]
    point = _target(world, step) if doors else None
    if point is None:
        return None
    here, _ = world.base
    floor, reach = world.floor(), world.body.reach if isinstance(world.body, HoveringBody) else NEAR
    cells = floor.within(point[:2], reach)
    if np.isfinite(floor.distances(here, NEAR_START)[tuple(cells.T)]).any():
        return None
    held = [world.index(n) for n in world.held if n and not world.domain.fixed(n)]
    freed = world.planner.floor(world.view, without=[*held, *doors], world=world.world)
    cells = freed.within(point[:2], reach)
    away = freed.distances(here, NEAR_START)[tuple(cells.T)]
    if not np.isfinite(away).any():
        return None
    way = freed.way(here, freed.occupancy.middles(cells[int(np.argmin(away))]))
    if way is None:
        return None
    lines = [(a, b, max(2, int(np.linalg.norm(b - a) / 0.05))) for a, b in itertools.pairwise(way)]
    points = np.concatenate([np.linspace(a, b, count) for a, b, count in lines])
    passed: list[tuple[int, str]] = []
    for door in doors:
        leaf = np.concatenate([j.vertices for j in joints_of(world, names[door])])[:, :2].mean(0)
        near = np.flatnonzero(np.linalg.norm(points - leaf, axis=1) < BESIDE)
        if len(near):
            passed.append((int(near[0]), names[door]))
    return min(passed)[1] if passed else None


def _is_wide(world: PlannedWorld, door: str) -> bool:
    return all(j.fraction >= WIDE for j in joints_of(world, door))


def _target(world: PlannedWorld, step: Step) -> Float[np.ndarray, "3"] | None:
    """What a step is about: what it acts on, or where what is held goes; None: where the robot is, or anywhere."""
    names = world.domain.model.tables.object_names
    tables = world.domain.model.tables
    for name in step.arguments:
        if name in names and name not in world.held and not tables.object_is_floor[world.index(name)]:
            return world.com(name)
    return None
