"""`Recorded`: `Simulation.record` and `replay`; `recording` is imported when they are used."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from ig2mj.process import entry_point

if TYPE_CHECKING:
    from ig2mj.demos.replay import Replayed
    from ig2mj.simulation.recording import SimulationRecorder


@entry_point
class Recorded:
    """What a `Simulation` does about recordings of itself."""

    _recorder: SimulationRecorder | None = None

    def record(self, file: str | os.PathLike) -> SimulationRecorder:
        """Records every control step from now on, until the recorder is closed; a context manager.

        Args:
          file: HDF5, replaced if it is there.

        Raises:
          InputError: it cannot be written. EngineError: this simulation is recorded already.
        """
        from ig2mj.simulation.recording import SimulationRecorder

        return SimulationRecorder(self, file)  # pyright: ignore[reportArgumentType]

    def replay(self, file: str | os.PathLike) -> Replayed:
        """Takes every control step of a recording again, and compares every byte of every frame.

        The world is the recording's last one afterwards. On the native engine it is the same to the bit.

        Raises:
          InputError: the file is broken, or of another scene, engine, version or way of grasping; it names the pair.
        """
        from ig2mj.demos.reader import Recording
        from ig2mj.simulation.recording import replayed

        with Recording(file) as recording:
            return replayed(self, recording)  # pyright: ignore[reportArgumentType]
