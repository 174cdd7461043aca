"""Whether objects that are added at a pose start inside of something, from which physics would throw them, or above the
house; and whether those that are fixed there stand in its walls.
"""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.errors import Ig2mjError
from ig2mj.scene.additions import Addition
from ig2mj.scene.tables import SceneTables

DEEPEST = 0.01
"""m of penetration that a start may have: contacts push an object out of that within a few steps, and slowly."""


DEEPEST_FIXED = 0.05
"""m by which an object of the user's own that is fixed may reach into a wall: what is hung up reaches into plaster."""


def check_start(model: mujoco.MjModel, tables: SceneTables, additions: list[Addition]) -> None:
    """Raises Ig2mjError: an addition that can move starts deeper than `DEEPEST` inside of something, or above the
    walls; or one of the user's own is fixed deeper than `DEEPEST_FIXED` in a wall.

    Args:
      model, tables: of the scene. additions: those to check.
    """
    placed = {tables.object_names.index(a.name): a for a in additions if a.start is not None}
    fixed = {tables.object_names.index(a.name): a for a in additions if a.place is not None and a.folder is not None}
    if not placed and not fixed:
        return
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    owners = np.asarray(tables.geom_object)
    walls = np.flatnonzero(np.isin(owners, [k for k, c in enumerate(tables.object_categories) if c == "walls"]))
    _check_heights(model, data, owners, walls, placed | fixed)
    _check_walls(model, data, owners, walls, fixed)
    deepest: tuple[float, int, int] = (-DEEPEST, -1, -1)
    for contact in data.contact:
        one, other = (int(owners[g]) for g in contact.geom)
        if one != other and contact.dist < deepest[0] and (one in placed or other in placed):
            deepest = (float(contact.dist), one, other) if one in placed else (float(contact.dist), other, one)
    depth, own, other = deepest
    if own >= 0:
        addition = placed[own]
        inside = tables.object_names[other] if other >= 0 else "the building"
        raise Ig2mjError(
            f"'{addition.requested}' starts {-100 * depth:.1f} cm inside of {inside}: give another place, or "
            f"{addition.reference}@on_top:OBJECT, which finds one"
        )


def _check_heights(
    model: mujoco.MjModel, data: mujoco.MjData, owners: np.ndarray, walls: np.ndarray, additions: dict[int, Addition]
) -> None:
    """Raises Ig2mjError: an addition is above all walls."""
    if not len(walls):
        return
    top = float(_heights(model, data, walls)[:, 1].max())
    for own, addition in additions.items():
        geoms = np.flatnonzero(owners == own)
        low = float(_heights(model, data, geoms)[:, 0].min()) if len(geoms) else -np.inf
        if low > top:
            raise Ig2mjError(
                f"'{addition.requested}' starts {low:.1f} m above the floor, and the walls end at {top:.1f} m: give a "
                f"lower place, or {addition.reference}@on_top:OBJECT, which finds one"
            )


def _check_walls(
    model: mujoco.MjModel, data: mujoco.MjData, owners: np.ndarray, walls: np.ndarray, additions: dict[int, Addition]
) -> None:
    """Raises Ig2mjError: an addition that is fixed stands in a wall."""
    fromto, solid = np.zeros(6), model.geom_contype > 0
    for own, addition in additions.items():
        geoms = [int(g) for g in np.flatnonzero((owners == own) & solid)]
        near = [
            (g, int(w))
            for g in geoms
            for w in walls[solid[walls]]
            if np.linalg.norm(data.geom_xpos[g] - data.geom_xpos[w]) < model.geom_rbound[g] + model.geom_rbound[w]
        ]
        depth = min((mujoco.mj_geomDistance(model, data, *pair, 0.1, fromto) for pair in near), default=0.0)
        if depth < -DEEPEST_FIXED:
            raise Ig2mjError(
                f"'{addition.requested}' is fixed {-100 * depth:.0f} cm inside of a wall: give another place"
            )


def _heights(model: mujoco.MjModel, data: mujoco.MjData, geoms: np.ndarray) -> np.ndarray:
    """Lowest and highest z [n, 2] of geoms, m."""
    turns = data.geom_xmat[geoms].reshape(-1, 3, 3)[:, 2]
    middle = data.geom_xpos[geoms, 2] + np.sum(turns * model.geom_aabb[geoms, :3], axis=1)
    half = np.sum(np.abs(turns) * model.geom_aabb[geoms, 3:], axis=1)
    return np.stack([middle - half, middle + half], axis=1)
