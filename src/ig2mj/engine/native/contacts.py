"""What the contact list of C MuJoCo says: which units touch, and how hard annotated links press on objects."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.engine.layout import ModelLayout


def touching_units(
    data: mujoco.MjData, geom_unit: np.ndarray, tolerance: float, remembered: np.ndarray, fresh: np.ndarray
) -> np.ndarray:
    """Touching of units after a step.

    Args:
      data: its contacts are those of the present positions.
      geom_unit: [G] unit of each geom, -1 none.
      tolerance: metres.
      remembered: [U, U] touching before the step.
      fresh: [U, U] pairs of which one is awake: only of these do contacts tell anything.

    Returns:
      [U, U] symmetric; `remembered` itself where nothing changed.
    """
    touching = remembered & ~fresh
    if data.ncon:
        contact = data.contact
        units = geom_unit[contact.geom]
        near = (units[:, 0] >= 0) & (units[:, 1] >= 0) & (contact.dist <= tolerance)
        one, other = units[near].T
        touching[one, other] = True
        touching[other, one] = True
    return remembered if np.array_equal(touching, remembered) else touching


def add_link_forces(
    data: mujoco.MjData, layout: ModelLayout, geom_object: np.ndarray, pyramidal: bool, force: np.ndarray
) -> bool:
    """Raises `force` [L, O] to the normal forces (N) of the physics step just taken; says whether any was found.

    The largest single contact counts, as in iGibson's slicer (spec/states.md 10.1).
    """
    if not data.ncon:
        return False
    contact = data.contact
    geom = contact.geom
    link = layout.link_of_geom[geom]
    row, side = np.nonzero(link >= 0)
    if not len(row):
        return False
    thing = geom_object[geom[row, 1 - side]]
    address = contact.efc_address[row]
    real = (thing >= 0) & (address >= 0)
    if not real.any():
        return False
    row, side, thing, address = row[real], side[real], thing[real], address[real]
    normal = data.efc_force[address]
    if pyramidal:  # the normal force is the sum over the pyramid's edges, two per friction direction
        edges = 2 * (contact.dim[row] - 1)
        for k in range(1, int(edges.max(initial=0))):
            more = edges > k
            normal = normal + np.where(more, data.efc_force[np.where(more, address + k, 0)], 0.0)
    np.maximum.at(force, (link[row, side], thing), normal)
    return True
