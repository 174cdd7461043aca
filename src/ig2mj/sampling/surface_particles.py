"""Places for dust and stains on an object's surface, drawn on the host.

Points are spread evenly by area over the outside of the collision pieces of all bodies of the object, where the surface
does not face down by more than 45 degrees below the horizontal: iGibson's limit of 135 degrees to the vertical
(spec/states.md 8.2).
"""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.surface import sample_surface, surface_table, uncovered
from ig2mj.scene.tables import SceneTables
from ig2mj.states.particles import NUM_PARTICLES

STEEPEST = np.cos(np.deg2rad(135.0))
"""Smallest z of a normal that takes a particle."""

TRIES = 40
"""Points drawn for each particle wanted."""


@dataclasses.dataclass(frozen=True)
class SurfacePlaces:
    """Places of N particles in the frames of bodies; arguments of `dust.set_dusty` and `stain.set_stained`."""

    body: Int[np.ndarray, "1 N"]
    pos: Float[np.ndarray, "1 N 3"]
    normal: Float[np.ndarray, "1 N 3"]
    valid: Bool[np.ndarray, "1 N"]


def sample_places(
    tables: SceneTables, view: PhysicsView, obj: int, rng: np.random.Generator, world: int = 0
) -> SurfacePlaces:
    """Draws the places of all particles of one object as it stands in a world; fewer are valid where few exist."""
    found: list[tuple[int, np.ndarray, np.ndarray]] = []
    bodies, surfaces = _surfaces(tables, obj)
    if surfaces:
        areas = np.array([s.area for s in surfaces])
        counts = rng.multinomial(TRIES * NUM_PARTICLES, areas / areas.sum())
        for body, surface, count in zip(bodies, surfaces, counts, strict=True):
            k = np.flatnonzero((tables.piece_object == obj) & (tables.piece_body == body))
            shape = (tables.piece_kind[k], tables.piece_size[k], tables.piece_planes[k])
            sample = uncovered(
                sample_surface(surface, int(count), rng), *shape, tables.piece_pos[k], tables.piece_quat[k]
            )
            up = sample.normals @ _third_row(np.asarray(view.body_quat)[world, body])
            found += [(body, p, n) for p, n, z in zip(sample.points, sample.normals, up, strict=True) if z >= STEEPEST]
    order = rng.permutation(len(found))[:NUM_PARTICLES]
    body, pos = np.zeros((1, NUM_PARTICLES), np.int32), np.zeros((1, NUM_PARTICLES, 3), np.float32)
    normal, valid = np.zeros_like(pos), np.zeros((1, NUM_PARTICLES), bool)
    for n, i in enumerate(order):
        body[0, n], pos[0, n], normal[0, n], valid[0, n] = *found[i], True
    return SurfacePlaces(body, pos, normal, valid)


def _surfaces(tables: SceneTables, obj: int) -> tuple[list[int], list]:
    bodies = np.unique(tables.piece_body[tables.piece_object == obj]).tolist()
    columns = (tables.piece_kind, tables.piece_size, tables.piece_vertices, tables.piece_pos, tables.piece_quat)
    rows = [(tables.piece_object == obj) & (tables.piece_body == b) for b in bodies]
    return bodies, [surface_table(*(c[row] for c in columns)) for row in rows]


def _third_row(quat: Float[np.ndarray, "4"]) -> Float[np.ndarray, "3"]:
    """World z as seen from the body: the dot product with a body vector is that vector's world z."""
    w, x, y, z = (float(q) for q in quat)
    return np.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
