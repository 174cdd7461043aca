"""`Stage`: an environment that plays several axes of an episode file, so that its programs are compiled once.

    for stage in stages(episodes, ("nominal", "lights", "homes"), count=8, robot="humanoid"):
        env = stage.environment({"robot": "humanoid", "worlds": 8})
        for axis in stage.axes:
            state = stage.start(env, axis, range(8))

What an axis does not vary has the value of the scene in its episodes (`ig2mj.worlds.starts.Starts.with_values`): they
are those of an environment of its own. Axes share an environment where it has the same household:

- in the task's home, all that have the usual models;
- in the task's home, all that have other models (`objects`, `all`), which wait outside of the house;
- each other home.

Of files without values (format 1), where everything follows from seeds, each axis has an environment of its own, and
so have axes with `robot_start` for a robot that the file does not know.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.registry import make
from ig2mj.learn.episode_draws import Beginning
from ig2mj.learn.episodes import POSES, EpisodePart, Episodes
from ig2mj.process.gc_pause import Traced
from ig2mj.tasks.instructions import wordings
from ig2mj.worlds.pool import Pool, stack

MODELS, START, WORDS = "objects", "robot_start", "instructions"
"""Axes that change the household, that need the robot in the file, and that change the wordings of an environment."""


@dataclasses.dataclass(frozen=True)
class Stage:
    """See the module's text.

    Attributes:
      axes: that it plays, in order. part: their episodes. settings: of `ig2mj.Randomize`, of all axes together.
    """

    episodes: Episodes
    axes: tuple[str, ...]
    part: EpisodePart
    settings: Mapping[str, Any]

    @property
    def options(self) -> dict[str, Any]:
        """Of `ig2mj.make`: home, start states, and what varies."""
        if self.part.home is not None:
            return {"home": self.part.home, "pool": self.episodes.homes[self.part.home]}
        return {"pool": self._pool, **({"randomize": dict(self.settings)} if self.settings else {})}

    @property
    def _pool(self) -> Pool:
        """The usual start states, then those of `object_poses`, as far as the axes need them."""
        poses = self.episodes.poses
        pools = [self.episodes.pool] if any(not self._poses(axis) for axis in self.axes) else []
        return stack([*pools, *([poses] if poses is not None and any(map(self._poses, self.axes)) else [])])

    def _poses(self, axis: str) -> bool:
        return POSES in self.episodes.axes[axis]

    def environment(self, options: Mapping[str, Any]) -> Environment:
        """Makes it. `options`: of `ig2mj.make`; there are no more worlds than episodes."""
        worlds = min(options.get("worlds", 1), len(self.part.numbers))
        return make(self.episodes.header["task"], **{**options, "worlds": worlds, **self.options})

    def start(self, env: Environment, axis: str, rows: Sequence[int]) -> EnvState:
        """The state at the start of episodes: rows of the part, one in each world, again from the first where there
        are fewer. `env`: of `environment`; `env.instruction` then is as in these episodes."""
        header, varied = self.episodes.header, self.episodes.axes[axis]
        env.wordings = tuple(header["instructions"]["held_out"]) if WORDS in varied else wordings(env.task)
        return self._beginning(env, axis, rows).start(env)

    def programs(self, env: Environment, axis: str, rows: Sequence[int]) -> list[Traced]:
        """Those that `start` runs, and `env.following` (`Environment.start_programs`)."""
        return self._beginning(env, axis, rows).programs(env)

    def _beginning(self, env: Environment, axis: str, rows: Sequence[int]) -> Beginning:
        numbers = np.asarray(rows, int) % len(self.part.numbers)
        usual = any(not self._poses(one) for one in self.axes)
        behind = self.episodes.count if usual and self._poses(axis) else 0
        return self.episodes.beginning(env, axis, self.part, numbers.tolist(), behind)


def stages(episodes: Episodes, axes: Sequence[str], count: int, robot: Any = None) -> list[Stage]:
    """What plays the first episodes of each axis, in the order of the axes.

    Args:
      robot: as of `ig2mj.make`; None: the task's first.

    Raises:
      EngineError: the file lacks an axis.
    """
    found: list[Stage] = []
    for axis in axes:
        for part in episodes.parts(axis, count):
            settings = {name: of for name, of in episodes.axes[axis].items() if name != POSES}
            at = next((k for k, stage in enumerate(found) if _fits(stage, part, settings, robot)), None)
            if at is None:
                found.append(Stage(episodes, (axis,), part, settings))
            else:
                together = {**found[at].settings, **settings}
                found[at] = dataclasses.replace(found[at], axes=(*found[at].axes, axis), settings=together)
    return found


def _fits(stage: Stage, part: EpisodePart, settings: Mapping[str, Any], robot: Any) -> bool:
    """Whether an axis with these settings can be played by a stage."""
    draws = stage.episodes.draws
    known = robot is None or (isinstance(robot, str) and robot in draws.robots)
    alike = all(stage.settings.get(name, of) == of for name, of in settings.items())
    household = (MODELS in settings) == (MODELS in stage.settings)
    moved = START in settings or START in stage.settings
    return part == stage.part and household and alike and bool(draws.arrays) and (known or not moved)
