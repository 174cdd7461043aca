"""How many pairs of geoms the broad phase of a collision detection finds: boxes that overlap, one of them awake.

Counted from C MuJoCo's poses by boxes along the world's axes, it is no less than what MJX-Warp lists (oriented boxes).

Axes: C geoms that collide.
"""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Bool


class CandidatePairs:
    """Counts pairs in states of one model."""

    def __init__(self, model: mujoco.MjModel):
        self._geoms = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
        self._center = np.asarray(model.geom_aabb)[self._geoms, :3]
        self._half = np.asarray(model.geom_aabb)[self._geoms, 3:]
        self._gap = np.asarray(model.geom_margin)[self._geoms] + np.asarray(model.geom_gap)[self._geoms]
        self._tree = np.asarray(model.body_treeid)[model.geom_bodyid[self._geoms]]
        self._allowed = _allowed(model, self._geoms)

    def count(self, data: mujoco.MjData) -> int:
        """Pairs in the present poses, of which at least one belongs to a tree that is awake."""
        awake = (self._tree >= 0) & (data.tree_asleep[np.maximum(self._tree, 0)] < 0) if len(data.tree_asleep) else None
        if awake is None or not awake.any():
            return 0
        turn = data.geom_xmat[self._geoms].reshape(-1, 3, 3)
        middle = data.geom_xpos[self._geoms] + np.einsum("cij,cj->ci", turn, self._center)
        half = np.einsum("cij,cj->ci", np.abs(turn), self._half) + self._gap[:, None]
        low, high = middle - half, middle + half
        near = (low[awake][:, None] <= high).all(-1) & (high[awake][:, None] >= low).all(-1) & self._allowed[awake]
        return int(near.sum()) - int(near[:, awake].sum()) // 2  # pairs of two awake geoms are found twice


def _allowed(model: mujoco.MjModel, geoms: np.ndarray) -> Bool[np.ndarray, "C C"]:
    """Pairs that MuJoCo's filters let through: other bodies, no parent and child, bits that match, no exclusion."""
    body = np.asarray(model.geom_bodyid)[geoms]
    weld = np.asarray(model.body_weldid)[body]
    parent = np.asarray(model.body_weldid)[model.body_parentid[weld]]
    bits = np.asarray(model.geom_contype)[geoms][:, None] & np.asarray(model.geom_conaffinity)[geoms]
    allowed = (bits | bits.T) != 0
    allowed &= weld[:, None] != weld
    kin = ((parent[:, None] == weld) & (weld != 0)) | ((parent == weld[:, None]) & (weld[:, None] != 0))
    allowed &= ~kin
    number = body.astype(np.int64)
    signature = (np.minimum(number[:, None], number) << 16) + np.maximum(number[:, None], number)
    return allowed & ~np.isin(signature, np.asarray(model.exclude_signature, np.int64))
