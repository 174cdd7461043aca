"""Values that were drawn for the episodes of a file, so that they stay when the code that draws changes.

    values = EpisodeDraws.drawn(environments, episodes)
    starts, draw = values.made(env, rows, numbers, seeds, ["lights"])
    state = env.start_with(starts, draw, rows, seeds)

Of each episode: the models of the task's objects, lights, cameras, the strength of noise, the wording, and where each
robot starts. Factors of objects and materials (`Randomization.values`) come in `SETS` sets, of which episode k has set
k % SETS: there are hundreds of them.

Axes: N episodes, S sets.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import EngineError
from ig2mj.process.gc_pause import Traced
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.random_streams import episode_keys

SETS = 64
"""Sets of factors of objects and materials."""

FACTORS = ("mass", "friction", "damping", "object_colour", "material_colour", "exchanged")
"""Values that come in sets."""

PLAIN = ("light_colour", "light_quat", "camera_pos", "camera_quat", "camera_slope", "noise", "instruction")
"""Values of each episode, fields of `Draw`."""

OF_AXIS = {
    "physics": ("mass", "friction", "damping"),
    "materials": ("object_colour", "material_colour", "exchanged"),
    "lights": ("light_colour", "light_quat"),
    "camera": ("camera_pos", "camera_quat", "camera_slope"),
    "sensor_noise": ("noise",),
    "instructions": ("instruction",),
}
"""Values of each axis of `ig2mj.Randomize`; robots' starts and models are named by robot and object."""


@dataclasses.dataclass(frozen=True)
class Beginning:
    """What episodes start from, one in each world. Attributes: starts, draw: see `EpisodeDraws.made`. rows: of the
    environment's pool. seeds: of each."""

    starts: Pool | None
    draw: Draw | None
    rows: np.ndarray
    seeds: tuple[int, ...]

    def start(self, env: Environment) -> EnvState:
        """The state at the start."""
        if self.starts is None:
            return env.start_from(self.rows, list(self.seeds))
        return env.start_with(self.starts, self.draw, self.rows, list(self.seeds))

    def programs(self, env: Environment) -> list[Traced]:
        """Those that `start` runs (`Environment.start_programs`)."""
        return env.start_programs(self.starts, self.draw, self.rows, list(self.seeds))


