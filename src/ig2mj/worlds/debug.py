"""Debug mode: every step is checked on the host; the first world that goes wrong is dumped and raises."""

from __future__ import annotations

import os
import pathlib

import jax
import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError
from ig2mj.predicates.compile import Verdict
from ig2mj.scene.scene import Scene
from ig2mj.worlds import guards
from ig2mj.worlds.batch import Batch, Worlds
from ig2mj.worlds.recorder import LENGTH, Recording, frames_of, record, save_dump, start_recording


class DebugWorlds:
    """`Worlds` stepped under watch. Slower: it waits for the device in every step, and copies every world's state."""

    def __init__(self, worlds: Worlds, scene: Scene, folder: str | os.PathLike = "dumps", length: int = LENGTH):
        """Binds worlds of a scene to a folder for dumps; `length`: control steps kept."""
        self.worlds, self.scene, self.folder, self.length = worlds, scene, pathlib.Path(folder), length
        pure = worlds.engine.pure
        self._step = jax.jit(worlds.step) if pure else worlds.step
        self._reset = jax.jit(worlds.reset) if pure else worlds.reset
        self._recording: Recording | None = None
        self._seen: np.ndarray | None = None

    def start(self, seed: int = 0) -> Batch:
        """All worlds at the start of episode 0, and an empty recording."""
        batch = self.worlds.start(seed)
        self._recording = start_recording(self.worlds.engine, batch, self.length)
        return batch

    def step(self, batch: Batch, ctrl: Float[Array, "W nu"] | None = None) -> tuple[Batch, Verdict | None]:
        """One control step.

        Raises:
          EngineError: a world is flagged; names world, flag, values, the setting to raise, and the dump.
        """
        assert self._recording is not None, "start first"
        batch, verdict = self._step(batch, ctrl)
        self._recording = record(self.worlds.engine, self._recording, batch)
        flagged = np.flatnonzero(np.asarray(batch.flags))
        if len(flagged):
            raise EngineError(self._report(batch, int(flagged[0])))
        return batch, verdict

    def reset(self, batch: Batch, mask: Array) -> Batch:
        """See `Worlds.reset`."""
        return self._reset(batch, mask)

    def _report(self, batch: Batch, world: int) -> str:
        assert self._recording is not None
        scene = self.scene
        health = self.worlds.engine.health(batch.world.physics)
        flags, overflow = int(np.asarray(batch.flags)[world]), int(np.asarray(health.overflow)[world])
        step = int(np.asarray(batch.world.step)[world])
        speed = float(np.asarray(health.top_speed)[world])
        self.folder.mkdir(parents=True, exist_ok=True)
        file = self.folder / f"world{world}_step{step}.npz"
        text = guards.explain(world, flags, overflow) + f"; step {step}, top speed {speed:.3g} m/s"
        note = {"world": world, "step": step, "flags": flags, "overflow": overflow, "text": text}
        save_dump(frames_of(self._recording, world), file, scene.name, note, scene.model)
        return f"{text}; the last {self.length} steps: ig2mj view {scene.folder} --dump {file}"
