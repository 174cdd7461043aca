"""`Household`: boxes of a home's geometry at its start, and what follows from them of furniture and free floor.

Axis: N points.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.geometry.poses import quat_rotate
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import LinkKind

BODY = 0.27
"""m around the middle of a robot that are free of everything between `LOW` and `HIGH` above the floor."""

LOW, HIGH = 0.06, 1.3
"""m above the floor."""

CLOSE = 0.02
"""m from an object within which it is next to another: the wall that a board is fixed to, the floor of a table."""

SITS = 0.05
"""m: fixed things no higher than this, such as carpets, are stood on."""


class Household:
    """Boxes of a home's geometry at its start, world frame, m."""

    def __init__(self, scene: Scene):
        data, model, tables = scene.start_data(), scene.model, scene.tables
        turn = data.geom_xmat.reshape(-1, 3, 3)
        middle = data.geom_xpos + np.einsum("gij,gj->gi", turn, model.geom_aabb[:, :3])
        half = np.einsum("gij,gj->gi", np.abs(turn), model.geom_aabb[:, 3:])
        solid = ((model.geom_contype > 0) | (model.geom_conaffinity > 0)) & (
            model.geom_type != int(mujoco.mjtGeom.mjGEOM_PLANE)
        )
        self.scene, self.categories = scene, list(tables.object_categories)
        self.low, self.high = middle - half, middle + half
        self.owner = np.where(solid, tables.geom_object, -2)
        self.fixed, self._data = tables.object_fixed, data

    def of(self, category: str) -> list[str]:
        """Names of the fixed objects of a category."""
        names = enumerate(self.scene.object_names)
        return [name for k, name in names if self.categories[k] == category and self.fixed[k]]

    def box(self, name: str) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Lowest and highest corner of an object."""
        own = self.owner == self.scene.object_index(name)
        return self.low[own].min(0), self.high[own].max(0)

    def next_to(self, name: str) -> str:
        """Categories of fixed objects whose boxes are within `CLOSE` of an object's, and on which side of it."""
        low, high = self.box(name)
        below, above = low - self.high, self.low - high
        apart = np.maximum(below, above)
        close = (self.owner >= 0) & (np.linalg.norm(np.maximum(0.0, apart), axis=1) < CLOSE)
        close &= self.fixed[self.owner] & (self.owner != self.scene.object_index(name))
        found = set[str]()
        for geom in np.flatnonzero(close):
            axis = int(np.argmax(apart[geom]))
            side = "+" if above[geom, axis] > below[geom, axis] else "-"
            found.add(f"{self.categories[self.owner[geom]]} at {side}{'xyz'[axis]}")
        return " and ".join(sorted(found)) or "nothing"

    def link(self, name: str, kind: LinkKind) -> Float[np.ndarray, "3"] | None:
        """Where an object's first annotated link of a kind is; None: it has none."""
        tables = self.scene.tables
        found = np.flatnonzero((tables.link_object == self.scene.object_index(name)) & (tables.link_kind == kind))
        if not len(found):
            return None
        body, own = int(tables.link_body[found[0]]), tables.link_pos[found[0]]
        turned = np.asarray(quat_rotate(np.array(self._data.xquat[body], np.float32), np.array(own, np.float32)))
        return self._data.xpos[body] + turned

    def facing(self, name: str) -> int | None:
        """Quarters by which the front of an object is turned from x; None: it stands askew."""
        root = int(self.scene.tables.object_root[self.scene.object_index(name)])
        front = self._data.xmat[root].reshape(3, 3)[:, 0]
        quarter = round(math.atan2(front[1], front[0]) / (math.pi / 2)) % 4
        return quarter if front @ axes_of(quarter)[0] > 0.99 else None

    def free(self, points: Float[np.ndarray, "N 2"], floor: float) -> Bool[np.ndarray, "N"]:
        """Whether a robot has room there."""
        high, low = self.high[:, 2] - floor, self.low[:, 2] - floor
        near = (self.owner > -2) & (high > LOW) & (low < HIGH)
        near &= ((self.high[:, :2] > points.min(0) - BODY) & (self.low[:, :2] < points.max(0) + BODY)).all(1)
        if not near.any():
            near[0] = True
        gap = np.maximum(self.low[near, :2] - points[:, None], points[:, None] - self.high[near, :2])
        clear = np.linalg.norm(np.maximum(gap, 0.0), axis=-1).min(1) >= BODY
        rooms = self.scene.rooms
        return clear if rooms is None else clear & (rooms.index_at(points) >= 0)

    def floor(self, point: Float[np.ndarray, "2"]) -> float:
        """m above the floor of what is stood on there."""
        under = (self.owner >= 0) & (self.high[:, 2] < SITS)
        under &= (self.low[:, :2] <= point).all(1) & (self.high[:, :2] >= point).all(1)
        return float(max(0.0, *self.high[under, 2], 0.0))


def axes_of(quarter: int) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Directions ahead and to the left of a robot that is turned by so many quarters."""
    x, y = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarter % 4]
    return np.array([x, y, 0.0]), np.array([-y, x, 0.0])
