"""`StateOptions`: the few choices that change how extended states and predicates behave."""

from __future__ import annotations

import dataclasses
from typing import Literal

Compat = Literal["paper", "igibson"]

CONTROL_TIMESTEP = 1 / 30
"""Seconds. iGibson's step: states are updated once per rendered frame (simulator.py)."""


@dataclasses.dataclass(frozen=True)
class StateOptions:
    """Choices, fixed for a run.

    Attributes:
      compat: "paper", or "igibson" for the rule of iGibson's code where both differ (docs/design/rules.md).
      timestep: seconds between two updates of the states.
      drying_rate: droplets per second that a wet object loses. Beyond iGibson, where nothing ever dries; 0 is off.
      contact_heat_rate: 1/s, rate at which two touching objects with temperatures approach each other. Beyond
        iGibson, where heat passes from sources only; 0 is off.
      soiling: what touches something that is covered with a substance is covered with it, too, and robots carry it
        on under feet and wheels. Beyond iGibson.
      occlusion: `in_fov_of_agent` asks for an unobstructed line of sight, not only for the view frustum.
      image_aspect: width over height of the agent's camera image.
    """

    compat: Compat = "paper"
    timestep: float = CONTROL_TIMESTEP
    drying_rate: float = 0.0
    contact_heat_rate: float = 0.0
    soiling: bool = False
    occlusion: bool = True
    image_aspect: float = 1.0

    def __post_init__(self):
        if self.compat not in ("paper", "igibson"):
            raise ValueError(f"compat is 'paper' or 'igibson', not {self.compat!r}")
        if not self.timestep > 0:
            raise ValueError(f"the timestep must be positive, not {self.timestep}")
