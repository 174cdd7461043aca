"""`ig2mj demos metrics`, and commands on all recordings of a folder in several processes."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator
from typing import Annotated, Any

import tyro

from ig2mj.cli.common.tasks import TaskOption, use_task

ENDINGS = (".h5", ".hdf5")


def metrics(
    path: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE|FOLDER")],
    jobs: int = 1,
    settle: int = 150,
    success_only: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    include_incomplete: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    task: TaskOption = None,
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
      task: the recordings' task, if it is defined in a file of yours; this imports the file.
      json: print one JSON object per run.
    """
    import json as form
    import sys

    from ig2mj.errors import Ig2mjError

    if jobs < 1 or settle < 0:
        raise Ig2mjError(f"--jobs {jobs}, --settle {settle}: at least one process, and no less than 0 steps")
    use_task(task)
    failed, chosen = 0, (success_only, include_incomplete)
    options = {"settle": settle, "success_only": success_only, "incomplete": include_incomplete}
    for file, found in of_files("ig2mj.demos.metrics:metrics_job", files_of(path), jobs, **options):
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
    """The episodes that were not measured, as text."""
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
    """The recordings of a folder, the file itself, or that of demonstrations that ship.

    Raises:
      InputError: a folder has none. UnknownNameError: nothing has this name.
    """
    from ig2mj.demos.shipped import find_recording
    from ig2mj.errors import InputError

    if not path.is_dir():
        return [find_recording(path)]
    found = sorted(file for file in path.iterdir() if file.suffix in ENDINGS)
    if not found:
        raise InputError(path, f"has no recordings ({', '.join(ENDINGS)})", fix="name a folder that has")
    return found


def of_files(
    function: str, files: list[pathlib.Path], jobs: int, **arguments: Any
) -> Iterator[tuple[pathlib.Path, Any]]:
    """The JSON result of the job `function(file=..., **arguments)` for each file in their order, or its `Ig2mjError`.

    With one file, or one process, the jobs run in this process.
    """
    import json

    from ig2mj.cli.common.jobs import follow
    from ig2mj.cluster.job_runner import Where, map_jobs
    from ig2mj.cluster.jobs import Job, JobSet, import_function
    from ig2mj.errors import Ig2mjError

    if jobs == 1 or len(files) == 1:
        run = import_function(function)
        for file in files:
            try:
                found = json.loads(run(file=str(file), **arguments))
            except Ig2mjError as e:
                found = e
            yield file, found
        return
    all_jobs = [Job(f"file_{n:06d}", {"file": str(file), **arguments}) for n, file in enumerate(files)]
    with follow("reading recordings") as report:
        store, failed = map_jobs(JobSet(function, "", all_jobs, gpu=True), Where(jobs), progress=report)
    for file, job in zip(files, all_jobs, strict=True):
        yield file, Ig2mjError(failed[job.name]) if job.name in failed else json.loads(store.get(job.name))
