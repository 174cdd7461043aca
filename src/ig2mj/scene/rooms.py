"""`rooms.npz`: which room a point is in, and where the floor is free (dataset_format.md 2.5)."""

from __future__ import annotations

import dataclasses
import os

import numpy as np


@dataclasses.dataclass(frozen=True)
class Rooms:
    """Maps of one home.

    Attributes:
      names: room instances ("kitchen_0"); types: their room types.
      room_map: [n, n] int16, index + 1 into names, 0 none; row is y, column is x, centre is the world's origin.
      resolution: metres per cell of room_map.
      traversable, traversable_no_obj: [m, m] bool at trav_resolution, or None.
    """

    names: tuple[str, ...]
    types: tuple[str, ...]
    room_map: np.ndarray
    resolution: float
    traversable: np.ndarray | None = None
    traversable_no_obj: np.ndarray | None = None
    trav_resolution: float = 0.1

    def room_at(self, xy: np.ndarray) -> str | None:
        """Name of the room that the world point xy [2] (m) is in, or None."""
        raise NotImplementedError

    def index_at(self, xy: np.ndarray) -> np.ndarray:
        """Index into names of the room at each world point xy [..., 2]; -1 where there is none."""
        raise NotImplementedError


def load_rooms(path: str | os.PathLike) -> Rooms:
    """Reads rooms.npz, or the folder that holds it. Raises InputError."""
    raise NotImplementedError
