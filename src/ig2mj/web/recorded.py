"""Recordings of environments as something to look at: every frame as it was written, with a time line.

Of thin recordings, such as those that ship, the frames between the first and the last one are not in the file: they
come out again when the actions are taken from the frame before, or from the first one where someone goes back.
"""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.replay import Replayer
from ig2mj.demos.writer import FLUSH
from ig2mj.envs.environment import EnvState
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
        if "task" not in recording.header:
            raise InputError(
                recording.file, "is not a recording of an environment", fix="`Simulation.replay` replays it"
            )
        whole = all(run.kept(k, min(k + FLUSH, run.frames)).all() for run in self._runs for k in _starts(run))
        self._replayer = Replayer(recording, "state" if whole else "action")
        env = self._replayer.env
        rules = rules_of(env.core)
        self.scene, self.model, self.goal = env.scene, rules.model, rules.goal
        self.num_worlds, self.rows, self.period = 1, 0, env.period
        self.warnings = self._replayer.warnings
        self.runs = [_title(k, run.attributes) for k, run in enumerate(self._runs)]
        self.run, self.frame = 0, 0
        self._at = (0, -1)  # run and frame of the state
        self._state: EnvState | None = None
        self.frames = self._runs[0].frames
        self.seek(0)

    def seek(self, frame: int, run: int | None = None) -> None:
        if run is not None and 0 <= run < len(self._runs):
            self.run = run
        shown = self._runs[self.run]
        self.frames = shown.frames
        frame = min(max(frame, 0), shown.frames - 1)
        if shown.kept(frame, frame + 1)[0]:
            self._state = self._replayer.at(shown, frame, self._state)
        else:
            before = self._at[1] if self._at[0] == self.run else -1
            if not 0 <= before <= frame:
                before, self._state = 0, self._replayer.at(shown, 0)
            for k in range(before, frame):
                self._act(shown, k)
        self.frame, self._at = frame, (self.run, frame)

    def _act(self, run: Run, step: int) -> None:
        """Takes an action of the run in its world; the other worlds do nothing."""
        env = self._replayer.env
        action = np.zeros((env.num_worlds, *env.action_space.shape), np.float32)
        action[run.world] = run.rows("steps/action", step, step + 1, action[0])[0]
        assert self._state is not None
        self._state = env.step(self._state, action)

    def step(self) -> None:
        if self.frame < self.frames - 1:
            self.seek(self.frame + 1)

    def reset(self, world: int, row: int | None = None) -> None:
        self.seek(0)

    def shot(self, world: int, jump: bool = False) -> Shot:
        assert self._state is not None
        now, run = self._state.batch.world, self._runs[self.run]
        facts = [("frame", f"{self.frame} of {self.frames - 1}")]
        if self.frame and "reward/total" in run.step_names:
            facts.append(("reward", f"{float(run.rows('steps/reward/total', self.frame - 1, self.frame)[0]):.3g}"))
        if self.frame == self.frames - 1:
            facts.append(("episode", "success" if run.attributes.get("success") else "over"))
        time, engine = float(np.asarray(now.time)[run.world]), self._replayer.env.core.engine
        return shot_of(engine, now.view, now.states, run.world, time, facts=tuple(facts), jump=jump, period=self.period)

    def mujoco(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        return None


def _starts(run: Run) -> range:
    return range(0, run.frames, FLUSH)


def _title(number: int, attributes: dict) -> str:
    success = attributes.get("success")
    how = "" if success is None else ", success" if success else ", no success"
    return f"{number}: world {attributes.get('world', 0)}{how}"
