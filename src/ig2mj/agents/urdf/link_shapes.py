"""`LinkShapes`: collision geometry of a robot's links, and distances between them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import mujoco
import numpy as np

ROUND = (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE)

EDGE_POINTS = 11
"""Of each line between two corners of a shape, its ends among them."""

SIGNS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


class LinkShapes:
    """Collision geometry of a robot that is compiled alone.

    Attributes:
      model: compiled. base: the root link.
    """

    def __init__(self, model: mujoco.MjModel, base: str, name_of_body: Callable[[str], str]):
        """name_of_body: gives the name of a link's body."""
        self.model, self.base, self._name_of_body = model, base, name_of_body

    def _body(self, link: str) -> int:
        return self.model.body(self._name_of_body(link)).id

    def has_shape(self, link: str) -> bool:
        """It collides."""
        body = self._body(link)
        return bool(np.any((self.model.geom_bodyid == body) & (self.model.geom_contype > 0)))

    def box(self, link: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre and half size [3] of the collision geometry in the link's frame; m."""
        model, corners = self.model, []
        body = self._body(link)
        for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype > 0)):
            centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            matrix = turn.reshape(3, 3)
            middle, reach = model.geom_pos[geom] + matrix @ centre, np.abs(matrix) @ half
            corners += [middle - reach, middle + reach]
        if not corners:
            return np.zeros(3), np.full(3, 0.01)
        low, high = np.min(corners, 0), np.max(corners, 0)
        return (low + high) / 2, (high - low) / 2

    def points(self, link: str) -> np.ndarray:
        """Corners [n, 3] of a link's collision geometry, in its frame, m: vertices of meshes, corners of the boxes
        round other shapes; of spheres the ends of their axes."""
        return np.concatenate([np.zeros((0, 3)), *self._corners(link)])

    def edge_points(self, link: str) -> np.ndarray:
        """Points [n, 3] on and in a link's collision geometry, in its frame, m: `EDGE_POINTS` on each line between two
        corners of a shape."""
        shares, found = np.linspace(0, 1, EDGE_POINTS)[:, None, None], [self.points(link)]
        for corners in self._corners(link):
            one, two = np.triu_indices(len(corners), 1)
            found.append((corners[one] + shares * (corners[two] - corners[one])).reshape(-1, 3))
        return np.concatenate(found)

    def _corners(self, link: str) -> list[np.ndarray]:
        """See `points`: of each shape."""
        model, found = self.model, []
        body = self._body(link)
        for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype > 0)):
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            mesh = int(model.geom_dataid[geom])
            if mesh >= 0:
                first = model.mesh_vertadr[mesh]
                corners = np.array(model.mesh_vert[first : first + model.mesh_vertnum[mesh]], float)
            elif mujoco.mjtGeom(int(model.geom_type[geom])) == mujoco.mjtGeom.mjGEOM_SPHERE:
                corners = np.concatenate([np.eye(3), -np.eye(3)]) * model.geom_size[geom, 0]
            elif mujoco.mjtGeom(int(model.geom_type[geom])) in ROUND:
                radius, half = model.geom_size[geom, :2]
                if mujoco.mjtGeom(int(model.geom_type[geom])) == mujoco.mjtGeom.mjGEOM_CAPSULE:
                    half += radius
                around = np.arange(16) * (np.pi / 8)
                ring = np.stack([np.cos(around) * radius, np.sin(around) * radius, np.full(16, half)], 1)
                corners = np.concatenate([ring, ring * (1, 1, -1)])
            else:
                corners = SIGNS * model.geom_aabb[geom, 3:] + model.geom_aabb[geom, :3]
            found.append(model.geom_pos[geom] + corners @ turn.reshape(3, 3).T)
        return found

    def gap(self, some: Collection[str], others: Collection[str], agent: str, data: Any) -> float:
        """m between the nearest points of two groups of links, by their bodies' names in a scene. data: of `posed`."""
        fromto = np.zeros(6)
        pairs = [(one, two) for one in self._geoms(some, agent) for two in self._geoms(others, agent)]
        return min((mujoco.mj_geomDistance(self.model, data, *pair, 0.5, fromto) for pair in pairs), default=0.0)

    def free_way(
        self, sides: tuple[Collection[str], Collection[str]], agent: str, point: np.ndarray, way: np.ndarray, data: Any
    ) -> float | None:
        """m of free line through a point between two groups of links, by their bodies' names in a scene; None: it meets
        none of one group, or the point lies inside of one.

        Args:
          point: in the base's frame. way: unit vector from the first group to the second. data: of `posed`.
        """
        base = data.body(self._body(self.base))
        turn = base.xmat.reshape(3, 3)
        start, along, total = base.xpos + turn @ point, turn @ way, 0.0
        for names, direction in zip(sides, (-along, along), strict=True):
            geoms = self._geoms(names, agent)
            ahead = {g: self._ray(g, start, direction, data) for g in geoms}
            if any(at >= 0 and self._ray(g, start, -direction, data) >= 0 for g, at in ahead.items()):
                return None
            if not (hits := [at for at in ahead.values() if at >= 0]):
                return None
            total += min(hits)
        return total

    def distance_along(self, link: str, point: np.ndarray, way: np.ndarray, data: Any) -> float | None:
        """m from a point to the link's collision geometry along a unit vector, both in its frame; None: it is not met.
        data: of `posed`."""
        body = data.body(self._name_of_body(link))
        turn = body.xmat.reshape(3, 3)
        start, along = body.xpos + turn @ point, turn @ way
        hits = [self._ray(g, start, along, data) for g in self._geoms([link], self.base)]
        return min((at for at in hits if at >= 0), default=None)

    def _geoms(self, names: Collection[str], agent: str) -> list[int]:
        """Collision geoms of links, by their bodies' names in a scene."""
        bodies = {self._body(self.base if name == agent else name.removeprefix(f"{agent}_")) for name in names}
        return [
            g for g in range(self.model.ngeom) if self.model.geom_bodyid[g] in bodies and self.model.geom_contype[g] > 0
        ]

    def _ray(self, geom: int, start: np.ndarray, direction: np.ndarray, data: Any) -> float:
        """m to a geom; -1 where the ray does not meet it."""
        model, kind = self.model, mujoco.mjtGeom(int(self.model.geom_type[geom]))
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            return mujoco.mj_rayMesh(model, data, geom, start, direction)
        pos, turn = data.geom_xpos[geom], data.geom_xmat[geom]
        return mujoco.mju_rayGeom(pos, turn, model.geom_size[geom], start, direction, kind)
