"""Episode files: fixed episodes of a task on which policies are compared, the same on every machine.

    episodes = Episodes.load(find_episodes("CookingMeat"))
    env = ig2mj.make("CookingMeat", pool=episodes.pool, **episodes.options("lights"))
    state = env.start_from([0], [episodes.seeds[0]])

A file has of each episode the poses and states of all objects of the home (a row of a pool), the seed from which all
that is drawn for it follows, and its instruction, usual and held out; and of all of them the home with its objects, the
robots with their cameras, and for each axis the settings of `ig2mj.Randomize`. Its hash is part of its header.

The axis `nominal` varies nothing; others are those of `Randomize`, one at a time; `all` is all of them together.
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

from ig2mj.envs.environment import Environment
from ig2mj.envs.registry import find_task, make
from ig2mj.errors import EngineError, InputError, UnknownNameError
from ig2mj.scene.found_again import entries_of
from ig2mj.sensors.cameras import camera_names
from ig2mj.tasks.instructions import wordings
from ig2mj.tasks.task import Task
from ig2mj.worlds.archive import pack, read_header, save_tree, unpack
from ig2mj.worlds.pool import Pool, pool_of_arrays
from ig2mj.worlds.randomize import AXES, UNFINISHED, Randomize

KIND, FORMAT_VERSION = "episodes", 1

NOMINAL, ALL, HOMES = "nominal", "all", "homes"

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


def possible_axes() -> tuple[str, ...]:
    """The axes that can be played; `all` is those of `Randomize` among them together."""
    return (NOMINAL, *(name for name in AXES if name not in UNFINISHED), ALL)


def parse_axes(text: str) -> tuple[str, ...]:
    """Axes of a list such as "nominal,lights"; "all" alone is every axis that can be played, and their combination.

    Raises:
      UnknownNameError: no such axis, with near matches. EngineError: one cannot be played yet.
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise EngineError(f"no axis is named (there is {', '.join(EVERY)})")
    for name in names:
        if name not in EVERY:
            raise UnknownNameError("axis", name, EVERY)
    if names == [ALL]:
        return possible_axes()
    for name in names:
        if name not in possible_axes():
            raise EngineError(f"the axis '{name}' cannot be played yet ({', '.join(possible_axes())} can)")
    if not names:
        raise EngineError(f"no axis is named (take some of {', '.join(possible_axes())}, or all)")
    return tuple(dict.fromkeys((NOMINAL, *names)))


def randomize_of(axis: str) -> Randomize | None:
    """What varies in the episodes of an axis."""
    names = [n for n in AXES if n not in UNFINISHED] if axis == ALL else [axis] if axis in AXES else []
    return Randomize.of(names) if names else None


@dataclasses.dataclass(frozen=True)
class Episodes:
    """See the module's text.

    Attributes:
      header: all that is no array, with "hash". pool: start states, a row for each episode. seeds: of each episode.
    """

    header: dict[str, Any]
    pool: Pool
    seeds: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of episodes."""
        return len(self.seeds)

    @property
    def axes(self) -> dict[str, dict[str, Any]]:
        """Settings of `Randomize` of each axis."""
        return self.header["axes"]

    def options(self, axis: str) -> dict[str, Any]:
        """Of `ig2mj.make`: what varies in an axis, and how it is worded. Raises EngineError: the file lacks it."""
        if axis not in self.axes:
            raise EngineError(f"the episodes of {self.header['task']} have no axis '{axis}' ({', '.join(self.axes)})")
        settings = self.axes[axis]
        return {"randomize": settings} if settings else {}

    def save(self, file: str | os.PathLike) -> None:
        """Writes it. Raises InputError."""
        save_tree(file, {"pool": self.pool, "seeds": np.array(self.seeds, np.int32)}, self.header)

    @classmethod
    def load(cls, file: str | os.PathLike) -> Episodes:
        """Reads it.

        Raises:
          InputError: it is missing, damaged, no such file, or changed since it was made.
        """
        header = read_header(file)
        if header.get("kind") != KIND or header.get("format_version") != FORMAT_VERSION:
            raise InputError(file, f"holds no episodes of format {FORMAT_VERSION}", fix=FIX)
        try:
            known = msgspec.convert(header, _Header)
        except (msgspec.ValidationError, RecursionError) as e:
            raise InputError(file, str(e), element="header", fix=FIX) from e
        arrays, _ = unpack(pathlib.Path(file).read_bytes())
        seeds = arrays.pop("seeds", np.zeros(0, np.int32))
        if seeds.ndim != 1 or seeds.dtype.kind != "i" or not len(seeds):
            raise InputError(file, "is no list of whole numbers", element="seeds", fix=FIX)
        rows = {name.removeprefix("pool."): a for name, a in arrays.items() if name.startswith("pool.")}
        pool = dataclasses.replace(pool_of_arrays(rows, None, str(file)), digest=known.digest)
        found = cls(header, pool, tuple(map(int, seeds)))
        if any(len(a) != found.count for a in rows.values()):
            raise InputError(file, f"has not {found.count} rows in every array", fix=FIX)
        if known.hash != digest_of(header, pool, found.seeds):
            raise InputError(file, "has changed since it was made: its hash does not fit", element="hash", fix=FIX)
        return found


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


def digest_of(header: Mapping[str, Any], pool: Pool, seeds: Sequence[int]) -> str:
    """Hash of everything in a file."""
    hashed = hashlib.blake2b(digest_size=16)
    plain = {name: value for name, value in header.items() if name != "hash"}
    hashed.update(msgspec.json.encode(plain, order="deterministic"))
    arrays, _ = unpack(pack({"pool": pool, "seeds": np.array(seeds, np.int32)}, {}))
    for name in sorted(arrays):
        hashed.update(f"{name} {arrays[name].dtype} {arrays[name].shape}".encode())
        hashed.update(np.ascontiguousarray(arrays[name]).data)
    return hashed.hexdigest()


def make_episodes(task: str, count: int = COUNT, grasping: str | None = None) -> Episodes:
    """Episodes of a task on its first held-out start states.

    Raises:
      EngineError: not one of the paper's activities. UnknownNameError: no such task.
    """
    known = find_task(task)
    if not isinstance(known, Task):
        raise EngineError(f"episodes of {task}: start states of the paper's activities and of tasks like them are kept")
    robots, env = {}, None
    for robot in known.robots:
        env = make(task, robot=robot, engine="native", grasping=grasping, split=HELD_OUT, pool_size=count)
        robots[robot] = _robot(env)
    assert env is not None
    pool = _bare(env.core.starts.pool, env.scene.digest)
    seeds = tuple(SEED + k for k in range(pool.size))
    usual, held_out = wordings(known), wordings(known, held_out=True)
    header = {
        "kind": KIND,
        "format_version": FORMAT_VERSION,
        "task": known.name,
        "scene": env.scene.name,
        "digest": env.scene.digest,
        "grasping": env.grasping,
        "objects": [{"name": o.name, "category": o.category, "model": o.model} for o in env.scene.manifest.objects],
        "additions": entries_of(env.scene.additions),
        "robots": robots,
        "instructions": {"usual": list(usual), "held_out": list(held_out)},
        "axes": {axis: _settings(axis) for axis in possible_axes()},
    }
    return Episodes({**header, "hash": digest_of(header, pool, seeds)}, pool, seeds)


def _settings(axis: str) -> dict[str, Any]:
    found = randomize_of(axis)
    return {} if found is None else found.as_dict()


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
