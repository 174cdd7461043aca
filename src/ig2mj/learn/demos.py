"""Demonstrations for learning, as HDF5: episodes with observations, actions, and what the expert would have done.

One group a run, in the order in which they ended: `action` and `label` [T, n] (what was done, and what the expert would
have done without disturbance), `reward`, `terminated`, `truncated` [T], `obs/<name>` [T + 1, ...]. Attributes of the
file say what the environment was; those of a run its success and its number. A run is written and flushed when its
episode ends: a process that is killed loses the episodes that were running.

Nothing of the engine's state is in it: these files are to learn from, not to be replayed.

Axes: T steps of a run, N steps of all runs, n numbers of an action, W worlds.
"""

from __future__ import annotations

import contextlib
import json
import os
import pathlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError, InputError
from ig2mj.learn.checkpoints import refuse_difference
from ig2mj.learn.collect import FINAL, TrainingEnv
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.policies import world_of

FORMAT, FORMAT_VERSION = "ig2mj demonstrations", 1

LONGEST = 100_000
"""Steps of a run that is believed: more than any horizon, and little enough to read."""

HOPELESS = 50
"""Failures after which too few successes end a collection."""

_FIX = "`ig2mj demos collect` writes such files"


@struct.dataclass
class Demos:
    """All runs of a file, one after the other, as networks see them. `label`: what the expert would have done."""

    seen: Seen
    action: Float[Array, "N n"]
    label: Float[Array, "N n"]
    reward: Float[Array, "N"]
    terminated: Bool[Array, "N"]
    truncated: Bool[Array, "N"]
    after: Seen


class DemoWriter:
    """Writes runs to a file; a context manager."""

    def __init__(self, file: str | os.PathLike, env: TrainingEnv):
        """`env`: what is recorded. Raises OSError."""
        import h5py

        spaces = {name: [list(s.shape), np.dtype(s.dtype).name] for name, s in env.observation_spaces.items()}
        self._file = h5py.File(file, "w")
        self._file.attrs["format"], self._file.attrs["version"] = FORMAT, FORMAT_VERSION
        self._file.attrs["world"], self._file.attrs["spaces"] = json.dumps(world_of(env)), json.dumps(spaces)
        self.runs = 0

    def add(self, run: Mapping[str, np.ndarray], obs: Mapping[str, np.ndarray], success: bool) -> None:
        """Writes one run, and flushes."""
        group = self._file.create_group(f"run_{self.runs:06d}")
        for name, values in run.items():
            group[name] = values
        for name, values in obs.items():
            packed = {"compression": "gzip", "compression_opts": 1} if values.ndim > 2 else {}
            group.create_dataset(f"obs/{name}", data=values, **packed)
        group.attrs["success"] = success
        self.runs += 1
        self._file.flush()

    def note(self, name: str, value: int) -> None:
        """An attribute of the file, for people."""
        self._file.attrs[name] = value

    def __enter__(self) -> DemoWriter:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()


def collect_demos(
    env: TrainingEnv,
    expert: Callable[[Any], Array],
    writer: DemoWriter,
    episodes: int,
    *,
    seed: int = 0,
    noise: float = 0.0,
    disturbed: float = 0.0,
    progress: Callable[[int, int], None] = lambda kept, of: None,
) -> dict[str, int]:
    """Plays the expert until so many of its episodes have succeeded, and writes those.

    Args:
      noise: deviation of what is added to its actions. disturbed: share of the steps that begin a disturbance: five
        steps of one random action, from which the expert finds its way back. progress: called after each success.

    Returns:
      Numbers of episodes: "kept", and "failed", which are left out.

    Raises:
      Ig2mjError: nearly all episodes fail.
    """
    rng, worlds, size = np.random.default_rng(seed), env.num_worlds, env.action_space.shape[0]
    state, open_runs = env.reset(seed), [_Run() for _ in range(env.num_worlds)]
    wild, left, failed = np.zeros((worlds, size)), np.zeros(worlds, int), 0
    while writer.runs < episodes:
        label = np.clip(np.asarray(expert(state)), -1, 1)
        begins = (left <= 0) & (rng.random(worlds) < disturbed)
        wild[begins], left[begins] = rng.uniform(-1, 1, (int(begins.sum()), size)), 5
        action = np.where((left > 0)[:, None], wild, label + noise * rng.standard_normal(label.shape))
        action, left = np.clip(action, -1, 1).astype(np.float32), left - 1
        before = {name: np.asarray(a) for name, a in state.obs.items()}
        state = env.step_autoreset(state, action)
        steps = {"action": action, "label": label.astype(np.float32), "reward": np.asarray(state.reward, np.float32)}
        ends = {"terminated": np.asarray(state.terminated), "truncated": np.asarray(state.truncated)}
        success, done = np.asarray(state.info["success"]), ends["terminated"] | ends["truncated"]
        for w, run in enumerate(open_runs):
            run.add({name: a[w] for name, a in (steps | ends).items()}, {name: a[w] for name, a in before.items()})
            if not done[w]:
                continue
            if success[w] and writer.runs < episodes:
                last = {name: np.asarray(a)[w] for name, a in state.info[FINAL].items()}
                writer.add(*run.closed(last), success=True)
                progress(writer.runs, episodes)
            failed += not success[w]
            if failed >= HOPELESS and writer.runs * 10 < failed:
                raise Ig2mjError(f"the expert failed in {failed} of {failed + writer.runs} episodes")
            open_runs[w] = _Run()
            left[w] = 0
    return {"kept": writer.runs, "failed": failed}


