"""`PoseSource`: where poses of a person come from: a recorded file, mouse and keyboard, WebXR or OpenXR."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from ig2mj.vr.frames import Pose, PoseFrame

LEFT, RIGHT = 0, 1
"""Numbers of hands."""


@runtime_checkable
class PoseSource(Protocol):
    """Devices of one person. Its methods may be called from any thread and return at once."""

    def poll(self) -> PoseFrame | None:
        """The newest frame; None without a person."""
        ...

    def stand_at(self, body: Pose) -> PoseFrame | None:
        """Moves the play area so that the person stands where a robot's body stands, and faces as it does; the height
        stays their own. Returns the newest frame from there."""
        ...

    def pulse(self, hand: int, strength: float, seconds: float) -> None:
        """Lets a hand's device vibrate. `strength`: 0..1."""
        ...

    def close(self) -> None:
        """Lets go of the devices; may be called twice."""
        ...
