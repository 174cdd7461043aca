"""Teleports and joint writes on batched coordinates (see `ig2mj.engine.base.Write`). Pure JAX."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ig2mj.engine.base import Write
from ig2mj.engine.grasp_release import moved_grasps, without_moved
from ig2mj.engine.layout import ModelLayout
from ig2mj.geometry.poses import compose, quat_normalize, relative_pose


def apply_write(
    layout: ModelLayout,
    model: mujoco.MjModel,
    qpos: Float[Array, "W nq"],
    qvel: Float[Array, "W nv"],
    write: Write,
) -> tuple[Float[Array, "W nq"], Float[Array, "W nv"], Bool[Array, "W T"]]:
    """Coordinates and velocities after a write, and the trees it moved."""
    moved_tree = jnp.zeros((qpos.shape[0], model.ntree), bool)
    if write.object_mask is not None:
        assert write.object_pos is not None and write.object_quat is not None
        movable = np.flatnonzero(layout.object_qposadr >= 0)
        mask = jnp.asarray(write.object_mask)[:, movable]
        pos = jnp.asarray(write.object_pos, jnp.float32)[:, movable]
        quat = quat_normalize(jnp.asarray(write.object_quat, jnp.float32)[:, movable])
        row = {int(o): k for k, o in enumerate(movable)}
        has_base = np.array([int(o) in row for o in layout.extra_object], bool)
        extras = np.flatnonzero(has_base)
        if len(extras):
            owner = np.array([row[int(o)] for o in layout.extra_object[extras]])
            base_pos, base_quat = _free(qpos, layout.object_qposadr[movable][owner])
            own_pos, own_quat = _free(qpos, layout.extra_qposadr[extras])
            offset = relative_pose(base_pos, base_quat, own_pos, own_quat)
            extra_pos, extra_quat = compose(pos[:, owner], quat[:, owner], *offset)
        qpos, qvel, moved_tree = _put(
            qpos,
            qvel,
            moved_tree,
            model,
            layout.object_qposadr[movable],
            layout.object_dofadr[movable],
            mask,
            pos,
            quat,
        )
        if len(extras):
            qpos, qvel, moved_tree = _put(
                qpos,
                qvel,
                moved_tree,
                model,
                layout.extra_qposadr[extras],
                layout.extra_dofadr[extras],
                mask[:, owner],
                extra_pos,
                extra_quat,
            )
    if write.qpos_mask is not None:
        assert write.qpos is not None
        mask = jnp.asarray(write.qpos_mask)
        qpos = jnp.where(mask, jnp.asarray(write.qpos, qpos.dtype), qpos)
        still = np.zeros((model.nq, model.nv), bool)
        for q, (first, count) in enumerate(zip(layout.qpos_dof, layout.qpos_ndof, strict=True)):
            still[q, first : first + count] = True
        qvel = jnp.where(reaches(mask, still), 0.0, qvel)
        of_tree = layout.qpos_tree[:, None] == np.arange(model.ntree)
        moved_tree |= reaches(mask, of_tree)
    return qpos, qvel, moved_tree


def after_release(layout: ModelLayout, write: Write, eq_active: Array, ignored: Any) -> tuple[Array, Any]:
    """Active constraints [W, E] after a write, and ignored contacts [W, H, O], after the grasps of what it moved
    ended (see `ig2mj.engine.grasp_release`)."""
    if write.eq_active is not None:
        return jnp.asarray(write.eq_active, eq_active.dtype), ignored
    moved = moved_grasps(jnp, layout, write.object_mask, write.qpos_mask) if len(layout.grasp_equality) else None
    return (eq_active, ignored) if moved is None else without_moved(jnp, layout, moved, eq_active, ignored)


def trees_joined(
    layout: ModelLayout,
    before: tuple[Bool[Array, "W E"], Float[Array, "W E 12"]],
    after: tuple[Bool[Array, "W E"], Float[Array, "W E 12"]],
) -> Bool[Array, "W T"]:
    """Trees at either end of an equality constraint that is being changed: what a hand lets go would hang in the air
    if it fell asleep. `before`, `after`: eq_active and eq_data."""
    active = after[0].astype(bool)
    changed = (before[0].astype(bool) != active) | ((before[1] != after[1]).any(-1) & active)
    return reaches(changed, (layout.equality_tree[..., None] == np.arange(layout.object_trees.shape[1])).any(1))


def with_islands(asleep: Int[Array, "W T"], trees: Bool[Array, "W T"]) -> Bool[Array, "W T"]:
    """The trees, and those that sleep in one island with one of them.

    Args:
      asleep: MuJoCo's `tree_asleep`: negative where a tree is awake, else the next tree of its island, in a circle.
    """
    count = asleep.shape[1]
    following = jnp.where(asleep >= 0, asleep, np.arange(count))
    for _ in range(max(count - 1, 0).bit_length()):  # after k rounds, a tree knows of the 2^k that follow it
        trees = trees | jnp.take_along_axis(trees, following, axis=1)
        following = jnp.take_along_axis(following, following, axis=1)
    return trees


def _free(qpos: Float[Array, "W nq"], address: np.ndarray) -> tuple[Float[Array, "W X 3"], Float[Array, "W X 4"]]:
    coordinates = qpos[:, address[:, None] + np.arange(7)]
    return coordinates[..., :3], coordinates[..., 3:]


def _put(
    qpos: Float[Array, "W nq"],
    qvel: Float[Array, "W nv"],
    moved_tree: Bool[Array, "W T"],
    model: mujoco.MjModel,
    qposadr: np.ndarray,
    dofadr: np.ndarray,
    mask: Bool[Array, "W X"],
    pos: Float[Array, "W X 3"],
    quat: Float[Array, "W X 4"],
) -> tuple[Float[Array, "W nq"], Float[Array, "W nv"], Bool[Array, "W T"]]:
    """Puts free joints at poses, at rest, where masked."""
    where_q, where_v = qposadr[:, None] + np.arange(7), dofadr[:, None] + np.arange(6)
    new = jnp.concatenate([pos, quat], -1)
    qpos = qpos.at[:, where_q].set(jnp.where(mask[..., None], new, qpos[:, where_q]))
    qvel = qvel.at[:, where_v].set(jnp.where(mask[..., None], 0.0, qvel[:, where_v]))
    tree = np.asarray(model.dof_treeid)[dofadr]
    return qpos, qvel, moved_tree.at[:, tree].max(mask)


def reaches(mask: Bool[Array, "W n"], table: np.ndarray) -> Bool[Array, "W m"]:
    """Whether any masked entry is marked in the column of a table [n, m]."""
    return (mask.astype(jnp.float32) @ jnp.asarray(table, jnp.float32)) > 0
