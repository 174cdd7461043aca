"""`observe`: recordings replayed, run by run, with the observations of every frame: what exports are made of.

Axis: T steps of a run.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ig2mj.demos.reader import Run
from ig2mj.demos.replay import Replayed, Replayer
from ig2mj.envs.environment import EnvState
from ig2mj.errors import InputError

Write = Callable[[int, Run, dict[str, np.ndarray]], None]
"""Called with a run's number among those that are exported, the run, and its observations [T + 1, ...] by name."""


def exported_runs(replayer: Replayer) -> list[Run]:
    """Runs with at least one step."""
    return [run for run in replayer.recording.runs if run.frames > 1]


def observe(replayer: Replayer, write: Write, exact: bool = True) -> Replayed:
    """Replays all runs that have a step, and hands each one over when its last frame was seen.

    Runs of several worlds are replayed beside each other, so they do not come in their order.

    Args:
      exact: compare every byte. Without it, what comes out on another processor is taken as it comes.

    Raises:
      InputError: the recording is broken, does not come out the same by action, or cannot be replayed by state.
    """
    runs = exported_runs(replayer)
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
    if done.differences:
        fix = "export it by state (--by state)"
        raise InputError(replayer.recording.file, str(done.differences[0]), fix=fix)
    return done
