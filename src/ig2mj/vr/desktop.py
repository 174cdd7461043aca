"""`DesktopPoses`: mouse and keyboard as devices, for those without a headset.

| key, mouse | what it does |
|---|---|
| W A S D | walk |
| mouse with its right button held | look around |
| mouse with Shift held | move the chosen hand sideways and up; the wheel moves it away and back |
| left button | trigger of the chosen hand |
| 1, 2 | choose the left, the right hand |
| Q, E | turn the chosen hand about its fingers |
| T, G | rise, sink |
| R | the chosen hand back to rest |
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from scipy.spatial.transform import Rotation

from ig2mj.agents.humanoid.frames import EYE_POS, HAND_POS, HAND_QUAT
from ig2mj.vr.frames import Hand, Pose, PoseFrame

EYE_HEIGHT = 1.5
"""m of the eyes above the floor."""

LOOK, REACH, WHEEL = 0.004, 0.0015, 0.0004
"""rad and m for each pixel, m for each unit of the wheel."""

TURN_SPEED = 1.5
"""rad/s of Q and E."""

BOX_LOW, BOX_HIGH = np.array([-0.1, -0.6, -0.7]), np.array([0.8, 0.6, 0.9])
"""m by which a hand may be away from its rest."""

STEEPEST = math.radians(85)

KEYS = frozenset("wasdqetg12r") | {"shift"}
"""Those that mean anything."""

LEFT_BUTTON, RIGHT_BUTTON = 1, 2
"""Bits of the mouse's buttons, as in browsers."""


class DesktopPoses:
    """Keys and mouse in, frames out. Not for several threads."""

    def __init__(self) -> None:
        """Standing, hands at rest, the right one chosen."""
        self.yaw, self.pitch = 0.0, math.radians(15.0)
        self.chosen = 1
        self._down: frozenset[str] = frozenset()
        self._buttons = 0
        self._reach, self._twist = np.zeros((2, 3)), np.zeros(2)
        self._time = 0.0

    def feed(self, down: Iterable[str], move: tuple[float, float], wheel: float, buttons: int) -> None:
        """What happened since the last call.

        Args:
          down: keys that are held, in small letters. move: pixels to the right and down. buttons: bits.
        """
        self._down, self._buttons = frozenset(down) & KEYS, buttons
        dx, dy = (float(np.clip(v, -2000, 2000)) for v in move)
        for hand in (0, 1):
            if str(hand + 1) in self._down:
                self.chosen = hand
        if "shift" in self._down:
            self._reach[self.chosen] += (0.0, -dx * REACH, -dy * REACH)
        elif self._buttons & RIGHT_BUTTON:
            self.yaw = math.remainder(self.yaw - dx * LOOK, math.tau)
            self.pitch = float(np.clip(self.pitch + dy * LOOK, -STEEPEST, STEEPEST))
        self._reach[self.chosen, 0] -= float(np.clip(wheel, -2000, 2000)) * WHEEL
        self._reach[self.chosen] = np.clip(self._reach[self.chosen], BOX_LOW, BOX_HIGH)
        if "r" in self._down:
            self._reach[self.chosen], self._twist[self.chosen] = 0.0, 0.0

    def release(self) -> None:
        """No key is held."""
        self._down, self._buttons = frozenset(), 0

    def frame(self, seconds: float) -> PoseFrame:
        """The frame after so much more time, in the play area; sticks walk and lift."""
        seconds = min(max(seconds, 0.0), 0.1)
        self._time += seconds
        self._twist[self.chosen] += TURN_SPEED * seconds * (("q" in self._down) - ("e" in self._down))
        level = Rotation.from_euler("z", self.yaw)
        head = Pose.of((0.0, 0.0, EYE_HEIGHT), level * Rotation.from_euler("y", self.pitch))
        body = Pose.of(head.pos - level.apply(EYE_POS), level)
        hands = []
        for k in range(2):
            turn = Rotation.from_euler("x", self._twist[k]) * Rotation.from_quat(np.roll(HAND_QUAT[k], -1))
            pose = body * Pose.of(HAND_POS[k] + (0.15, 0.0, 0.0) + self._reach[k], turn)
            pulled = k == self.chosen and bool(self._buttons & LEFT_BUTTON)
            hands.append(Hand(pose, trigger=1.0 if pulled else 0.0, stick=self._stick(k)))
        return PoseFrame(self._time, head, (hands[0], hands[1]))

    def _stick(self, hand: int) -> tuple[float, float]:
        def axis(plus: str, minus: str) -> float:
            return float((plus in self._down) - (minus in self._down))

        return (axis("d", "a"), axis("w", "s")) if hand == 0 else (0.0, axis("t", "g"))
