"""Whether objects that are added at a pose start inside of something: physics would throw them out of it."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.errors import Ig2mjError
from ig2mj.scene.additions import Addition
from ig2mj.scene.tables import SceneTables

DEEPEST = 0.01
"""m of penetration that a start may have: contacts push an object out of that within a few steps, and slowly."""


def check_start(model: mujoco.MjModel, tables: SceneTables, additions: list[Addition]) -> None:
    """Raises Ig2mjError: an addition that can move starts deeper than `DEEPEST` inside of something.

    Args:
      model, tables: of the scene. additions: those to check.
    """
    placed = {tables.object_names.index(a.name): a for a in additions if a.start is not None}
    if not placed:
        return
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    owners = np.asarray(tables.geom_object)
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
            f"'{addition.wanted}' starts {-100 * depth:.1f} cm inside of {inside}: give another place, or "
            f"{addition.reference}@on_top:OBJECT, which finds one"
        )
