"""Positions for dust and stains on an object's surface, sampled on the host.

Points are spread evenly by area over the outside of the collision pieces of all bodies of the object, where the surface
does not face down by more than 45 degrees below the horizontal: iGibson's limit of 135 degrees to the vertical
(iGibson's particles.py). Floors get them on top only, because their sides are under the house.

Points that can be seen come first: a line leads from them past the object and what is fixed around it to 10 cm outside
of the object's box, where iGibson's rays begin. Behind a closed door, inside of a body and at a wall nothing gets dirty
while there is other surface.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.geometry.surface import object_surfaces, sample_surface, uncovered
from ig2mj.sampling.sight import Sight
from ig2mj.scene.tables import SceneTables
from ig2mj.states.particles import NUM_PARTICLES

STEEPEST = np.cos(np.deg2rad(135.0))
"""Smallest z of a normal that takes a particle."""

TOP = np.cos(np.deg2rad(45.0))
"""The same of floors."""

VERSION = 2
"""Of the rule; start states with dust or stains are kept under it."""

TRIES = 40
"""Points drawn for each requested particle."""


@dataclasses.dataclass(frozen=True)
class SurfacePlaces:
    """Places of N particles in the frames of bodies; arguments of `Dirt.place`."""

    body: Int[np.ndarray, "1 N"]
    pos: Float[np.ndarray, "1 N 3"]
    normal: Float[np.ndarray, "1 N 3"]
    valid: Bool[np.ndarray, "1 N"]


def sample_places(
    tables: SceneTables, view: PhysicsView, obj: int, rng: np.random.Generator, world: int = 0
) -> SurfacePlaces:
    """Draws the places of all particles of one object as it stands in a world; fewer are valid where few exist."""
    found: list[tuple[int, np.ndarray, np.ndarray]] = []
    least = TOP if tables.object_is_floor[obj] else STEEPEST
    surfaces = object_surfaces(tables, obj)
    if surfaces:
        areas = np.array([s.area for s in surfaces.values()])
        counts = rng.multinomial(TRIES * NUM_PARTICLES, areas / areas.sum())
        for (body, surface), count in zip(surfaces.items(), counts, strict=True):
            k = np.flatnonzero((tables.piece_object == obj) & (tables.piece_body == body))
            shape = (tables.piece_kind[k], tables.piece_size[k], tables.piece_planes[k])
            sample = uncovered(
                sample_surface(surface, int(count), rng), *shape, tables.piece_pos[k], tables.piece_quat[k]
            )
            up = sample.normals @ matrices_on_host(np.asarray(view.body_quat)[world, [body]])[0, 2]
            found += [(body, p, n) for p, n, z in zip(sample.points, sample.normals, up, strict=True) if z >= least]
    order = _seen_first(tables, view, world, obj, found, rng.permutation(len(found)))
    body, pos = np.zeros((1, NUM_PARTICLES), np.int32), np.zeros((1, NUM_PARTICLES, 3), np.float32)
    normal, valid = np.zeros_like(pos), np.zeros((1, NUM_PARTICLES), bool)
    for n, i in enumerate(order):
        body[0, n], pos[0, n], normal[0, n], valid[0, n] = *found[i], True
    return SurfacePlaces(body, pos, normal, valid)


def _seen_first(
    tables: SceneTables,
    view: PhysicsView,
    world: int,
    obj: int,
    found: list[tuple[int, np.ndarray, np.ndarray]],
    order: Int[np.ndarray, "n"],
) -> list[int]:
    """Numbers of the first `NUM_PARTICLES` points of an order that can be seen, then of others."""
    sight = Sight(tables, view, obj, world)
    seen, hidden = list[int](), list[int]()
    for i in order.tolist():
        (seen if sight.reaches(*found[i]) else hidden).append(i)
        if len(seen) == NUM_PARTICLES:
            break
    return [*seen, *hidden][:NUM_PARTICLES]
