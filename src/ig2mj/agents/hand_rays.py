"""Rays with which a hand detects what is between its fingers, and the point that objects should be near."""

from __future__ import annotations

import dataclasses

import numpy as np
from jaxtyping import Float


@dataclasses.dataclass(frozen=True, eq=False)
class HandRays:
    """Points of one hand, each in the frame of a body of the agent.

    Attributes:
      palm: body of the palm or end effector. grasp_point: m, in its frame.
      start_bodies, starts: where rays begin: names of bodies, and points [S, 3] in their frames, m.
      end_bodies, ends: where they end; a ray runs from every start to every end.
    """

    palm: str
    grasp_point: Float[np.ndarray, "3"]
    start_bodies: tuple[str, ...]
    starts: Float[np.ndarray, "S 3"]
    end_bodies: tuple[str, ...]
    ends: Float[np.ndarray, "E 3"]
