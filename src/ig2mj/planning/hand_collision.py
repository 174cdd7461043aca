"""`HandCollision`: whether a hand, and what it holds, is clear of everything else where it is put, by MuJoCo's own
narrow phase.

Hand, fingers and held object are one rigid thing. Axes: G geoms of it, K of everything else.
"""

from __future__ import annotations

from collections.abc import Collection

import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import PhysicsView
from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.scene import Scene

MARGIN = 0.004
"""m that a hand keeps away from everything."""

Pairs = frozenset[tuple[int, int]]
"""Pairs of geoms, the hand's first."""


class HandCollision:
    """One hand of one world, as the fingers are now."""

    def __init__(
        self,
        scene: Scene,
        view: PhysicsView,
        hand: int,
        grip: Float[np.ndarray, "3"],
        without: Collection[int] = (),
        world: int = 0,
    ):
        """
        Args:
          view: with a world axis; `world` of it. hand: number among all hands of the scene.
          grip: grasp point, m, in the frame of its palm. without: objects that do not count.
        """
        model, tables = scene.model, scene.tables
        self._model, self._data, self._grip = model, mujoco.MjData(model), grip
        body = model.geom_bodyid
        turn = matrices_on_host(np.asarray(view.body_quat)[world].astype(float))
        frame = turn[body] @ matrices_on_host(model.geom_quat)
        pos = np.asarray(view.body_pos)[world].astype(float)[body] + np.einsum("gij,gj->gi", turn[body], model.geom_pos)
        self._data.geom_xpos[:], self._data.geom_xmat[:] = pos, frame.reshape(-1, 9)
        collides = (model.geom_contype | model.geom_conaffinity) != 0
        held = np.flatnonzero(np.asarray(view.held)[world, hand] & ~tables.object_fixed)
        owner = tables.geom_object
        mine = collides & ((tables.body_hand[body] == hand) | np.isin(owner, held))
        counts = collides & ~mine & ((owner >= 0) | (tables.body_agent[body] >= 0))
        counts &= ~np.isin(owner, list(without)) | (owner < 0)
        self._own, self._other = np.flatnonzero(mine), np.flatnonzero(counts)
        self._meets = _may_touch(model, self._own, self._other)
        palm = int(tables.hand_body[hand])
        back = turn[palm].T
        self._offset = (pos[self._own] - np.asarray(view.body_pos)[world, palm]) @ back.T
        self._frame = back @ frame[self._own]
        middle = pos + np.einsum("gij,gj->gi", frame, model.geom_aabb[:, :3])
        half = np.einsum("gij,gj->gi", np.abs(frame), model.geom_aabb[:, 3:])
        self._low, self._high = (middle - half)[self._other] - MARGIN, (middle + half)[self._other] + MARGIN
        self.checks = 0

    def near(self, pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"], ignored: Pairs = frozenset()) -> Pairs:
        """Pairs nearer than `MARGIN` with the grasp point at `pos` and the palm turned to `quat` (w-x-y-z); at least
        one, where there is one that is not ignored."""
        return self._near(pos, quat, ignored, True)

    def clear(self, pos: Float[np.ndarray, "3"], quat: Float[np.ndarray, "4"], ignored: Pairs = frozenset()) -> bool:
        """Whether no pair is nearer than `MARGIN`, but for ignored ones."""
        return not self._near(pos, quat, ignored, False)

    def _near(self, pos: np.ndarray, quat: np.ndarray, ignored: Pairs, every: bool) -> Pairs:
        self.checks += 1
        model, data = self._model, self._data
        turn = matrices_on_host(np.asarray(quat, float)[None])[0]
        centre = np.asarray(pos, float) - turn @ self._grip + self._offset @ turn.T
        frame = turn @ self._frame
        data.geom_xpos[self._own], data.geom_xmat[self._own] = centre, frame.reshape(-1, 9)
        middle = centre + np.einsum("gij,gj->gi", frame, model.geom_aabb[self._own, :3])
        half = np.einsum("gij,gj->gi", np.abs(frame), model.geom_aabb[self._own, 3:])
        around = ((self._low < (middle + half).max(0)) & (self._high > (middle - half).min(0))).all(1)
        some = np.flatnonzero(around)
        meets = self._meets[:, some, None] & ((middle - half)[:, None] < self._high[some])
        meets &= (middle + half)[:, None] > self._low[some]
        found = set()
        for g, k in np.argwhere(meets.all(-1)).tolist():
            pair = int(self._own[g]), int(self._other[some[k]])
            if pair not in ignored and mujoco.mj_geomDistance(model, data, *pair, MARGIN, None) < MARGIN:
                found.add(pair)
                if not every:
                    break
        return frozenset(found)


def _may_touch(model: mujoco.MjModel, one: np.ndarray, other: np.ndarray) -> Bool[np.ndarray, "G K"]:
    """Pairs of geoms between which the model has contacts."""
    kind, with_ = model.geom_contype, model.geom_conaffinity
    found = ((kind[one, None] & with_[other]) | (kind[other] & with_[one, None])) != 0
    body = model.geom_bodyid
    low, high = np.minimum(body[one, None], body[other]), np.maximum(body[one, None], body[other])
    return found & ~np.isin((low << 16) + high, model.exclude_signature)
