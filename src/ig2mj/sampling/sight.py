"""`Sight`: whether a point of an object's surface can be seen from outside of the object, on the host.

Axes: K pieces, N planes, D directions.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.tables import PieceKind, SceneTables

OUTSIDE = 0.1
"""m outside of an object's box from where it is looked at: iGibson's `aabb_offset` of particles (particles.py)."""

DIRECTIONS = 96
"""Evenly over the sphere."""

SLANTED = 0.5
"""Smallest cosine of the angle between a normal and a line along which a point is seen."""

TOUCHING = 1e-4
"""m from a point within which what a line enters does not count: the face that the point is on."""


class Sight:
    """One object of one world, and what is fixed around it. A round piece counts as its box."""

    def __init__(self, tables: SceneTables, view: PhysicsView, obj: int, world: int = 0):
        self._pos = np.asarray(view.body_pos)[world].astype(float)
        self._turn = matrices_on_host(np.asarray(view.body_quat)[world].astype(float))
        others = np.flatnonzero(tables.object_fixed)
        pieces = np.flatnonzero((tables.piece_object == obj) | np.isin(tables.piece_object, others))
        body = tables.piece_body[pieces]
        own = matrices_on_host(tables.piece_quat[pieces])
        corners = np.einsum("kij,kvj->kvi", own, tables.piece_vertices[pieces]) + tables.piece_pos[pieces][:, None]
        corners = np.einsum("kij,kvj->kvi", self._turn[body], corners) + self._pos[body][:, None]
        low, high = corners.min(1), corners.max(1)
        mine = tables.piece_object[pieces] == obj
        self._low, self._high = low[mine].min(0) - OUTSIDE, high[mine].max(0) + OUTSIDE
        near = mine | ((low < self._high) & (high > self._low)).all(1)
        self._corners = low[near], high[near]
        normal, offset = _planes(tables, pieces[near])
        frame = self._turn[body[near]]
        self._normal = np.einsum("kij,knj->kni", frame, normal)
        self._offset = offset + np.einsum("kni,ki->kn", self._normal, self._pos[body[near]])
        self._directions = _sphere()

    def reaches(self, body: int, pos: Float[np.ndarray, "3"], normal: Float[np.ndarray, "3"]) -> bool:
        """Whether a line from a point with an outward normal, both in a body's frame, leads outside.

        pos: m.
        """
        point, out = self._turn[body] @ pos + self._pos[body], self._turn[body] @ normal
        ways = self._directions[self._directions @ out >= SLANTED]
        with np.errstate(divide="ignore", invalid="ignore"):
            length = np.where(ways > 0, (self._high - point) / ways, (self._low - point) / ways).min(1)
        ends = point + length[:, None] * ways
        low, high = np.minimum(ends.min(0), point), np.maximum(ends.max(0), point)
        near = ((self._corners[0] < high) & (self._corners[1] > low)).all(1)
        normals, left = self._normal[near], self._offset[near] - self._normal[near] @ point
        slope = normals @ ways.T
        with np.errstate(divide="ignore", invalid="ignore"):
            at = left[..., None] / slope
        first = np.where(slope < -1e-9, at, -np.inf).max(1, initial=-np.inf)
        last = np.where(slope > 1e-9, at, np.inf).min(1, initial=np.inf)
        misses = ((np.abs(slope) <= 1e-9) & (left[..., None] < 0)).any(1)
        enters = (first > TOUCHING) & (first <= last) & (first < length) & ~misses
        return bool((~enters.any(0)).any())


def _planes(tables: SceneTables, pieces: np.ndarray) -> tuple[Float[np.ndarray, "K N 3"], Float[np.ndarray, "K N"]]:
    """Half-spaces n.x <= d of pieces in the frames of their bodies; padding has n = 0 and d = 1."""
    planes = tables.piece_planes[pieces].astype(float)
    count = max(6, planes.shape[1])
    found = np.tile(np.array([0.0, 0.0, 0.0, 1.0]), (len(pieces), count, 1))
    found[:, : planes.shape[1]] = planes
    sides = np.concatenate([np.eye(3), -np.eye(3)])
    for k in np.flatnonzero(tables.piece_kind[pieces] != PieceKind.POLYHEDRON):
        found[k] = (0.0, 0.0, 0.0, 1.0)
        found[k, :6, :3], found[k, :6, 3] = sides, (tables.piece_vertices[pieces[k]] @ sides.T).max(0)
    normal = np.einsum("kij,knj->kni", matrices_on_host(tables.piece_quat[pieces]), found[..., :3])
    return normal, found[..., 3] + np.einsum("kni,ki->kn", normal, tables.piece_pos[pieces])


def _sphere() -> Float[np.ndarray, "D 3"]:
    """Directions evenly over the sphere: a spiral of the golden angle."""
    k = np.arange(DIRECTIONS) + 0.5
    z, angle = 1 - 2 * k / DIRECTIONS, np.pi * (1 + np.sqrt(5)) * k
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
