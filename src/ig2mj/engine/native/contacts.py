"""What the contact list of C MuJoCo says: which units touch, and how hard annotated links and fingers press."""

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


def add_forces(
    data: mujoco.MjData,
    layout: ModelLayout,
    geom_object: np.ndarray,
    presses: np.ndarray,
    pyramidal: bool,
    link_force: np.ndarray,
    finger_force: np.ndarray,
) -> bool:
    """Raises forces (N) to those of the physics step just taken; says whether any was found.

    Args:
      presses: [G] the geom is an annotated link's or a finger's.
      link_force: [L, O], the largest single contact, as in iGibson's slicer (spec/states.md 10.1).
      finger_force: [F, Y], the sum over the contacts of a finger with a graspable body.
    """
    if not data.ncon:
        return False
    contact = data.contact
    geom = contact.geom
    row, side = presses[geom].nonzero()
    if not len(row):
        return False
    address = contact.efc_address[row]
    real = address >= 0
    if not real.all():
        row, side, address = row[real], side[real], address[real]
    own, other = geom[row, side], geom[row, 1 - side]
    normal = data.efc_force[address]
    if pyramidal:  # the normal force is the sum over the pyramid's edges, two per friction direction
        edges = 2 * (contact.dim[row] - 1)
        for k in range(1, int(edges.max(initial=0))):
            more = edges > k
            normal = normal + np.where(more, data.efc_force[np.where(more, address + k, 0)], 0.0)
    link, thing = layout.link_of_geom[own], geom_object[other]
    of_link = (link >= 0) & (thing >= 0)
    if of_link.any():
        np.maximum.at(link_force, (link[of_link], thing[of_link]), normal[of_link])
    finger, body = layout.finger_of_geom[own], layout.graspable_of_geom[other]
    of_finger = (finger >= 0) & (body >= 0)
    if of_finger.any():
        total = np.zeros_like(finger_force)
        np.add.at(total, (finger[of_finger], body[of_finger]), normal[of_finger])
        np.maximum(finger_force, total, out=finger_force)
    return bool(of_link.any() or of_finger.any())
