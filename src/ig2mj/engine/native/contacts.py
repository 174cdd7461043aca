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


LINK, FINGER = 1, 2
"""Bits of `force_roles`: what presses. What is pressed on has the bit of what presses on it, shifted by `PRESSED`."""

PRESSED = 2
"""Bits by which those of what is pressed on are shifted."""


def force_roles(layout: ModelLayout, geom_object: np.ndarray) -> np.ndarray:
    """Bits [G] that say whose forces a contact of the geom may tell: an annotated link's on an object, a finger's on a
    graspable body."""
    presses = LINK * (layout.link_of_geom >= 0) + FINGER * (layout.finger_of_geom >= 0)
    pressed = LINK * (geom_object >= 0) + FINGER * (layout.graspable_of_geom >= 0)
    return (presses + (pressed << PRESSED)).astype(np.uint8)


def add_forces(
    data: mujoco.MjData,
    layout: ModelLayout,
    geom_object: np.ndarray,
    roles: np.ndarray,
    pyramidal: bool,
    link_force: np.ndarray,
    finger_force: np.ndarray,
) -> bool:
    """Raises forces (N) to those of the physics step just taken; says whether any was found.

    Args:
      roles: `force_roles`.
      link_force: [L, O], the largest single contact, as in iGibson's slicer (spec/states.md 10.1).
      finger_force: [F, Y], the sum over the contacts of a finger with a graspable body.
    """
    if not data.ncon:
        return False
    contact = data.contact
    geom = contact.geom
    role = roles.take(geom)
    meets = role & (role >> PRESSED)[:, ::-1]
    if not meets.any():
        return False
    row, side = meets.nonzero()
    address = contact.efc_address[row]
    real = address >= 0
    if not real.all():
        row, side, address = row[real], side[real], address[real]
    kind, own, other = meets[row, side], geom[row, side], geom[row, 1 - side]
    normal = data.efc_force[address]
    if pyramidal:  # the normal force is the sum over the pyramid's edges, two per friction direction
        edges = 2 * (contact.dim[row] - 1)
        for k in range(1, int(edges.max(initial=0))):
            more = edges > k
            normal = normal + np.where(more, data.efc_force[np.where(more, address + k, 0)], 0.0)
    of_link, of_finger = (kind & LINK) != 0, (kind & FINGER) != 0
    if of_link.any():
        np.maximum.at(link_force, (layout.link_of_geom[own[of_link]], geom_object[other[of_link]]), normal[of_link])
    if of_finger.any():
        total = np.zeros_like(finger_force)
        place = layout.finger_of_geom[own[of_finger]], layout.graspable_of_geom[other[of_finger]]
        np.add.at(total, place, normal[of_finger])
        np.maximum(finger_force, total, out=finger_force)
    return len(row) > 0
