"""`observe`: replays recordings and collects the observations of every frame, run by run, for exports and learning.

Axis: T steps of a run.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ig2mj.demos.origin import OBSERVED, WHOLE_HASHES, differences, is_plain
from ig2mj.demos.reader import Run
from ig2mj.demos.replay import Replayed, Replayer
from ig2mj.demos.selection import some_runs
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.errors import Ig2mjError, InputError
from ig2mj.scene.scene import PLAIN
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.registry import sensor_named

Write = Callable[[int, Run, dict[str, np.ndarray]], None]
"""Called with the index of a run among the selected ones, the run, and its observations [T + 1, ...] by name."""


def observe(replayer: Replayer, write: Write, exact: bool = True, runs: Sequence[Run] | None = None) -> Replayed:
    """Replays runs and passes each one on after its last frame.

    Runs of several worlds are replayed side by side, so they do not arrive in their order.

    Args:
      exact: compare every byte, and refuse observations that the recorded environment would not have made; else
        differences are ignored.
      runs: which; None: all complete ones (`ig2mj.demos.selection`).

    Raises:
      InputError: the recording is broken, has no such run, differs when replayed by action, cannot be replayed by
        state, or its observations would differ on this machine.
    """
    runs = some_runs(replayer.recording) if runs is None else runs
    if exact:
        check_observations(replayer)
    for run in runs if replayer.by == "state" else ():
        if not run.kept(1, 2).all():
            raise run.broken("frames", "has actions, first and last frame only: replay it by action")
    numbers = {run.name: number for number, run in enumerate(runs)}
    seen: dict[str, dict[str, list[np.ndarray]]] = {}

    def watch(state: EnvState, now: dict[int, Run], frame: int) -> None:
        for world, run in now.items():
            of_run = seen.setdefault(run.name, {name: [] for name in state.obs})
            for name, array in state.obs.items():
                of_run[name].append(np.asarray(array)[world])
            if frame == run.frames - 1:
                rows = {name: np.stack(each) for name, each in seen.pop(run.name).items()}
                write(numbers[run.name], run, rows)

    done = replayer(check=exact, watch=watch, runs=runs)
    refuse_differences(replayer, done)
    return done


def refuse_differences(replayer: Replayer, done: Replayed) -> None:
    """Raises InputError for the first run that differs."""
    if not done.differences:
        return
    run = next(run for run in replayer.recording.runs if run.name == done.differences[0].run)
    thin = not run.kept(0, min(3, run.frames)).all()
    fix = (
        "record it on this machine: last digits depend on the processor" if thin else "export it by state (--by state)"
    )
    raise InputError(replayer.recording.file, str(done.differences[0]), fix=fix)


def check_observations(replayer: Replayer) -> None:
    """Checks that observations on this machine are those of the recorded environment.

    Of cameras and rays, the settings of recorded observations are compared; those of others are free.

    Raises:
      InputError: names what differs.
    """
    recording, env, here = replayer.recording, replayer.env, replayer.here
    names = [name for name in OBSERVED if name != "task_hash" or recording.version != WHOLE_HASHES]
    found = differences(recording.header, here, tuple(names))
    if "observations" in recording.header:
        recorded = recording.value("observations", list)
        seen = [name for name in env.observation_spaces if name in recorded and _looks(name)]
        if seen:
            found += _other_settings(replayer)
            if recording.header.get("appearance_hash") != here["appearance_hash"]:
                found.append(f"the home's appearance differs in {', '.join(seen)}")
    if found:
        fix = "`ig2mj demos replay --by state --sensors NAMES` makes observations of what is here now"
        raise InputError(recording.file, f"cannot be exported as it was recorded: {'; '.join(found)}", fix=fix)


def _looks(observation: str) -> bool:
    """It is of images or rays."""
    sensor = sensor_named(observation)
    return sensor is not None and sensor.looks


def _other_settings(replayer: Replayer) -> list[str]:
    recording = replayer.recording
    try:
        recorded = SensorOptions.of({"looks": PLAIN, **recording.value("sensors", dict)})
    except Ig2mjError as e:
        raise InputError(recording.file, str(e), element="attribute sensors") from e
    before, now = dataclasses.asdict(recorded), dataclasses.asdict(replayer.env.sensor_options)
    return differences(before, now, tuple(now))


def made_again(env: Environment) -> dict[str, Any]:
    """Arguments of `ig2mj.make`, for JSON, that make an environment with the same observations."""
    return {
        **{name: value for name, value in env.made_with.items() if is_plain(value)},
        "robot": env.robot,
        "grasping": env.grasping,
        "engine": env.core.engine.name,
        "period": env.period,
        "observations": list(env.observation_spaces),
        "sensors": dataclasses.asdict(env.sensor_options),
    }
