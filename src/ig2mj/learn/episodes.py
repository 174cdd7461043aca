"""Episode files: fixed episodes of a task on which policies are compared, the same on every machine.

    episodes = Episodes.load(find_episodes("CookingMeat"))
    part = episodes.parts("lights", count=8)[0]
    env = ig2mj.make("CookingMeat", worlds=8, **episodes.options("lights", part.home))
    state = episodes.start(env, "lights", part, range(8))

A file has of each episode the poses and states of all objects of the home (a row of a pool), a second start state for
the axis `object_poses`, one in another home for the axis `homes`, and all values that were drawn for it
(`ig2mj.learn.episode_draws`); and of all of them the home with its objects, the robots with their cameras, the
instructions, and for each axis the settings of `ig2mj.Randomize`. The seed of an episode is for what is drawn in its
course, such as noise. Its hash is part of its header.

The axis `nominal` varies nothing; `homes` the home; others are those of `Randomize`, one at a time; `all` is all of
these together.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import msgspec
import numpy as np

from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.registry import find_task, make
from ig2mj.errors import EngineError, InputError, UnknownNameError
from ig2mj.learn.episode_draws import FACTORS, SETS, Beginning, EpisodeDraws, described_draw, model_names
from ig2mj.scene.found_again import entries_of
from ig2mj.sensors.cameras import camera_names
from ig2mj.tasks.homes import in_home
from ig2mj.tasks.instructions import wordings
from ig2mj.tasks.model_choices import widened
from ig2mj.tasks.object_poses import spread_starts
from ig2mj.tasks.pools import bare_scene, pool_of
from ig2mj.tasks.relocation import reason_against
from ig2mj.tasks.splits import HELD_OUT_HOMES
from ig2mj.tasks.task import Task
from ig2mj.tasks.variants import variant
from ig2mj.worlds.archive import pack, read_header, save_tree, unpack
from ig2mj.worlds.pool import Pool, pool_of_arrays
from ig2mj.worlds.randomize import AXES, Objects, Randomize

KIND, FORMAT_VERSION = "episodes", 2
"""1: without values, which then follow from the seeds, and without `object_poses` and `homes`."""

NOMINAL, ALL, HOMES, POSES = "nominal", "all", "homes", "object_poses"

EVERY = (NOMINAL, *AXES, HOMES, ALL)
"""Names of axes, in the order of tables."""

COUNT = 200
"""Episodes of a file, and of an evaluation unless another number is asked for."""

SEED = 5_000_011
"""Of the first episode; each has the next one."""

HELD_OUT = "held_out"

FIX = "`ig2mj episodes make TASK` writes such files"

_HERE = pathlib.Path(__file__).resolve()

FOLDERS = (_HERE.parents[3] / "episodes", _HERE.parents[2] / "ig2mj_episodes")
"""Where files ship: in a checkout, and next to the installed package."""


def parse_axes(text: str) -> tuple[str, ...]:
    """Axes of a list such as "nominal,lights"; "all" alone is every axis, and their combination.

    Raises:
      UnknownNameError: no such axis, with near matches. EngineError: none is named.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise EngineError(f"no axis is named (there is {', '.join(EVERY)})")
    for name in names:
        if name not in EVERY:
            raise UnknownNameError("axis", name, EVERY)
    if names == [ALL]:
        return EVERY
    return tuple(dict.fromkeys((NOMINAL, *names)))


