"""`FedPoses`: what sources of poses share whose devices report from another thread."""

from __future__ import annotations

import dataclasses
import threading

from ig2mj.vr.frames import PlayArea, Pose, PoseFrame
from ig2mj.vr.play_area import brought_to


class FedPoses:
    """The newest frame and the play area, behind a lock; a `PoseSource` but for `pulse` and `close`.

    Attributes: area: where the play area is now.
    """

    def __init__(self) -> None:
        """Nobody is there."""
        self._lock = threading.Lock()
        self._frame: PoseFrame | None = None
        self.area = PlayArea()

    def poll(self) -> PoseFrame | None:
        """The newest frame; None without a person."""
        with self._lock:
            return None if self._frame is None else dataclasses.replace(self._frame, area=self.area)

    def stand_at(self, body: Pose) -> PoseFrame | None:
        """See `PoseSource`."""
        with self._lock:
            if self._frame is not None and self._frame.head is not None:
                self.area = brought_to(self.area, self._frame.head, body)
        return self.poll()
