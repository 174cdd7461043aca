"""`run_headset`: a session in a headset of this machine, by OpenXR.

The headset's frames are the main thread's: it waits for the runtime, draws both eyes from the newest poses and hands
them over, as fast as the headset wants. Physics has a thread of its own, and neither waits for the other.
"""

from __future__ import annotations

import dataclasses
import sys
import threading
import time
from typing import Any

from ig2mj.envs.environment import Environment
from ig2mj.vr.fed_poses import FedPoses
from ig2mj.vr.frames import PoseFrame
from ig2mj.vr.openxr.devices import DeviceFrame, Headset
from ig2mj.vr.openxr.egl import EglGraphics
from ig2mj.vr.play_area import moved
from ig2mj.vr.session import Session
from ig2mj.vr.stereo import Eye


class OpenXRPoses(FedPoses):
    """A `PoseSource`: the devices of a `Headset`, fed by its loop."""

    def __init__(self, headset: Headset):
        """Nobody is there before the first frame."""
        super().__init__()
        self._headset = headset

    def feed(self, frame: PoseFrame | None) -> None:
        """What devices say now; None: the session does not run."""
        with self._lock:
            if frame is not None:
                last = self._frame.time if self._frame is not None else frame.time
                self.area = moved(self.area, frame, frame.time - last)
            self._frame = frame

    def pulse(self, hand: int, strength: float, seconds: float) -> None:
        """See `PoseSource`."""
        self._headset.pulse(hand, strength, seconds)

    def close(self) -> None:
        """The person has left."""
        self.feed(None)


class HeadsetLoop:
    """The headset's side of a session. Attributes: images: drawn so far. rate: of them a second, lately."""

    def __init__(self, headset: Headset, source: OpenXRPoses, session: Session, graphics: EglGraphics | None):
        """`graphics`: None where nothing is drawn."""
        self._headset, self._source, self._session, self._graphics = headset, source, session, graphics
        self.pictures, self.rate, self._since, self._counted = 0, 0.0, time.monotonic(), 0

    def frame(self) -> None:
        """One frame of the headset."""
        begun = self._headset.wait()
        if begun is None:
            self._source.feed(None)
            return
        found, eyes = self._headset.locate(begun)
        self._source.feed(found)
        self._headset.end(begun, self._draw(begun, eyes))

    def run(self, seconds: float = 0.0) -> None:
        """Frames until the runtime ends the session, or for so long."""
        end = time.monotonic() + seconds if seconds else None
        asked = False
        while self._headset.running:
            if end is not None and not asked and time.monotonic() > end:
                asked = True
                self._headset.ask_to_end()
            self.frame()

    def _draw(self, frame: DeviceFrame, eyes: tuple[Eye, Eye] | None) -> bool:
        poses = self._session.track.at()
        if self._graphics is None or eyes is None or poses is None:
            return False
        area = self._source.area.pose
        left, right = (dataclasses.replace(eye, pose=area * eye.pose) for eye in eyes)
        self._graphics.draw(poses, (left, right))
        self.pictures += 1
        now = time.monotonic()
        if now - self._since > 1.0:
            self.rate = (self.pictures - self._counted) / (now - self._since)
            self._since, self._counted = now, self.pictures
        return True


def run_headset(env: Environment, common: dict[str, Any], seconds: float = 0.0, timing: bool = False) -> Session:
    """A person's session in a headset.

    Args:
      common: further arguments of `Session`. seconds: 0: until the runtime ends it, or Ctrl-C.

    Raises:
      MissingDependencyError: pyopenxr or a runtime is missing. EngineError: the runtime cannot do what is needed.
    """
    graphics, stop = EglGraphics(env.scene), threading.Event()
    with Headset(graphics) as headset:
        source = OpenXRPoses(headset)
        with Session(env, source, **common) as session:
            physics = threading.Thread(target=session.run, kwargs={"stop": stop}, name="ig2mj-physics")
            loop = HeadsetLoop(headset, source, session, graphics)
            if timing:
                threading.Thread(target=_tell, args=(session, loop, stop), daemon=True).start()
            print(f"{env.task.name} in {headset.system}", file=sys.stderr)
            physics.start()
            try:
                loop.run(seconds)
            except KeyboardInterrupt:
                print("", file=sys.stderr)
            finally:
                stop.set()
                physics.join()
    return session


def _tell(session: Session, loop: HeadsetLoop, stop: threading.Event) -> None:
    while not stop.wait(2.0):
        print(f"{session.timing.line()}   images {loop.rate:.0f}/s", file=sys.stderr, flush=True)