@dataclasses.dataclass(frozen=True)
class EpisodePart:
    """Episodes that are played in one environment. Attributes: home: None: the task's own. numbers: in the file; the
    k-th is row k of the environment's pool."""

    home: str | None
    numbers: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class Episodes:
    """See the module's text.

    Attributes:
      header: all that is no array, with "hash". pool: start states, a row for each episode. seeds: of each episode.
      draws: values that were drawn. poses: start states of the axis `object_poses`. homes: by home, those of `homes`:
        episode k is in the home k % H, its row k // H.
    """

    header: dict[str, Any]
    pool: Pool
    seeds: tuple[int, ...]
    draws: EpisodeDraws
    poses: Pool | None = None
    homes: Mapping[str, Pool] = dataclasses.field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of episodes."""
        return len(self.seeds)

    @property
    def axes(self) -> dict[str, dict[str, Any]]:
        """Settings of `Randomize` of each axis."""
        return self.header["axes"]

    def check_axis(self, axis: str) -> None:
        """Raises EngineError: the file lacks an axis."""
        if axis not in self.axes:
            raise EngineError(f"the episodes of {self.header['task']} have no axis '{axis}' ({', '.join(self.axes)})")

    def parts(self, axis: str, count: int) -> list[EpisodePart]:
        """The first episodes of an axis, by environment. Raises EngineError: the file lacks it."""
        self.check_axis(axis)
        if axis != HOMES:
            return [EpisodePart(None, tuple(range(count)))]
        homes = list(self.homes)
        numbers = [tuple(range(k, count, len(homes))) for k in range(len(homes))]
        return [EpisodePart(home, own) for home, own in zip(homes, numbers, strict=True) if own]

    def options(self, axis: str, home: str | None = None) -> dict[str, Any]:
        """Of `ig2mj.make`: start states, and what varies in an axis. Raises EngineError: the file lacks it.

        Args:
          home: of `EpisodePart`.
        """
        self.check_axis(axis)
        settings = dict(self.axes[axis])
        if home is not None:
            return {"home": home, "pool": self.homes[home]}
        pool = self.pool
        if settings.pop(POSES, None) is not None:
            assert self.poses is not None
            pool = self.poses
        return {"pool": pool, **({"randomize": settings} if settings else {})}

    def start(self, env: Environment, axis: str, part: EpisodePart, rows: Sequence[int]) -> EnvState:
        """The state at the start of episodes: rows of a part, each in one world of an environment in which the axis
        varies. What else varies there is as the scene has it."""
        return self.beginning(env, axis, part, rows).start(env)

    def beginning(
        self, env: Environment, axis: str, part: EpisodePart, rows: Sequence[int], behind: int = 0
    ) -> Beginning:
        """What `start` starts from. `behind`: rows of the environment's pool before those of the axis."""
        numbers = [part.numbers[int(row) % len(part.numbers)] for row in rows]
        rows = [int(row) % len(part.numbers) for row in rows] if part.home is not None else numbers
        rows, seeds = [behind + row for row in rows], [self.seeds[number] for number in numbers]
        starts, draw = self.draws.made(env, rows, numbers, seeds, tuple(self.axes[axis]))
        return Beginning(starts, draw, np.asarray(rows, np.int32), tuple(seeds))

    def described_draws(self, axis: str, number: int, robot: str, names: Sequence[str]) -> dict[str, Any]:
        """What was drawn for an episode, for people. `names`: of the scene's objects."""
        found = described_draw(self.draws.values(tuple(self.axes[axis]), [number], robot), names)
        if "objects" in self.axes[axis] and self.draws.models:
            found["models"] = list(self.draws.models[number])
        return found

    def save(self, file: str | os.PathLike) -> None:
        """Writes it. Raises InputError."""
        save_tree(file, _tree(self), self.header)

    @classmethod
    def load(cls, file: str | os.PathLike) -> Episodes:
        """Reads it.

        Raises:
          InputError: it is missing, damaged, no such file, or changed since it was made.
        """
        header = read_header(file)
        if header.get("kind") != KIND or header.get("format_version") not in (1, FORMAT_VERSION):
            raise InputError(file, f"holds no episodes of format 1 to {FORMAT_VERSION}", fix=FIX)
        try:
            known = msgspec.convert(header, _Header)
        except (msgspec.ValidationError, RecursionError) as e:
            raise InputError(file, str(e), element="header", fix=FIX) from e
        arrays, _ = unpack(pathlib.Path(file).read_bytes())
        seeds = arrays.pop("seeds", np.zeros(0, np.int32))
        if seeds.ndim != 1 or seeds.dtype.kind != "i" or not len(seeds):
            raise InputError(file, "is no list of whole numbers", element="seeds", fix=FIX)

        def pool(prefix: str, digest: str) -> Pool:
            rows = {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}
            return dataclasses.replace(pool_of_arrays(rows, None, str(file)), digest=digest)

        def named(prefix: str) -> dict[str, np.ndarray]:
            return {name.removeprefix(prefix): a for name, a in arrays.items() if name.startswith(prefix)}

        draws = EpisodeDraws(named("draws."), named("robots."), known.models)
        poses = pool("poses.", known.digest) if any(name.startswith("poses.") for name in arrays) else None
        homes = {home: pool(f"homes.{home}.", digest) for home, digest in known.homes.items()}
        found = cls(header, pool("pool.", known.digest), tuple(map(int, seeds)), draws, poses, homes)
        found.check_rows(file)
        if known.hash != digest_of(found):
            raise InputError(file, "has changed since it was made: its hash does not fit", element="hash", fix=FIX)
        return found

    def check_rows(self, file: str | os.PathLike) -> None:
        """Raises InputError: an array has not one row for each episode, or for each set of values."""
        wrong = [f"pool.{k}" for k, a in enumerate(jax.tree.leaves(self.pool)) if len(a) != self.count]
        if self.poses is not None:
            wrong += [f"poses.{k}" for k, a in enumerate(jax.tree.leaves(self.poses)) if len(a) != self.count]
        for name, array in self.draws.arrays.items():
            if len(array) != (min(SETS, self.count) if name in FACTORS else self.count):
                wrong.append(f"draws.{name}")
        wrong += [f"robots.{name}" for name, a in self.draws.robots.items() if a.shape != (self.count, 3)]
        if self.draws.models and len(self.draws.models) != self.count:
            wrong.append("models")
        for k, (home, pool) in enumerate(self.homes.items()):
            least = len(range(k, self.count, len(self.homes)))
            wrong += [f"homes.{home}.{n}" for n, a in enumerate(jax.tree.leaves(pool)) if len(a) < least]
        if wrong:
            raise InputError(file, f"has not {self.count} rows", element=wrong[0], fix=FIX)


