"""`PagePoses`: the devices of the first page that is open: headset, or mouse and keyboard."""

from __future__ import annotations

import time
from collections.abc import Callable

from ig2mj.vr.desktop import DesktopPoses
from ig2mj.vr.fed_poses import FedPoses
from ig2mj.vr.frames import PoseFrame
from ig2mj.vr.messages import Desktop, Devices
from ig2mj.vr.play_area import moved

STALE = 1.0
"""s of silence of a headset: its browser stops drawing, and so telling, when it is taken off."""

Pulse = Callable[[int, float, float], None]


class PagePoses(FedPoses):
    """A `PoseSource` that pages feed. All methods may be called from any thread."""

    def __init__(self, stale: float = STALE) -> None:
        """No headset is connected yet. `stale`: s without messages after which a headset counts as taken off."""
        super().__init__()
        self._stale = stale
        self._desktop: DesktopPoses | None = None
        self._heard = self._advanced = 0.0
        self._pulse: Pulse | None = None

    # From pages.

    def arrive(self, pulse: Pulse) -> None:
        """Someone is there. `pulse`: lets their hands feel something."""
        with self._lock:
            self._pulse, self._desktop = pulse, None
            self._frame = None

    def leave(self) -> None:
        """They are gone."""
        with self._lock:
            self._pulse, self._desktop, self._frame = None, None, None

    def receive(self, message: Devices | Desktop, now: float | None = None) -> None:
        """What a page said."""
        now = time.monotonic() if now is None else now
        with self._lock:
            if isinstance(message, Devices):
                self._frame, self._desktop = message.frame(), None
            else:
                self._desktop = self._desktop or DesktopPoses()
                self._desktop.feed(message.down, message.move, message.wheel, message.buttons)
            self._heard = now
        self.advance(now)

    def advance(self, now: float | None = None) -> None:
        """Lets time pass for what sticks and keys do; call it at the frame rate."""
        now = time.monotonic() if now is None else now
        with self._lock:
            seconds = max(now - self._advanced, 0.0)
            self._advanced = now
            if now - self._heard > self._stale:
                if self._desktop is not None:
                    self._desktop.release()
                else:
                    self._frame = None
            if self._desktop is not None:
                self._frame = self._desktop.frame(seconds)
            if self._frame is not None:
                self.area = moved(self.area, self._frame, seconds)

    # For the session.

    def poll(self) -> PoseFrame | None:
        """The newest frame, after what sticks and keys have done; None without a headset."""
        self.advance()
        return super().poll()

    def pulse(self, hand: int, strength: float, seconds: float) -> None:
        """See `PoseSource`."""
        with self._lock:
            pulse = self._pulse
        if pulse is not None:
            pulse(hand, strength, seconds)

    def close(self) -> None:
        """The person has left."""
        self.leave()