@dataclasses.dataclass(frozen=True)
class EpisodeDraws:
    """See the module's text.

    Attributes:
      arrays: [S, ...] of `FACTORS`, [N, ...] of `PLAIN`. robots: [N, 3] of each robot: `Draw.robot_start`.
      models: [N][R] names of the models of the objects that vary; (): none do.
    """

    arrays: Mapping[str, np.ndarray]
    robots: Mapping[str, np.ndarray]
    models: Sequence[Sequence[str]] = ()

    def values(self, axes: Sequence[str], numbers: Sequence[int], robot: str = "") -> dict[str, np.ndarray]:
        """Of some episodes and axes, in single precision."""
        found, rows = {}, np.asarray(numbers, int)
        for name in (name for axis in axes for name in OF_AXIS.get(axis, ())):
            if name in self.arrays:
                own = self.arrays[name][rows % SETS if name in FACTORS else rows]
                found[name] = own if own.dtype.kind in "iu" else own.astype(np.float32)
        if "robot_start" in axes and robot in self.robots:
            found["robot_start"] = self.robots[robot][rows].astype(np.float32)
        return found

    def made(
        self,
        env: Environment,
        rows: Sequence[int],
        numbers: Sequence[int],
        seeds: Sequence[int],
        axes: Sequence[str],
    ) -> tuple[Pool | None, Draw | None]:
        """States at the start of these episodes, one for each world of an environment, and what was drawn for them;
        None: they are rows of the environment's pool as they are, or follow from the seeds, in files without values.

        Args:
          env: with the axes that vary; others of its axes are as the scene has them. rows: of its pool. numbers: of
            the episodes. seeds: theirs, for what is drawn in the course of an episode. axes: those that vary.

        Raises:
          EngineError: the file lacks a model of the environment's, or the other way round, or values of an axis.
        """
        starts, randomize = env.core.starts, env.config.randomize
        if randomize is None or not self.arrays:
            return None, None
        varied = [axis for axis in randomize.axes if axis in axes]
        for axis in varied:
            if lacking := [name for name in OF_AXIS.get(axis, ()) if name not in self.arrays]:
                raise EngineError(f"the file has no values of {', '.join(lacking)} for the axis {axis}")
        values = self.values(varied, numbers, env.robot)
        if "robot_start" in varied and "robot_start" not in values:  # a robot that the file does not know
            zero = np.zeros(len(rows), np.int32)
            choice = starts.choices(np.asarray(rows, np.int32), episode_keys(np.array(seeds, np.int32), zero, zero))
            assert starts.robot_starts is not None and choice.robot_start is not None
            values["robot_start"] = starts.robot_starts.offsets[np.asarray(choice.robot_start)]
        usual = starts.randomization.neutral(len(rows))
        values |= {name: _as_wide(array, usual[name]) for name, array in values.items() if name in FACTORS}
        models = self._choices(env, numbers) if "objects" in varied else None
        return starts.with_values(np.asarray(rows, np.int32), values, models)

    def _choices(self, env: Environment, numbers: Sequence[int]) -> np.ndarray:
        known = model_names(env)
        found = []
        for number in numbers:
            names = tuple(self.models[number]) if self.models else ()
            if names not in known:
                raise EngineError(f"episode {number} is with {', '.join(names) or 'no models'}, which the file lacks")
            found.append(known.index(names))
        return np.array(found, np.int32)

    @classmethod
    def drawn(cls, envs: Mapping[str, Environment], seeds: Sequence[int], again: Any = None) -> EpisodeDraws:
        """What the seeds of episodes say.

        Args:
          envs: of each robot, with all axes, their pools with a row for each episode. again: a second pool of start
            states on which models and robots' starts must be possible as well.
        """
        first = next(iter(envs.values()))
        numbers, zero = np.arange(len(seeds)), np.zeros(len(seeds), np.int32)
        keys, made = episode_keys(np.array(seeds, np.int32), zero, zero), first.core.starts.randomization
        values, used = jax.device_get(made.values(keys[:SETS])), made.used()
        draw = jax.device_get(made.draw(keys))
        arrays = {}
        for name in FACTORS:
            if name in values:
                usual = -1.0 if name == "exchanged" else 1.0
                keep = used[name].reshape(-1, *[1] * (values[name].ndim - 2))
                arrays[name] = np.where(keep, values[name], usual).astype(np.float16)
        for name in PLAIN:
            array = getattr(draw, name)
            if array is not None:
                whole = np.asarray(array)
                arrays[name] = whole.astype(np.int32 if whole.dtype.kind in "iu" else np.float16)
        robots, models = {}, ()
        for robot, env in envs.items():
            starts, axes = env.core.starts, env.config.randomize.axes if env.config.randomize else ()
            choice = starts.choices(numbers.astype(np.int32), keys, again)
            if choice.robot_start is not None:
                assert starts.robot_starts is not None
                robots[robot] = starts.robot_starts.offsets[np.asarray(choice.robot_start)].astype(np.float32)
            if env is first and "objects" in axes:
                known = model_names(env)
                models = [list(known[int(k)]) for k in np.asarray(choice.models)]
        return cls(arrays, robots, models)


def _as_wide(values: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Factors of the objects or materials that an environment has. A file has those of the home with all models and
    its first robot; environments have fewer models, whose objects and materials come behind the home's and before the
    robot's, which have no factor. `usual`: of the environment, where the file has none."""
    found, known = usual.copy(), min(values.shape[1], usual.shape[1])
    found[:, :known] = values[:, :known]
    return found


def model_names(env: Environment) -> list[tuple[str, ...]]:
    """ "category/model" of the objects of each choice of an environment whose objects vary."""
    entries = {entry.name: f"{entry.category}/{entry.model}" for entry in env.scene.manifest.objects}
    objective: Any = getattr(env.objective, "base", env.objective)
    return [tuple(entries[name] for name in names) for names in objective.swaps.names]


def described_draw(values: Mapping[str, np.ndarray], names: Sequence[str]) -> dict[str, Any]:
    """The values of one episode for people. `values`: of `EpisodeDraws.values`. `names`: of the scene's objects."""
    found: dict[str, Any] = {}
    for name, array in values.items():
        one = np.asarray(array)[0]
        if name in ("mass", "friction", "damping"):
            found[name] = {names[k]: round(float(f), 3) for k, f in enumerate(one[: len(names)]) if f != 1.0}
        elif name == "object_colour":
            changed = [k for k, rgb in enumerate(one[: len(names)]) if (rgb != 1.0).any()]
            found[name] = {names[k]: one[k].astype(float).round(3).tolist() for k in changed}
        elif name == "exchanged":
            found[name] = {names[k]: round(float(f), 3) for k, f in enumerate(one[: len(names)]) if f >= 0}
        else:
            found[name] = one.astype(float).round(4).tolist() if one.dtype.kind == "f" else one.tolist()
    return found
