"""What is seen from a point: rays against the geoms of a model. Hidden groups and, by default, glass let them pass.

Axes: N points, K geoms.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.scene.geom_groups import HIDDEN_GROUP, VISIBLE_GROUPS

NEAREST = 1e-9
"""m: a point that is nearer to the eye than this has no direction."""

_INSET = 0.9
"""Share of a geom's box at which its faces are sampled: what is drawn of a rounded geom fills no more of them."""

_FACES = np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)]) * _INSET


class SightLines:
    """Rays in the states of one model."""

    def __init__(self, model: mujoco.MjModel, through_glass: bool = True):
        """A copy of the model is kept in which see-through geoms are hidden, unless glass stops rays."""
        self._model = copy.copy(model)
        materials = model.geom_matid
        alpha = model.geom_rgba[:, 3].copy()
        if model.nmat:
            alpha = np.where(materials >= 0, np.minimum(alpha, model.mat_rgba[np.maximum(materials, 0), 3]), alpha)
        if through_glass:
            self._model.geom_group[alpha < 1.0] = HIDDEN_GROUP
        self._groups = np.isin(np.arange(mujoco.mjNGROUP), VISIBLE_GROUPS).astype(np.uint8)
        self.opaque = np.isin(self._model.geom_group, VISIBLE_GROUPS)
        """bool [geoms]: which geoms stop a ray."""

    def cast(
        self, data: mujoco.MjData, eye: Float[np.ndarray, "3"], directions: Float[np.ndarray, "N 3"]
    ) -> tuple[Int[np.ndarray, "N"], Float[np.ndarray, "N"]]:
        """The geom that each ray meets first (-1: none), and how far from the eye, m (infinite where none is met).

        Args:
          data: with up-to-date positions. eye: world frame, m. directions: unit vectors, world frame.
        """
        count = len(directions)
        geoms, far = np.full(count, -1, np.int32), np.full(count, -1.0)
        if count:
            rays = np.ascontiguousarray(directions, np.float64).ravel()
            start = np.asarray(eye, np.float64)
            mujoco.mj_multiRay(
                self._model, data, start, rays, self._groups, 1, -1, geoms, far, None, count, mujoco.mjMAXVAL
            )
        return geoms, np.where(geoms >= 0, far, np.inf)

    def towards(
        self, data: mujoco.MjData, eye: Float[np.ndarray, "3"], points: Float[np.ndarray, "N 3"]
    ) -> tuple[Int[np.ndarray, "N"], Float[np.ndarray, "N"]]:
        """As `cast`, with rays from the eye through points. They do not end at the points."""
        lines = np.asarray(points, np.float64) - eye
        return self.cast(data, eye, lines / np.maximum(np.linalg.norm(lines, axis=1, keepdims=True), NEAREST))


def surface_points(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: Int[np.ndarray, "K"]
) -> Float[np.ndarray, "K 7 3"]:
    """Centre of each geom's box and points just below the middles of its faces, world frame, m."""
    local = model.geom_aabb[geoms, None, :3] + _FACES * model.geom_aabb[geoms, None, 3:]
    turned = np.einsum("kij,knj->kni", data.geom_xmat[geoms].reshape(-1, 3, 3), local)
    return data.geom_xpos[geoms, None] + turned
