"""A floating hand that presses a button with its index finger: there, a while, back."""

from __future__ import annotations

import numpy as np

from ig2mj.agents.floating_hand import hand_ctrl

FINGER_AXIS_OFFSET = (0.03, 0.0, 0.0)
"""m, palm frame: the line along which the index finger points (floating_hand.py)."""
REST = 0.50
"""m from the palm to the button between presses."""
PRESS = 0.17
"""m from the palm to the button while pressing: the finger's last segment begins 0.083 m from the button, within the
0.10 m of `ig2mj.states.definitions.toggled_on.BUTTON_DISTANCE`, and its tip ends 0.04 m before it."""
SPEED = 0.35
"""m/s."""
HOLD = 12
"""Control steps that the finger stays; a switch wants five (`ig2mj.states.definitions.toggled_on.HOLD`)."""


class ButtonHand:
    """Controls of the hand, one control step after the other.

    Attributes:
      direction: [3] unit vector, world frame, towards the button.
      seconds: length of a control step.
    """

    def __init__(self, direction: np.ndarray, seconds: float):
        self.direction, self.seconds = direction, seconds
        self._moved = 0.0
        self._held: int | None = None  # steps at the button; None: on the way back, or at rest

    @property
    def at_rest(self) -> bool:
        return self._held is None and self._moved == 0.0

    def press(self) -> None:
        """Starts a press; one that is under way goes on."""
        if self._held is None:
            self._held = 0

    def ctrl(self) -> np.ndarray:
        """Controls [16] of the next control step, see `hand_ctrl`; all fingers but the index are closed."""
        stride, way = SPEED * self.seconds, REST - PRESS
        if self._held is None:
            self._moved = max(0.0, self._moved - stride)
        elif self._moved < way:
            self._moved = min(way, self._moved + stride)
        elif self._held < HOLD:
            self._held += 1
        else:
            self._held = None
        controls = hand_ctrl(self._moved * self.direction, closed=1.0)
        controls[8:10] = 0.0  # the index finger's two joints
        return controls