class _Run:
    """Steps of a running episode."""

    def __init__(self) -> None:
        self._steps: list[dict[str, np.ndarray]] = []
        self._obs: list[dict[str, np.ndarray]] = []

    def add(self, step: dict[str, np.ndarray], obs: dict[str, np.ndarray]) -> None:
        self._steps.append(step)
        self._obs.append(obs)

    def closed(self, last: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        return _stacked(self._steps), _stacked([*self._obs, last])


def _stacked(rows: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def about(file: str | os.PathLike) -> tuple[dict[str, Any], dict[str, Space]]:
    """What a file is of: the environment (`policies.world_of`), and its observations. Raises InputError."""
    with _opened(pathlib.Path(file)) as found:
        spaces = json.loads(str(found.attrs["spaces"]))
        world = json.loads(str(found.attrs["world"]))
    made = {n: Space(tuple(shape), np.dtype(kind).type, -np.inf, np.inf) for n, (shape, kind) in spaces.items()}
    return world, made


def load_demos(file: str | os.PathLike, perception: Perception, world: Mapping[str, Any] | None = None) -> Demos:
    """All runs of a file as networks see them.

    Args:
      world: the environment that they are for (`policies.world_of`); None: any.

    Raises:
      InputError: no such file, one of another kind or environment, or a broken one; names the run and the field.
    """
    path = pathlib.Path(file)
    _, spaces = about(path)
    missing = [name for name in perception.names if name not in spaces]
    if missing:
        fix = "`ig2mj demos collect --obs rgbd` records pictures; `ig2mj train --algo sac --expert` needs no file"
        raise InputError(path, f"holds no {' and no '.join(missing)}", fix=fix)
    parts = list(_runs(path, perception, world))
    if not parts:
        raise InputError(path, "holds no run", fix=_FIX)
    fields = {name: jnp.asarray(np.concatenate([p[name] for p in parts])) for name in parts[0]}
    seen, after = (Seen(fields.pop(f"{k}_vector"), fields.pop(f"{k}_picture")) for k in ("seen", "after"))
    return Demos(seen=seen, after=after, **fields)


def _runs(
    path: pathlib.Path, perception: Perception, world: Mapping[str, Any] | None
) -> Iterator[dict[str, np.ndarray]]:
    with _opened(path) as found:
        if world is not None:
            refuse_difference(path, json.loads(str(found.attrs["world"])), world)
        for name in sorted(found):
            try:
                yield _read(found[name], perception)
            except (KeyError, OSError, ValueError, TypeError) as e:
                raise InputError(path, f"cannot be read: {' '.join(str(e).split())}", element=name) from e


@contextlib.contextmanager
def _opened(path: pathlib.Path) -> Iterator[Any]:
    """An open file of demonstrations. Raises InputError."""
    import h5py

    if not path.is_file():
        raise InputError(path, "there is no such file", fix=_FIX)
    try:
        opened = h5py.File(path, "r")
    except OSError as e:
        raise InputError(path, "is not an HDF5 file, or a broken one", fix=_FIX) from e
    with opened as found:
        if found.attrs.get("format") != FORMAT or found.attrs.get("version") != FORMAT_VERSION:
            raise InputError(path, f"is not a file of {FORMAT}, version {FORMAT_VERSION}", fix=_FIX)
        if not {"world", "spaces"} <= set(found.attrs):
            raise InputError(path, "does not say what it is of", element="attributes world and spaces", fix=_FIX)
        yield found


def _read(group: Any, perception: Perception) -> dict[str, np.ndarray]:
    """One run; ValueError, KeyError where it is not what it should be."""
    names = ("action", "label", "reward", "terminated", "truncated")
    count = group["action"].shape[0]
    if not 0 < count <= LONGEST:
        raise ValueError(f"action has {count} steps, at most {LONGEST} are read")
    wanted = blank(perception, 1)
    for name in names:
        if group[name].shape[0] != count:
            raise ValueError(f"{name} has {group[name].shape[0]} steps, and action {count}")
    for name in perception.names:
        if group[f"obs/{name}"].shape[0] != count + 1:
            raise ValueError(f"obs/{name} has {group[f'obs/{name}'].shape[0]} rows, {count + 1} are expected")
    run = {name: np.asarray(group[name]) for name in names}
    seen = perception({name: np.asarray(group[f"obs/{name}"]) for name in perception.names})
    vector, picture = np.asarray(seen.vector), np.asarray(seen.picture)
    if vector.shape[1] != wanted.vector.shape[1] or picture.shape[1] != wanted.picture.shape[1]:
        raise ValueError(f"{vector.shape[1]} numbers are observed, {wanted.vector.shape[1]} are expected")
    seen_after = {"seen_vector": vector[:-1], "seen_picture": picture[:-1]}
    return {**run, **seen_after, "after_vector": vector[1:], "after_picture": picture[1:]}
