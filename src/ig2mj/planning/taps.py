"""Water sources as a robot uses them: where the water comes out, and room below it."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ig2mj.planning.moves import Program
from ig2mj.planning.placing import bring_out
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.scene.tables import LinkKind


def source_of(world: PlannedWorld, tap: str) -> Vector:
    """Where water comes out of a tap, m, world frame."""
    tables = world.domain.model.tables
    links = np.flatnonzero((tables.link_object == world.index(tap)) & (tables.link_kind == LinkKind.WATER_SOURCE))
    return np.asarray(world.view.link_pos)[world.world, links[0]].astype(float)


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
