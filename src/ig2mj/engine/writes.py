"""Writes of one world, made on the host from the few objects or joints that they move.

Axes: W = 1, O objects, N of these, or joints.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Write


def teleports(
    num_objects: int,
    objects: int | np.integer | Int[np.ndarray, "N"],
    pos: Float[np.ndarray, "... 3"],
    quat: Float[np.ndarray, "... 4"],
    mask: bool | Bool[np.ndarray, "N"] = True,
) -> Write:
    """Objects elsewhere, at rest and awake.

    Args:
      objects: indices. pos, quat: of their main bodies, world frame, w-x-y-z. mask: those that move.
    """
    moves, places, turns = (
        np.zeros((1, num_objects), bool),
        np.zeros((1, num_objects, 3)),
        np.zeros((1, num_objects, 4)),
    )
    moves[0, objects], places[0, objects], turns[0, objects] = mask, pos, quat
    return Write(object_mask=moves, object_pos=places, object_quat=turns)


def joints(
    nq: int,
    addresses: int | np.integer | Int[np.ndarray, "N"],
    values: float | np.floating | Float[np.ndarray, "N"],
    mask: bool | Bool[np.ndarray, "N"] = True,
) -> Write:
    """Hinges (rad) and slides (m) elsewhere.

    Args:
      addresses: of their coordinates. mask: those that move.
    """
    moves, coordinates = np.zeros((1, nq), bool), np.zeros((1, nq))
    moves[0, addresses], coordinates[0, addresses] = mask, values
    return Write(qpos_mask=moves, qpos=coordinates)
