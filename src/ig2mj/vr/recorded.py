"""`RecordedPoses`: devices that say again what they said in a recording."""

from __future__ import annotations

import os

import numpy as np

from ig2mj.demos.reader import Recording
from ig2mj.demos.writer import FLUSH
from ig2mj.vr.frames import SHAPES, Pose, PoseFrame, from_arrays


class RecordedPoses:
    """A `PoseSource` of a recorded session; every `poll` gives the next frame, and None past the last one.

    The play area is where it was then, so that the same start and the same frames make the same actions.
    """

    def __init__(self, file: str | os.PathLike, run: int = 0):
        """Reads the frames of a run.

        Raises:
          InputError: the file is not a recording, has no such run, or none of what devices say.
        """
        self._frames: list[PoseFrame | None] = []
        with Recording(file) as recording:
            if not 0 <= run < len(recording.runs):
                raise recording.runs[0].broken("run", f"there are {len(recording.runs)} runs")
            one = recording.runs[run]
            count = max(one.frames - 1, 0)
            missing = [name for name in SHAPES if f"devices/{name}" not in one.step_names]
            if missing:
                raise one.broken(f"steps/devices/{missing[0]}", "is missing: this run was not driven by a person")
            for start in range(0, count, FLUSH):
                stop = min(start + FLUSH, count)
                rows = {
                    name: one.rows(f"steps/devices/{name}", start, stop, np.zeros(shape))
                    for name, shape in SHAPES.items()
                }
                for k in range(stop - start):
                    arrays = {name: np.asarray(a[0 if len(a) == 1 else k]) for name, a in rows.items()}
                    try:
                        self._frames.append(from_arrays(arrays))
                    except ValueError as e:
                        raise one.broken("steps/devices", f"frame {start + k}: {e}") from e
        self._next = 0
        self.pulses: list[tuple[int, float]] = []

    def __len__(self) -> int:
        """Frames."""
        return len(self._frames)

    @property
    def over(self) -> bool:
        """Every frame was given."""
        return self._next >= len(self._frames)

    def poll(self) -> PoseFrame | None:
        """The next frame."""
        if self.over:
            return None
        self._next += 1
        return self._frames[self._next - 1]

    def stand_at(self, body: Pose) -> PoseFrame | None:
        """The same frame again: the play area is where it was."""
        return self._frames[self._next - 1] if self._next else None

    def pulse(self, hand: int, strength: float, seconds: float) -> None:
        """Nobody feels it."""

    def close(self) -> None:
        """Nothing is left open."""
