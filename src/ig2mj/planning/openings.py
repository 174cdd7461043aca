"""Where substances enter and leave objects, as a robot sees it: openings of containers, and points of surfaces.

Axes: R corners of a rim, D objects that can be covered, N points of a surface.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.planning.clearance import straight
from ig2mj.planning.world import PlannedWorld, Vector
from ig2mj.states.substances.model import of

FREE = (0.03, 0.2)
"""m above a point of a surface between which a stream must not meet anything else."""

THICK = 0.005
"""m, radius of a stream there."""


@dataclasses.dataclass(frozen=True, eq=False)
class Opening:
    """Of a container, world frame: middle (m), unit normal that points out, and corners (m)."""

    centre: Vector
    normal: Vector
    rim: Float[np.ndarray, "R 3"]


def opening_of(world: PlannedWorld, name: str) -> Opening:
    """The opening of a container."""
    containers = of(world.domain.model).containers
    row = containers.row_of(world.index(name))
    assert row is not None, name
    body = int(containers.body[row])
    turn = matrices_on_host(np.asarray(world.view.body_quat)[world.world, body][None])[0]
    pos = np.asarray(world.view.body_pos)[world.world, body].astype(float)
    return Opening(
        turn @ containers.centre[row] + pos, turn @ containers.normal[row], containers.rim[row] @ turn.T + pos
    )


@dataclasses.dataclass(frozen=True, eq=False)
class Surfaces:
    """The points of all objects that substances can cover, world frame: where they are (m), and unit normals."""

    points: Float[np.ndarray, "D N 3"]
    normals: Float[np.ndarray, "D N 3"]


def surfaces(world: PlannedWorld) -> Surfaces:
    """Where the points of all objects are now."""
    found, number = of(world.domain.model), world.world
    turn = matrices_on_host(np.asarray(world.view.body_quat)[number])[found.body]
    pos = np.asarray(world.view.body_pos)[number].astype(float)[found.body]
    return Surfaces(np.einsum("dnij,dnj->dni", turn, found.pos) + pos, np.einsum("dnij,dnj->dni", turn, found.normal))


def free_points(world: PlannedWorld, name: str, least: float) -> Float[np.ndarray, "N 3"]:
    """Points of an object's surface that substances can cover and that lie open above, m, world frame; the nearest to
    the robot first, and at last its top above its centre of mass, for what lies upside down.

    Args:
      least: z of the normal of a point, at least.
    """
    row = int(of(world.domain.model).row[world.index(name)])
    all_points = surfaces(world)
    if row == len(all_points.points):
        return np.zeros((0, 3))
    points = all_points.points[row][all_points.normals[row, :, 2] >= least]
    obstacles = world.obstacles([name, *(n for n in world.held if n)])
    stream = np.array([[0.0, 0.0, 0.0, THICK]])
    low, high = (above * np.array([0.0, 0.0, 1.0]) for above in FREE)
    here, _ = world.base
    top = np.array([*world.com(name)[:2], world.vertices(name)[:, 2].max()])
    ordered = [*sorted(points, key=lambda p: float(np.linalg.norm(p[:2] - here))), top]
    return np.array([p for p in ordered if straight(obstacles, stream, p + low, p + high)]).reshape(-1, 3)
