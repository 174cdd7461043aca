"""`Environment.instruction`: what worlds are asked to do, in words.

Axis: W worlds.
"""

from __future__ import annotations

import functools

import numpy as np

from ig2mj.envs.config import EnvConfig
from ig2mj.envs.state import EnvState
from ig2mj.tasks.instructions import wordings
from ig2mj.tasks.task import TaskLike

ALL_HELD_OUT = "held_out:all"
"""The split whose instructions are worded as in no training."""


class Instructed:
    """Part of `Environment`."""

    task: TaskLike
    config: EnvConfig
    num_worlds: int

    @functools.cached_property
    def wordings(self) -> tuple[str, ...]:
        """The instructions of the environment's split that its worlds may get, the usual one first."""
        return wordings(self.task, self.config.split == ALL_HELD_OUT)

    def instruction(self, state: EnvState | None = None) -> tuple[str, ...]:
        """What each world is asked to do, [W]: the task's usual wording, or with the axis `instructions` of
        `ig2mj.Randomize` one that is drawn for each episode.

        Args:
          state: whose episodes; None: the usual wording.
        """
        draw = None if state is None else state.batch.draw
        if draw is None or draw.instruction is None:
            return (self.wordings[0],) * self.num_worlds
        return tuple(self.wordings[int(k) % len(self.wordings)] for k in np.asarray(draw.instruction))
