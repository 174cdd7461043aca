"""`ModelSlot`: the compiled model that the worlds of a thread share, with fields that differ between them.

A world steps with the model that its fields were put into. Where all is as the last world left it, nothing is written.
"""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np


class ModelSlot:
    """A model of the native engine's own, and whose fields stand in it.

    Attributes:
      model: changed in place by `put`.
    """

    def __init__(self, model: mujoco.MjModel):
        self.model = model
        self._own: dict[str, np.ndarray] = {}
        self._stand: Mapping[str, np.ndarray] = {}

    def own(self, name: str) -> np.ndarray:
        """The field as it was compiled. Nobody may change it."""
        if name not in self._own:
            self._own[name] = np.array(getattr(self.model, name))
        return self._own[name]

    def put(self, fields: Mapping[str, np.ndarray]) -> None:
        """Writes a world's fields into the model; all others are as they were compiled."""
        if fields is self._stand:
            return
        for name in self._stand.keys() - fields.keys():
            getattr(self.model, name)[...] = self._own[name]
        for name, array in fields.items():
            if array is not self._stand.get(name):
                self.own(name)
                getattr(self.model, name)[...] = array
        self._stand = fields