class _Header(msgspec.Struct):
    task: str
    scene: str
    digest: str
    grasping: str
    hash: str
    axes: dict[str, dict[str, Any]]
    instructions: dict[str, list[str]]
    objects: list[dict[str, Any]] = []
    robots: dict[str, Any] = {}
    models: list[list[str]] = []
    homes: dict[str, str] = {}


def _tree(episodes: Episodes) -> dict[str, Any]:
    """All arrays of a file."""
    draws = episodes.draws
    tree: dict[str, Any] = {"pool": episodes.pool, "seeds": np.array(episodes.seeds, np.int32)}
    tree |= {"draws": dict(draws.arrays), "robots": dict(draws.robots), "homes": dict(episodes.homes)}
    return tree if episodes.poses is None else {**tree, "poses": episodes.poses}


def digest_of(episodes: Episodes) -> str:
    """Hash of everything in a file."""
    hashed = hashlib.blake2b(digest_size=16)
    plain = {name: value for name, value in episodes.header.items() if name != "hash"}
    hashed.update(msgspec.json.encode(plain, order="deterministic"))
    arrays, _ = unpack(pack(_tree(episodes), {}))
    for name in sorted(arrays):
        hashed.update(f"{name} {arrays[name].dtype} {arrays[name].shape}".encode())
        hashed.update(np.ascontiguousarray(arrays[name]).data)
    return hashed.hexdigest()


def make_episodes(task: str, count: int = COUNT, grasping: str | None = None) -> Episodes:
    """Episodes of a task on its first held-out start states, and in the held-out homes that it fits into.

    Raises:
      EngineError: not one of the paper's activities. UnknownNameError: no such task.
    """
    known = find_task(task)
    if not isinstance(known, Task):
        raise EngineError(f"episodes of {task}: start states of the paper's activities and of tasks like them are kept")
    base = variant(known, 0, grasping or known.grasping)
    axes = _possible(task, grasping)
    options: dict[str, Any] = {"grasping": grasping, "engine": "native", "split": f"{HELD_OUT}:objects"}
    envs = {robot: make(task, robot=robot, pool_size=count, randomize=axes, **options) for robot in known.robots}
    plain = make(task, pool_size=count, grasping=grasping, engine="native", split=HELD_OUT)
    pool = _bare(pool_of(base, HELD_OUT, count), plain.scene.digest)
    seeds = tuple(SEED + k for k in range(pool.size))
    poses = _repeated(_bare(spread_starts(base, HELD_OUT, pool.size), plain.scene.digest), pool.size)
    first = next(iter(envs.values()))
    other = widened(poses, bare_scene(base), first.scene) if "objects" in axes else poses
    draws = EpisodeDraws.drawn(envs, seeds, other)
    homes = {} if known.fit is None else _homes(base, pool.size)
    usual, held_out = wordings(known), wordings(known, held_out=True)
    header = {
        "kind": KIND,
        "format_version": FORMAT_VERSION,
        "task": known.name,
        "scene": plain.scene.name,
        "digest": plain.scene.digest,
        "grasping": plain.grasping,
        "objects": [{"name": o.name, "category": o.category, "model": o.model} for o in plain.scene.manifest.objects],
        "additions": entries_of(plain.scene.additions),
        "robots": {robot: _robot(env) for robot, env in envs.items()},
        "instructions": {"usual": list(usual), "held_out": list(held_out)},
        "models": [list(names) for names in draws.models],
        "homes": {home: pool.digest for home, pool in homes.items()},
        "axes": _axes(axes, first, bool(homes)),
    }
    made = Episodes(header, pool, seeds, draws, poses, homes)
    return dataclasses.replace(made, header={**header, "hash": digest_of(made)})


