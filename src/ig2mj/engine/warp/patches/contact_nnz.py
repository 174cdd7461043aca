"""How many entries a contact's row can have at most, counted with arrays instead of a loop over all pairs of geoms.

MuJoCo Warp asks for it whenever data are made, twice for an engine: each time 0.19 s for a home of 830 geoms.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from mujoco.mjx.third_party.mujoco_warp._src import io

from ig2mj.engine.warp.patches.scope import ScopedReplacement

NAME = "_calculate_max_contact_nnz"

COUNTED = ScopedReplacement()
"""Data that are made inside a block of it count so."""


def max_contact_nnz(model: mujoco.MjModel) -> int:
    """The largest number of degrees of freedom that move one of two bodies which can touch."""
    if model.nflex:
        return COUNTED.original(io, NAME)(model)
    weld, ends = model.body_weldid, _last_dofs(model)
    geoms = np.stack([model.geom_bodyid, model.geom_contype, model.geom_conaffinity], 1)
    body, kind, affinity = np.unique(geoms, axis=0).T
    meet = ((kind[:, None] & affinity) | (affinity[:, None] & kind)) != 0
    meet &= (body[:, None] < body) & ((weld[body] != 0)[:, None] | (weld[body] != 0))
    one, other = np.nonzero(meet)
    touching = np.concatenate([ends[body[one]], ends[model.geom_bodyid[model.pair_geom1]]])
    touched = np.concatenate([ends[body[other]], ends[model.geom_bodyid[model.pair_geom2]]])
    lengths, tree = _lengths(model), np.append(model.dof_treeid, -1)
    together = (tree[touching] == tree[touched]) & (touching >= 0)
    most = int(np.max(lengths[touching] + lengths[touched], where=~together, initial=0))
    for pair in set(zip(touching[together].tolist(), touched[together].tolist(), strict=True)):
        most = max(most, len(_chain(model, pair[0]) | _chain(model, pair[1])))
    return most


def _last_dofs(model: mujoco.MjModel) -> np.ndarray:
    """Of each body the last degree of freedom that moves it; -1: nothing does."""
    weld = model.body_weldid
    return np.maximum(model.body_dofadr[weld] + model.body_dofnum[weld] - 1, -1)


def _lengths(model: mujoco.MjModel) -> np.ndarray:
    """Degrees of freedom from each to the root of its tree; of -1, none."""
    lengths, parent = np.zeros(model.nv + 1, int), model.dof_parentid.tolist()
    for dof, above in enumerate(parent):  # parents come before their children
        lengths[dof] = 1 + (lengths[above] if above >= 0 else 0)
    return lengths


def _chain(model: mujoco.MjModel, dof: int) -> set[int]:
    """A degree of freedom, and those above it."""
    chain, parent = set[int](), model.dof_parentid
    while dof >= 0:
        chain.add(dof)
        dof = int(parent[dof])
    return chain


_own: dict[Any, Any] = {(io, NAME): max_contact_nnz}
COUNTED.add(_own)
