"""Closed linkages of grippers: where joints without a motor are when those with one are posed (`close_linkages`)."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

STEPS, CLOSE = 30, 1e-5
"""Steps of the solution at most, and m between the two ends of a connection at which it holds."""

DAMPING = 1e-8
"""Keeps steps finite where a linkage is stretched out."""


def close_linkages(model: mujoco.MjModel, data: mujoco.MjData, free: Sequence[str]) -> None:
    """Moves joints so that the model's `connect` constraints between sites hold, others stay where they are.

    data: posed by `mj_kinematics`, and so afterwards. free: names of hinges and slides that may move. Linkages that
    cannot be closed end as near to it as their joints' ranges allow.
    """
    ends = _connections(model)
    joints = [model.joint(name) for name in free]
    if not ends or not joints:
        return
    dofs, places = (np.array([int(adr[0]) for adr in addresses]) for addresses in zip(
        *((joint.dofadr, joint.qposadr) for joint in joints), strict=True
    ))  # fmt: skip
    low = np.array([j.range[0] if model.jnt_limited[j.id] else -np.inf for j in joints])
    high = np.array([j.range[1] if model.jnt_limited[j.id] else np.inf for j in joints])
    one, two = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for _ in range(STEPS):
        mujoco.mj_comPos(model, data)
        apart, rows = [], []
        for first, second in ends:
            mujoco.mj_jacSite(model, data, one, None, first)
            mujoco.mj_jacSite(model, data, two, None, second)
            apart.append(data.site_xpos[second] - data.site_xpos[first])
            rows.append((one - two)[:, dofs])
        error, jacobian = np.concatenate(apart), np.concatenate(rows)
        if np.abs(error).max() < CLOSE:
            return
        step = np.linalg.solve(jacobian.T @ jacobian + DAMPING * np.eye(len(dofs)), jacobian.T @ error)
        data.qpos[places] = np.clip(data.qpos[places] + np.clip(step, -0.3, 0.3), low, high)
        mujoco.mj_kinematics(model, data)


def _connections(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Pairs of sites that are to be at one place."""
    connect = (model.eq_type == int(mujoco.mjtEq.mjEQ_CONNECT)) & (model.eq_active0 > 0)
    connect &= model.eq_objtype == int(mujoco.mjtObj.mjOBJ_SITE)
    return [(int(model.eq_obj1id[eq]), int(model.eq_obj2id[eq])) for eq in np.flatnonzero(connect)]
