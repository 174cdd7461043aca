"""Sleep of kinematic trees in C MuJoCo: waking what was written to, and putting a saved sleep state back.

MuJoCo keeps the truth in `tree_asleep` and derives lists of what is awake from it inside a step; the Python bindings
offer no call for that, so the lists are filled here (they are plain writable fields).
"""

from __future__ import annotations

import mujoco
import numpy as np

FULLY_AWAKE = -(1 + mujoco.mjMINAWAKE)
"""`tree_asleep` of a tree that must rest for the full number of steps before it sleeps."""

_STATIC, _ASLEEP, _AWAKE = -1, 0, 1  # mjtSleepState


def wake_trees(model: mujoco.MjModel, data: mujoco.MjData, trees: np.ndarray) -> None:
    """Wakes trees [n] (ids) with their sleeping islands; takes effect in the next kinematics.

    A sleeping tree wakes when any byte of its velocity is set. Minus zero sets one and moves nothing.
    """
    asleep = data.tree_asleep[trees] >= 0
    data.qvel[model.tree_dofadr[trees[asleep]]] = -0.0
    data.tree_asleep[trees[~asleep]] = FULLY_AWAKE


def restore_sleep(model: mujoco.MjModel, data: mujoco.MjData, tree_asleep: np.ndarray) -> None:
    """Puts a sleep state [T] back into data whose kinematics are up to date for every tree."""
    data.tree_asleep[:] = tree_asleep
    tree_awake = np.asarray(tree_asleep) < 0
    data.tree_awake[:] = tree_awake
    tree = model.body_treeid
    mocap = model.body_mocapid[model.body_rootid] >= 0
    body = np.where(mocap, _AWAKE, _STATIC)
    moving = tree >= 0
    body[moving] = np.where(tree_awake[tree[moving]], _AWAKE, _ASLEEP)
    data.body_awake[:] = body
    body_list = np.flatnonzero(body != _ASLEEP)
    parent_list = 1 + np.flatnonzero(body[model.body_parentid[1:]] != _ASLEEP)
    dof_list = np.flatnonzero((tree[model.dof_bodyid] >= 0) & (body[model.dof_bodyid] == _AWAKE))
    data.body_awake_ind[: len(body_list)] = body_list
    data.parent_awake_ind[: len(parent_list)] = parent_list
    data.dof_awake_ind[: len(dof_list)] = dof_list
    data.ntree_awake = int(tree_awake.sum())
    data.nbody_awake, data.nparent_awake, data.nv_awake = len(body_list), len(parent_list), len(dof_list)
