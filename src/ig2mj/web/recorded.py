"""Recordings of environments as something to look at: every frame as it was written, with a time line."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.demos.reader import Recording
from ig2mj.demos.replay import Replayer
from ig2mj.errors import InputError
from ig2mj.web.shots import Shot, shot_of
from ig2mj.web.sources import rules_of


class Recorded:
    """A recording. See `ig2mj.web.sources.Source` and `Timeline`. Attributes: warnings: see `Replayed`."""

    def __init__(self, recording: Recording):
        """Opens its first run that has frames; `recording` stays open as long as this is used.

        Raises:
          InputError: it has none, or is broken; others as of `Replayer`.
        """
        self._runs = [run for run in recording.runs if run.frames]
        if not self._runs:
            raise InputError(recording.file, "has no run with frames")
        self._replayer = Replayer(recording, "state")
        env = self._replayer.env
        rules = rules_of(env.core)
        self.scene, self.model, self.goal = env.scene, rules.model, rules.goal
        self.num_worlds, self.rows, self.period = 1, 0, 0.1
        self.warnings = self._replayer.warnings
        self.runs = [_title(k, run.attributes) for k, run in enumerate(self._runs)]
        self.run, self.frame = 0, 0
        self.frames = self._runs[0].frames
        self.seek(0)

    def seek(self, frame: int, run: int | None = None) -> None:
        if run is not None and 0 <= run < len(self._runs):
            self.run = run
        shown = self._runs[self.run]
        self.frames = shown.frames
        self.frame = min(max(frame, 0), shown.frames - 1)
        self._state = self._replayer.at(shown, self.frame)

    def step(self) -> None:
        if self.frame < self.frames - 1:
            self.seek(self.frame + 1)

    def reset(self, world: int, row: int | None = None) -> None:
        self.seek(0)

    def shot(self, world: int, jump: bool = False) -> Shot:
        now, run = self._state.batch.world, self._runs[self.run]
        facts = [("frame", f"{self.frame} of {self.frames - 1}")]
        if self.frame and "reward/total" in run.step_names:
            facts.append(("reward", f"{float(run.rows('steps/reward/total', self.frame - 1, self.frame)[0]):.3g}"))
        if self.frame == self.frames - 1:
            facts.append(("episode", "success" if run.attributes.get("success") else "over"))
        time, pure = float(np.asarray(now.time)[run.world]), self._replayer.env.core.engine.pure
        return shot_of(now.view, now.states, run.world, time, pure, facts=tuple(facts), jump=jump, period=self.period)

    def mujoco(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        return None


def _title(number: int, attributes: dict) -> str:
    success = attributes.get("success")
    how = "" if success is None else ", success" if success else ", no success"
    return f"{number}: world {attributes.get('world', 0)}{how}"