def _possible(task: str, grasping: str | None) -> dict[str, Any]:
    """Settings of the axes of `Randomize` that a task can vary, but for the poses of objects."""
    found = {}
    for axis, kind in AXES.items():
        if axis in ("objects", "robot_start"):
            try:
                env = make(task, grasping=grasping, engine="native", pool_size=1, randomize={axis: True})
                env.core.starts.no_draw(1)
            except EngineError:
                continue
        if axis != POSES:
            found[axis] = kind()
    return found


def _axes(axes: Mapping[str, Any], env: Environment, homes: bool) -> dict[str, dict[str, Any]]:
    """Settings of `Randomize` of each axis of a file, with the models that its episodes have by name."""
    if "objects" in axes:
        names = dict.fromkeys(name for every in model_names(env) for name in every)
        axes = {**axes, "objects": Objects(axes["objects"].count, tuple(names))}
    every = {**axes, POSES: AXES[POSES]()}
    found = {axis: _settings([axis], every) for axis in AXES if axis in every}
    return {NOMINAL: {}, **found, **({HOMES: {}} if homes else {}), ALL: _settings(every, every)}


def _settings(names: Sequence[str] | Mapping[str, Any], every: Mapping[str, Any]) -> dict[str, Any]:
    return Randomize(**{name: every[name] for name in AXES if name in names}).as_dict()


def _homes(task: Task, count: int) -> dict[str, Pool]:
    """Start states in the held-out homes that a task fits into, shared out evenly."""
    fitting = [home for home in HELD_OUT_HOMES if not reason_against(task, home)]
    found = {}
    for k, home in enumerate(fitting):
        moved = in_home(task, home)
        assert isinstance(moved, Task)
        rows = len(range(k, count, len(fitting)))
        if rows:
            found[home] = _bare(pool_of(moved, HELD_OUT, rows), bare_scene(moved).digest)
    return found


def _repeated(pool: Pool, count: int) -> Pool:
    """So many rows, beginning again after the last."""
    return pool.rows(np.arange(count) % pool.size)


def _bare(pool: Pool, digest: str) -> Pool:
    """A pool as files have it: on the host, of the scene without robots."""
    return dataclasses.replace(jax.tree.map(np.asarray, pool), digest=digest, starts=None)


def _robot(env: Environment) -> dict[str, Any]:
    """Where a robot starts (m, w-x-y-z, world frame), and its cameras."""
    state = env.start_from(np.zeros(1, np.int32))
    agent = state.batch.world.view.agent
    return {
        "base_pos": np.asarray(agent.base_pos)[0, 0].astype(float).round(6).tolist(),
        "base_quat": np.asarray(agent.base_quat)[0, 0].astype(float).round(6).tolist(),
        "cameras": list(dict.fromkeys(camera_names(env.scene))),
    }


def shipped_episodes() -> dict[str, pathlib.Path]:
    """Files of episodes that ship, by name of the task."""
    return {file.stem: file for folder in FOLDERS if folder.is_dir() for file in sorted(folder.glob("*.npz"))}


def find_episodes(name: str | os.PathLike) -> pathlib.Path:
    """A file, or that of a task that ships. Raises InputError, UnknownNameError."""
    file, known = pathlib.Path(name), shipped_episodes()
    if file.is_file():
        return file
    if str(name) in known:
        return known[str(name)]
    if file.suffix == ".npz":
        raise InputError(file, "there is no such file", fix=FIX)
    raise UnknownNameError("task with episodes that ship", str(name), known)
