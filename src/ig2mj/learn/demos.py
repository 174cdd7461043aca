"""Demonstrations for learning: the runs of a recording as networks see them.

The observations of a recording that has them (`ig2mj demos collect`) are read. Those of any other, e.g. one of `ig2mj
rollout --record` or of a person, are computed by a replay. Labels are the recorded ones, or the actions where there are
none.

Axes: T steps of a run, N steps of all runs, n components of an action.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal

import jax.numpy as jnp
import msgspec
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.demos.observing import observe
from ig2mj.demos.reader import Recording, Run
from ig2mj.demos.replay import Replayer
from ig2mj.demos.shipped import find_recording
from ig2mj.engine.view import Array
from ig2mj.envs.observations import Space
from ig2mj.errors import InputError
from ig2mj.files.limits import refuse_bomb
from ig2mj.files.npz import refuse_nonfinite
from ig2mj.learn.checkpoints import refuse_difference
from ig2mj.learn.perception import Perception, Seen, blank
from ig2mj.learn.policies import doors_in, horizon_on_card, looks_in
from ig2mj.process import entry_point
from ig2mj.scene.scene import PLAIN
from ig2mj.tasks.custom.code import IN_FILES

LONGEST = 100_000
"""Largest number of steps of a run that is read; more than any horizon."""

_FIX = "`ig2mj demos collect` writes such files"

LABELS = ("label", "devices/expert")
"""Columns of labels, in files of this version and in those of 0.1.0."""

_Type = Literal["bool", "uint8", "uint16", "uint32", "int8", "int16", "int32", "int64", "float16", "float32", "float64"]
_Shape = tuple[tuple[Annotated[int, msgspec.Meta(ge=0, le=2**20)], ...], _Type]
"""Of an observation: shape in one world, and type."""


@struct.dataclass
class Demos:
    """All runs of a recording, one after the other, as networks see them. `label`: the expert's action."""

    seen: Seen
    action: Float[Array, "N n"]
    label: Float[Array, "N n"]
    reward: Float[Array, "N"]
    terminated: Bool[Array, "N"]
    truncated: Bool[Array, "N"]
    after: Seen


def about(file: str | os.PathLike) -> tuple[dict[str, Any], dict[str, Space]]:
    """The environment of a recording (`policies.world_of`), and its observations. Raises InputError."""
    with Recording(find_recording(file)) as recording:
        return _about(recording)


def horizon_of_demos(file: str | os.PathLike) -> int | None:
    """Agent steps of the episodes of a recording, at most; None: it does not say so. Raises InputError."""
    with Recording(find_recording(file)) as recording:
        return horizon_on_card(recording.header).get("horizon")


def _about(recording: Recording) -> tuple[dict[str, Any], dict[str, Space]]:
    if "spaces" not in recording.header:  # of 0.1.0
        env = Replayer(recording, "state").env
        privileged, spaces = list(env.privileged_names), dict(env.observation_spaces)
    else:
        privileged = recording.value("privileged_names", list)
        try:
            known = msgspec.convert(recording.value("spaces", dict), dict[str, _Shape])
            spaces = {n: Space(shape, np.dtype(kind).type, -np.inf, np.inf) for n, (shape, kind) in known.items()}
        except (msgspec.ValidationError, RecursionError, TypeError, ValueError) as e:
            problem = " ".join(str(e).split())
            raise InputError(recording.file, problem, element="attribute spaces", fix=_FIX) from e
    world = {name: recording.value(name, str) for name in ("task", "robot", "grasping")}
    world |= {name: recording.value(name, str) for name in IN_FILES if name in recording.header}
    sensors = recording.value("sensors", dict) if "sensors" in recording.header else {}
    world |= looks_in(spaces, str(sensors.get("looks", PLAIN)))
    world |= doors_in(recording.value("made_with", dict) if "made_with" in recording.header else {})
    return {**world, "actions": recording.value("action_names", list), "privileged": privileged}, spaces


