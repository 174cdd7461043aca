"""`StateOptions`: the few choices that change how extended states and predicates behave."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Literal, get_args

import numpy as np

from ig2mj.errors import StateError, UnknownNameError

Compat = Literal["paper", "igibson"]

CONTROL_TIMESTEP = 1 / 30
"""Seconds. iGibson's step: states are updated once per rendered frame (simulator.py)."""


class NoEffectWarning(UserWarning):
    """An option changes nothing in this scene."""


@dataclasses.dataclass(frozen=True)
class StateOptions:
    """Choices, fixed for a run.

    Raises:
      UnknownNameError: no such `compat`. StateError: a value that its attribute cannot have.

    Attributes:
      compat: "paper", or "igibson" for the rule of iGibson's code where both differ (docs/design/rules.md).
      timestep: seconds between two updates of the states.
      drying_rate: droplets per second that a wet object loses. Beyond iGibson, where nothing ever dries; 0 is off.
      contact_heat_rate: 1/s, rate at which two touching objects with temperatures approach each other. Beyond
        iGibson, where heat passes from sources only; 0 is off.
      soiling: what touches something that is covered with a substance is covered with it, too, and robots carry it
        on under feet and wheels. Beyond iGibson. In a scene without substances it changes nothing, with a warning.
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
        if self.compat not in (known := get_args(Compat)):
            raise UnknownNameError("rules", str(self.compat), known)
        for name in ("timestep", "image_aspect"):
            if not (_is_finite(value := getattr(self, name)) and value > 0):
                raise StateError(f"{name} = {value!r}: a number above 0 is needed")
        for name in ("drying_rate", "contact_heat_rate"):
            if not (_is_finite(value := getattr(self, name)) and value >= 0):
                raise StateError(f"{name} = {value!r}: a number of at least 0 is needed")
        for name in ("soiling", "occlusion"):
            if not isinstance(value := getattr(self, name), bool | np.bool_):
                raise StateError(f"{name} = {value!r}: True or False is needed")


def _is_finite(value: Any) -> bool:
    return isinstance(value, float | int | np.number) and not isinstance(value, bool) and math.isfinite(value)
