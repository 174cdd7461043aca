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
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, Literal

import jax.numpy as jnp
import msgspec
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.engine.view import Array
from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError, InputError
from ig2mj.files.content import decode_json
from ig2mj.files.hdf5 import Hdf5File
from ig2mj.files.npz import refuse_nonfinite
from ig2mj.learn.checkpoints import refuse_difference
from ig2mj.learn.collect import FINAL, TrainingEnv
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.policies import world_of
from ig2mj.process import entry_point

FORMAT, FORMAT_VERSION = "ig2mj demonstrations", 1

LONGEST = 100_000
"""Steps of a run that is believed: more than any horizon, and little enough to read."""

STEPS = ("action", "label", "reward", "terminated", "truncated")
"""Arrays of a run, next to its observations."""

HOPELESS = 50
"""Failures after which too few successes end a collection."""

_FIX = "`ig2mj demos collect` writes such files"

_Type = Literal["bool", "uint8", "uint16", "uint32", "int8", "int16", "int32", "int64", "float16", "float32", "float64"]
_Shape = tuple[tuple[Annotated[int, msgspec.Meta(ge=0, le=2**20)], ...], _Type]
"""Of an observation: shape of one world, and type."""


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


@entry_point
def collect_demos(
    env: TrainingEnv,
    expert: Callable[[Any], Array],
    writer: DemoWriter,
    episodes: int,
    *,
    seed: int = 0,
    noise: float = 0.0,
    disturbed: float = 0.0,
    progress: ProgressCallback = no_progress,
) -> dict[str, int]:
    """Plays the expert until so many of its episodes have succeeded, and writes those.

    Args:
      noise: deviation of what is added to its actions. disturbed: share of the steps that begin a disturbance: five
        steps of one random action, from which the expert finds its way back.
      progress: called after every step with successful and all episodes.

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
            failed += not success[w]
            if failed >= HOPELESS and writer.runs * 10 < failed:
                raise Ig2mjError(f"the expert failed in {failed} of {failed + writer.runs} episodes")
            open_runs[w] = _Run()
            left[w] = 0
        step = max(len(run) for run in open_runs)
        words = f"{writer.runs} of {episodes} successful episodes, {failed} failed, step {step} of the present ones"
        progress(writer.runs, episodes, words)
    return {"kept": writer.runs, "failed": failed}


class _Run:
    """Steps of a running episode."""

    def __init__(self) -> None:
        self._steps: list[dict[str, np.ndarray]] = []
        self._obs: list[dict[str, np.ndarray]] = []

    def __len__(self) -> int:
        return len(self._steps)

    def add(self, step: dict[str, np.ndarray], obs: dict[str, np.ndarray]) -> None:
        self._steps.append(step)
        self._obs.append(obs)

    def closed(self, last: dict[str, np.ndarray]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        return _stacked(self._steps), _stacked([*self._obs, last])


def _stacked(rows: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]}


def about(file: str | os.PathLike) -> tuple[dict[str, Any], dict[str, Space]]:
    """What a file is of: the environment (`policies.world_of`), and its observations. Raises InputError."""
    with _opened(file) as found:
        return _about(found)


def _about(found: Hdf5File) -> tuple[dict[str, Any], dict[str, Space]]:
    header = found.attributes()
    element = "attributes world and spaces"
    if not all(isinstance(header.get(name), str) for name in ("world", "spaces")):
        raise found.broken(element, "are missing: it does not say what it is of")
    world, spaces = (decode_json(header[name], found.file, kind=dict, fix=_FIX) for name in ("world", "spaces"))
    try:
        known = msgspec.convert(spaces, dict[str, _Shape])
        return world, {n: Space(shape, np.dtype(kind).type, -np.inf, np.inf) for n, (shape, kind) in known.items()}
    except (msgspec.ValidationError, RecursionError, TypeError, ValueError) as e:
        raise found.broken(element, e) from e


@entry_point
def load_demos(file: str | os.PathLike, perception: Perception, world: Mapping[str, Any] | None = None) -> Demos:
    """All runs of a file as networks see them.

    Args:
      world: the environment that they are for (`policies.world_of`); None: any.

    Raises:
      InputError: no such file, one of another kind or environment, or a broken one; names the run and the field.
    """
    with _opened(file) as found:
        own, spaces = _about(found)
        if world is not None:
            refuse_difference(found.file, own, world)
        missing = [name for name in perception.names if name not in spaces]
        if missing:
            fix = "`ig2mj demos collect --obs rgbd` records pictures; `ig2mj train --algo sac --expert` needs no file"
            raise InputError(found.file, f"holds no {' and no '.join(missing)}", fix=fix)
        actions = len(own["actions"]) if isinstance(own.get("actions"), list) else None
        fields = (*STEPS, *(f"obs/{name}" for name in perception.names))
        found.claim(f"{run}/{name}" for run in found.names() for name in fields)
        parts = [_read(found, name, perception, spaces, actions) for name in found.names()]
        if not parts:
            raise InputError(found.file, "holds no run", fix=_FIX)
        if len({part["action"].shape[1] for part in parts}) > 1:
            raise found.broken("action", "has another width in another run")
    fields = {name: jnp.asarray(np.concatenate([p[name] for p in parts])) for name in parts[0]}
    seen, after = (Seen(fields.pop(f"{k}_vector"), fields.pop(f"{k}_picture")) for k in ("seen", "after"))
    return Demos(seen=seen, after=after, **fields)


@contextlib.contextmanager
def _opened(file: str | os.PathLike) -> Iterator[Hdf5File]:
    """An open file of demonstrations. Raises InputError."""
    with Hdf5File(file, fix=_FIX) as found:
        if not found.is_of(FORMAT, FORMAT_VERSION):
            raise InputError(found.file, f"is not a file of {FORMAT}, version {FORMAT_VERSION}", fix=_FIX)
        yield found


def _read(
    found: Hdf5File, run: str, perception: Perception, spaces: Mapping[str, Space], actions: int | None
) -> dict[str, np.ndarray]:
    """One run. Raises InputError where it is not what it should be."""

    def read(name: str, kinds: str, inner: tuple[int, ...], rows: int | None) -> np.ndarray:
        element = f"{run}/{name}"
        array = found.array(element, kinds=kinds)
        if array.shape[1:] != inner or (rows is not None and array.shape[0] != rows):
            wanted = ", ".join(map(str, ("any" if rows is None else rows, *inner)))
            raise found.broken(element, f"has shape {array.shape}, and must have ({wanted})")
        values = found.read(element, kinds=kinds)
        refuse_nonfinite(values, found.file, element, _FIX)
        return values

    width = found.array(f"{run}/action", kinds="f", ndim=2).shape[1] if actions is None else actions
    action = read("action", "f", (width,), None)
    count = len(action)
    if not 0 < count <= LONGEST:
        raise found.broken(f"{run}/action", f"has {count} steps, and at most {LONGEST} are read")
    done = {name: read(name, "b", (), count) for name in ("terminated", "truncated")}
    steps = {"action": action, "label": read("label", "f", (width,), count), "reward": read("reward", "f", (), count)}
    of = {n: read(f"obs/{n}", np.dtype(spaces[n].dtype).kind, spaces[n].shape, count + 1) for n in perception.names}
    wanted = blank(perception, 1)
    try:
        seen = perception(of)
    except (ValueError, TypeError) as e:  # shapes that the file itself states, and that no picture has
        raise found.broken(f"{run}/obs", e) from e
    vector, picture = np.asarray(seen.vector), np.asarray(seen.image)
    if vector.shape[1] != wanted.vector.shape[1] or picture.shape[1] != wanted.image.shape[1]:
        raise found.broken(f"{run}/obs", f"has {vector.shape[1]} numbers, and {wanted.vector.shape[1]} are expected")
    seen_after = {"seen_vector": vector[:-1], "seen_picture": picture[:-1]}
    return {**steps, **done, **seen_after, "after_vector": vector[1:], "after_picture": picture[1:]}
