"""Grasps that a write ends: a hand lets go of what moves by other means than physics. Shared by the engines.

An equality constraint that stays on while one of its bodies jumps pulls both together within a few physics steps: what
is held flies off, or the world becomes non-finite. So every engine switches such constraints off before it moves
anything, and no caller has to know what is held.

Functions take NumPy's or JAX's arrays and `xp`, which is `numpy` or `jax.numpy`.

Axes: W worlds, E equality constraints, H hands, O objects, grasps: constraints between a hand and an object.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Bool

from ig2mj.engine.layout import ModelLayout
from ig2mj.engine.view import Array


def moved_grasps(
    xp: Any, layout: ModelLayout, object_mask: Bool[Array, "W O"] | None, qpos_mask: Bool[Array, "W nq"] | None
) -> Any:
    """Grasps [W, grasps] of which a write moves the hand or the held body; None: the write moves nothing.

    Args:
      object_mask, qpos_mask: of the `Write`. Fixed objects do not move.
    """
    found = None
    if object_mask is not None:
        free = layout.object_qposadr[layout.grasp_object] >= 0
        found = xp.asarray(object_mask)[:, layout.grasp_object] & free
    if qpos_mask is not None:
        at = layout.grasp_coordinates
        of_joints = (xp.asarray(qpos_mask)[:, np.maximum(at, 0)] & (at >= 0)).any(-1)
        found = of_joints if found is None else found | of_joints
    return found


def without_moved(
    xp: Any,
    layout: ModelLayout,
    moved: Bool[Array, "W grasps"],
    eq_active: Array,
    ignored: Bool[Array, "W H O"],
) -> tuple[Any, Any]:
    """Active constraints [W, E] and ignored contacts [W, H, O] after the moved grasps ended.

    Contacts of a hand and an object are ignored no more where one of their grasps moved and no other one is left.
    """
    kept = (eq_active[:, layout.grasp_equality] != 0) & ~moved
    pair = layout.grasp_hand * ignored.shape[2] + layout.grasp_object
    number = ignored.shape[1] * ignored.shape[2]
    over = _any_of(xp, pair, moved, number) & ~_any_of(xp, pair, kept, number)
    values = xp.where(moved, xp.zeros_like(eq_active[:, layout.grasp_equality]), eq_active[:, layout.grasp_equality])
    if xp is np:
        active = np.array(eq_active)
        active[:, layout.grasp_equality] = values
    else:
        active = xp.asarray(eq_active).at[:, layout.grasp_equality].set(values)
    return active, ignored & ~over.reshape(ignored.shape)


def _any_of(xp: Any, group: np.ndarray, mask: Bool[Array, "W grasps"], number: int) -> Bool[Array, "W groups"]:
    """Whether any entry of a group is masked."""
    none = xp.zeros((mask.shape[0], number), bool)
    if xp is np:
        world, entry = np.nonzero(mask)
        none[world, group[entry]] = True
        return none
    return none.at[:, group].max(mask)
