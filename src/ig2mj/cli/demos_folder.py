"""`ig2mj demos metrics`, and commands on all recordings of a folder in several processes."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import tyro

ENDINGS = (".h5", ".hdf5")


def metrics(
    path: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE|FOLDER")],
    jobs: int = 1,
    settle: int = 150,
    success_only: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    include_incomplete: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Compute iGibson's metrics of recordings: goal score, disarrangement, distance travelled, grasping, gaze.

    Episodes that were cut off, by the end of a rollout or Ctrl-C, are left out.

    Args:
      path: a recording, or a folder of them.
      jobs: number of processes; each takes one recording at a time.
      settle: control steps to wait before start and end are compared; 0: compare them as recorded.
      success_only: measure successful episodes only.
      include_incomplete: measure episodes that were cut off, too.
      json: print one JSON object per run.
    """
    import json as form
    import sys

    from ig2mj.demos.metrics import metrics_of
    from ig2mj.errors import Ig2mjError

    if jobs < 1 or settle < 0:
        raise Ig2mjError(f"--jobs {jobs}, --settle {settle}: at least one process, and no less than 0 steps")
    failed, chosen = 0, (success_only, include_incomplete)
    for file, found in of_files(metrics_of, files_of(path), jobs, settle, None, *chosen):
        if isinstance(found, Ig2mjError):
            print(f"error: {found}", file=sys.stderr)
            failed += 1
            continue
        if not found:
            print(f"{file}: holds no episodes to measure", file=sys.stderr)
        for run in found:
            print(form.dumps(run) if json else _line(file, run))
        if others := _others(file, *chosen):
            print(f"{file}: {others}", file=sys.stderr)
    return 2 if failed else 0


def _others(file: pathlib.Path, success_only: bool, incomplete: bool) -> str:
    """What was not measured, for people."""
    from ig2mj.demos.reader import Recording
    from ig2mj.demos.selection import advice, chosen_runs, left_out

    with Recording(file) as recording:
        runs = chosen_runs(recording, success_only, incomplete)
        others = left_out(recording, runs)
        hint = advice(recording, success_only, incomplete)
    if others and not runs:
        return f"nothing to measure but {others}" + (f"; {hint}" if hint else "")
    if others:
        return f"left out: {others}"
    return "" if runs else "has no run with a step"


def _line(file: pathlib.Path, run: dict[str, Any]) -> str:
    goal, paths = run["goal"], ", ".join(f"{name} {m:.2f}" for name, m in run["path_length"].items())
    held = ", ".join(f"{name} {share:.0%}" for name, share in run["grasping"].items())
    looked = next(iter(run["gaze"]["objects"]), "") or "nothing"
    return (
        f"{file} {run['run']}: goal {goal['start']:.2f} to {goal['end']:.2f}; "
        f"moved {run['kinematic_disarrangement']['total']:.2f} m, "
        f"{run['logical_disarrangement']['total']} predicates changed; "
        f"distance travelled (m): {paths}; holding: {held}; looked most at {looked}"
    )


def files_of(path: pathlib.Path) -> list[pathlib.Path]:
    """The recordings of a folder, the file itself, or that of demonstrations that ship. Raises InputError: a folder
    has none. UnknownNameError."""
    from ig2mj.demos.shipped import find_recording
    from ig2mj.errors import InputError

    if not path.is_dir():
        return [find_recording(path)]
    found = sorted(file for file in path.iterdir() if file.suffix in ENDINGS)
    if not found:
        raise InputError(path, f"has no recordings ({', '.join(ENDINGS)})", fix="name a folder that has")
    return found


def of_files(
    work: Callable[..., Any], files: list[pathlib.Path], jobs: int, *arguments: Any
) -> Iterator[tuple[pathlib.Path, Any]]:
    """What `work(file, *arguments)` returns for each file, or its `Ig2mjError`, in their order.

    With one job or one file it is done here; else in processes that begin afresh, since JAX must not be forked.
    """
    import concurrent.futures
    import multiprocessing

    if jobs == 1 or len(files) == 1:
        for file in files:
            yield file, _tried(work, file, arguments)
        return
    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(min(jobs, len(files)), context) as pool:
        waiting = [pool.submit(_tried, work, file, arguments) for file in files]
        for file, done in zip(files, waiting, strict=True):
            yield file, done.result()


def _tried(work: Callable[..., Any], file: pathlib.Path, arguments: tuple[Any, ...]) -> Any:
    from ig2mj.errors import Ig2mjError

    try:
        return work(file, *arguments)
    except Ig2mjError as e:
        return Ig2mjError(str(e))
