"""Writes to a world of the native engine: teleports, joint positions, equality constraints."""

from __future__ import annotations

import mujoco
import numpy as np
from jaxtyping import Bool

from ig2mj.engine.grasp_release import moved_grasps, without_moved
from ig2mj.engine.model_fields import MOVING, NAMES, POSES
from ig2mj.engine.native.one_world import NativeWorld
from ig2mj.engine.native.sleep import wake_trees
from ig2mj.engine.native.view_rows import Changed

SLACK = 1e-4
"""Metres, and 1 - |cosine of half an angle|, within which one body's pose in another's frame is the same: views are in
float32."""


def apply_write(world: NativeWorld, rows: dict[str, np.ndarray]) -> int:
    """Applies one world's rows of a `Write` (its fields, and those of the model, that are not None) and refreshes it.

    Without any rows the world is refreshed from what stands in its MjData. Grasps of what moves end, unless the rows
    say which constraints are active.
    """
    layout, model, data = world.statics.layout, world.model, world.data
    rows = _with_releases(world, rows)
    trees = np.zeros(model.ntree, bool)
    if "object_mask" in rows:
        moved = np.flatnonzero(rows["object_mask"] & (layout.object_qposadr >= 0))
        if len(moved):
            pos = rows["object_pos"][moved].astype(np.float64)
            quat = rows["object_quat"][moved].astype(np.float64)
            quat /= np.linalg.norm(quat, axis=1, keepdims=True)
            _take_along(world, moved, pos, quat, trees)
            _put(world, layout.object_qposadr[moved], layout.object_dofadr[moved], pos, quat, trees)
    if "qpos_mask" in rows:
        address = np.flatnonzero(rows["qpos_mask"])
        if len(address):
            data.qpos[address] = rows["qpos"][address]
            first, count = layout.qpos_dof[address], layout.qpos_ndof[address]
            for k in range(int(count.max())):
                data.qvel[(first + k)[count > k]] = 0.0
            trees[layout.qpos_tree[address]] = True
    joined = np.zeros(model.neq, bool)
    if "eq_active" in rows:
        joined |= data.eq_active.astype(bool) != rows["eq_active"]
        data.eq_active[:] = rows["eq_active"]
    fields = {name: rows[name] for name in NAMES if name in rows}
    if "eq_data" in fields:
        joined |= (world.fields["eq_data"] != fields["eq_data"]).any(1) & data.eq_active.astype(bool)
    changed = {name for name, array in fields.items() if name in MOVING[1:] and (world.fields[name] != array).any()}
    trees[:] |= bool(changed)
    if fields:
        world.set_fields(**fields)
    filtered = "ignored_contacts" in rows and bool((world.ignored != rows["ignored_contacts"]).any())
    if filtered:
        trees |= layout.object_trees[(world.ignored != rows["ignored_contacts"]).any(0)].any(0)
        world.ignore(rows["ignored_contacts"])
    if joined.any():  # what a hand lets go may be ready to sleep: it would hang in the air
        free = layout.equality_tree[joined].ravel()
        trees[free[free >= 0]] = True
    if rows and not trees.any() and not filtered:
        return Changed.NOTHING
    wake_trees(model, data, np.flatnonzero(trees))
    mujoco.mj_step1(model, data)
    if not rows and (moved := _moved_by_hand(world)) is not None:
        return apply_write(world, _released(world, moved))
    if not changed.isdisjoint(POSES):  # poses of bodies without joints are only computed from the start
        return world.load(world.save())
    return world.clear_force() | world.refresh()


def _with_releases(world: NativeWorld, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The rows, and constraints and ignored contacts without the grasps of what they move."""
    layout = world.statics.layout
    if not len(layout.grasp_equality) or "eq_active" in rows:
        return rows
    masks = [rows[name][None] if name in rows else None for name in ("object_mask", "qpos_mask")]
    moved = moved_grasps(np, layout, *masks)
    return rows if moved is None or not moved.any() else _released(world, moved) | rows


def _released(world: NativeWorld, moved: Bool[np.ndarray, "1 grasps"]) -> dict[str, np.ndarray]:
    """Rows without the grasps of what moved."""
    active = world.data.eq_active[None].astype(bool)
    after = without_moved(np, world.statics.layout, moved, active, world.ignored[None])
    return {"eq_active": after[0][0], "ignored_contacts": after[1][0]}


def _moved_by_hand(world: NativeWorld) -> Bool[np.ndarray, "1 grasps"] | None:
    """Grasps whose bodies no longer stand to each other as they did when the world was last looked at, since somebody
    changed MuJoCo's own data. None: none."""
    data, layout = world.data, world.statics.layout
    active = np.flatnonzero(data.eq_active[layout.grasp_equality])
    if not len(active):
        return None
    moved, pos, quat = np.zeros((1, len(layout.grasp_equality)), bool), world.rows["body_pos"], world.rows["body_quat"]
    for k in active:
        bodies = layout.grasp_body[k].tolist()
        before = _relative([pos[b].astype(float) for b in bodies], [quat[b].astype(float) for b in bodies])
        after = _relative([data.xpos[b] for b in bodies], [data.xquat[b] for b in bodies])
        turned = 1.0 - abs(float(before[1] @ after[1]))
        moved[0, k] = np.linalg.norm(after[0] - before[0]) > SLACK or turned > SLACK
    return moved if moved.any() else None


def _relative(pos: list[np.ndarray], quat: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Pose of the second body in the frame of the first."""
    back, found = (np.zeros(3), np.zeros(4)), (np.zeros(3), np.zeros(4))
    mujoco.mju_negPose(*back, pos[0], quat[0])
    mujoco.mju_mulPose(*found, *back, pos[1], quat[1])
    return found


def _put(
    world: NativeWorld, qposadr: np.ndarray, dofadr: np.ndarray, pos: np.ndarray, quat: np.ndarray, trees: np.ndarray
) -> None:
    """Puts free joints [n] at poses [n, 3], [n, 4], at rest, and marks their trees."""
    world.data.qpos[qposadr[:, None] + np.arange(7)] = np.concatenate([pos, quat], 1)
    world.data.qvel[dofadr[:, None] + np.arange(6)] = 0.0
    trees[world.model.dof_treeid[dofadr]] = True


def _take_along(world: NativeWorld, moved: np.ndarray, pos: np.ndarray, quat: np.ndarray, trees: np.ndarray) -> None:
    """Moves split-off bodies rigidly with the main bodies, which are about to move to pos, quat."""
    layout, qpos = world.statics.layout, world.data.qpos
    for k in np.flatnonzero(np.isin(layout.extra_object, moved)):
        row = int(np.searchsorted(moved, layout.extra_object[k]))
        base = qpos[layout.object_qposadr[moved[row]] :][:7]
        own = qpos[layout.extra_qposadr[k] :][:7]
        back, rel, new = (np.zeros(3), np.zeros(4)), (np.zeros(3), np.zeros(4)), (np.zeros(3), np.zeros(4))
        mujoco.mju_negPose(*back, base[:3].copy(), base[3:].copy())
        mujoco.mju_mulPose(*rel, *back, own[:3].copy(), own[3:].copy())
        mujoco.mju_mulPose(*new, pos[row], quat[row], *rel)
        _put(world, layout.extra_qposadr[k : k + 1], layout.extra_dofadr[k : k + 1], new[0][None], new[1][None], trees)