@entry_point
def load_demos(file: str | os.PathLike, perception: Perception, world: Mapping[str, Any] | None = None) -> Demos:
    """All complete runs of a recording as networks see them.

    Args:
      file: a recording, or the name of one that ships.
      world: the environment to learn in (`policies.world_of`); None: any.

    Raises:
      InputError: no such file, a file of another kind or environment, or a broken one; names the run and the array.
    """
    with Recording(find_recording(file)) as recording:
        own, spaces = _about(recording)
        if perception.image_shape is None:
            own.pop("looks", None)
        if world is not None:
            refuse_difference(recording.file, own, world)
        runs = [run for run in recording.runs if run.frames > 1 and run.complete]
        if not runs:
            raise InputError(recording.file, "holds no complete run", fix=_FIX)
        for run in runs:
            if run.frames - 1 > LONGEST:
                raise run.broken("steps/action", f"has {run.frames - 1} steps, and at most {LONGEST} are read")
        recorded = all(name in runs[0].obs_names for name in perception.names)
        if recorded:
            _refuse_bomb(recording, runs, perception.names)
        observed = _recorded(runs, perception, spaces) if recorded else _replayed(recording, runs, perception)
        parts = [_steps(run, len(own["actions"])) | _as_seen(run, obs, perception) for run, obs in observed]
    fields = {name: jnp.asarray(np.concatenate([p[name] for p in parts])) for name in parts[0]}
    seen, after = (Seen(fields.pop(f"{k}_vector"), fields.pop(f"{k}_image")) for k in ("seen", "after"))
    return Demos(seen=seen, after=after, **fields)


def _refuse_bomb(recording: Recording, runs: Sequence[Run], names: Sequence[str]) -> None:
    """Refuses a file whose index names its rows so often that all runs together claim too many bytes."""
    columns = [f"obs/{name}" for name in names]
    row = sum(a.dtype.itemsize * int(np.prod(a.shape[1:])) for n, a in recording.arrays.items() if n in columns)
    refuse_bomb(row * sum(run.frames for run in runs), recording.file.stat().st_size, recording.file)


def _recorded(
    runs: Sequence[Run], perception: Perception, spaces: Mapping[str, Space]
) -> Iterator[tuple[Run, dict[str, np.ndarray]]]:
    """Each run with its recorded observations [T + 1, ...]."""
    for run in runs:
        like = {name: np.zeros(spaces[name].shape, spaces[name].dtype) for name in perception.names if name in spaces}
        yield run, {name: run.all_rows(f"obs/{name}", like.get(name)) for name in perception.names}


def _replayed(
    recording: Recording, runs: Sequence[Run], perception: Perception
) -> Iterator[tuple[Run, dict[str, np.ndarray]]]:
    """Each run with the observations [T + 1, ...] of a replay, by state where all frames are there."""
    whole = all(run.kept(k, min(k + 200, run.frames)).all() for run in runs for k in range(0, run.frames, 200))
    replayer, found = Replayer(recording, "state" if whole else "action", observations=perception.names), {}

    def take(number: int, run: Run, obs: dict[str, np.ndarray]) -> None:
        found[number] = obs

    observe(replayer, take, runs=runs)
    return ((run, found[number]) for number, run in enumerate(runs))


def _steps(run: Run, width: int) -> dict[str, np.ndarray]:
    """Arrays [T, ...] of the steps of a run. Raises InputError."""
    action, number, flag = np.zeros(width, np.float32), np.float32(0), np.bool_(False)
    label = next((name for name in LABELS if name in run.step_names), "action")
    columns = {"action": ("action", action), "label": (label, action), "reward": ("reward/total", number)}
    columns |= {name: (name, flag) for name in ("terminated", "truncated")}
    found = {}
    for name, (column, like) in columns.items():
        found[name] = run.all_rows(f"steps/{column}", like)
        refuse_nonfinite(found[name], run.file, f"{run.name}/steps/{column}", _FIX)
    return found


def _as_seen(run: Run, obs: Mapping[str, np.ndarray], perception: Perception) -> dict[str, np.ndarray]:
    """Observations before and after each step as networks see them. Raises InputError."""
    for name, values in obs.items():
        refuse_nonfinite(values, run.file, f"{run.name}/obs/{name}", _FIX)
    try:
        seen = perception(obs)
    except (ValueError, TypeError) as e:  # shapes that the file itself states, and that no image has
        raise run.broken("obs", str(e)) from e
    expected = blank(perception, 1)
    vector, image = np.asarray(seen.vector), np.asarray(seen.image)
    if vector.shape[1] != expected.vector.shape[1] or image.shape[1] != expected.image.shape[1]:
        raise run.broken("obs", f"has {vector.shape[1]} numbers, and {expected.vector.shape[1]} are expected")
    before = {"seen_vector": vector[:-1], "seen_image": image[:-1]}
    return {**before, "after_vector": vector[1:], "after_image": image[1:]}
