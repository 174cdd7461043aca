"""`ig2mj demos replay FILE` and `export FILE`: replays recordings, checks, renders, observes and exports them."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.cli.common.jobs import Cluster, Resume, follow, opened, tell_failures, where_of
from ig2mj.cli.common.tasks import TaskOption, use_task

if TYPE_CHECKING:
    from ig2mj.cluster.job_runner import Where
    from ig2mj.demos.reader import Run
    from ig2mj.envs.environment import EnvState


def replay(
    file: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE|FOLDER")],
    by: str = "action",
    check: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    video: pathlib.Path | None = None,
    sensors: str = "",
    out: pathlib.Path | None = None,
    threads: int = 0,
    jobs: int = 1,
    cluster: Cluster = None,
    resume: Resume = False,
    task: TaskOption = None,
) -> int:
    """Replay a recording of an environment (`ig2mj rollout --record FILE`), or all recordings of a folder.

    Args:
      file: the recording, or a folder of them.
      by: action: take every action again (on the native engine the result is byte-identical); state: load every frame
        as recorded, exact on any machine.
      check: compare every byte of every frame; print the first difference of each run, exit status 1 if there is one.
      video: video of the first run (.mp4, .gif); needs OpenGL and the native engine.
      sensors: compute observations that were not recorded, e.g. rgb,depth; written to --out.
      out: HDF5 file of the observations; default: FILE with the ending .sensors.h5.
      threads: threads on which the native engine steps worlds; 0: one per processor.
      jobs: number of processes; each takes one recording at a time.
      cluster: run on a Ray cluster, one job per run: its address, or auto.
      resume: continue an interrupted replay.
      task: the recording's task, if it is defined in a file of yours; this imports the file.
    """
    import sys

    from ig2mj.cli.common.files import check_output, check_video
    from ig2mj.cli.demos_folder import files_of, of_files
    from ig2mj.demos.replay import MODES
    from ig2mj.errors import Ig2mjError, UnknownNameError

    if by not in MODES:
        raise UnknownNameError("way to replay", by, MODES)
    if threads < 0 or jobs < 1:
        raise Ig2mjError(f"--threads {threads}, --jobs {jobs}: 0 threads or more, and 1 process or more are possible")
    use_task(task)
    files = files_of(file)
    if len(files) > 1 and (video is not None or out is not None):
        raise Ig2mjError("--video and --out are of one recording: name a file")
    if video is not None:
        check_video(video)
    if out is not None:
        check_output(out)
    names = tuple(name.strip() for name in sensors.split(",") if name.strip())
    if cluster is not None or resume:
        if video is not None:
            raise Ig2mjError("--video is made on this machine: leave --cluster and --resume out")
        where = where_of(jobs, cluster, resume)
        return max(_replay_by_jobs(one, by, check, names, out, threads, where) for one in files)
    status = 0
    options: dict[str, Any] = {"by": by, "check": check, "names": names, "threads": threads}
    options |= {name: None if path is None else str(path) for name, path in (("video", video), ("out", out))}
    for one, done in of_files("ig2mj.cli.demos_replay:replay_file_job", files, jobs, **options):
        if isinstance(done, Ig2mjError):
            if len(files) == 1:
                raise done
            print(f"error: {done}", file=sys.stderr)
            status = 2
            continue
        status = max(status, print_replay(one, done, by, check))
    return status


def replay_file_job(
    file: str, by: str, check: bool, names: Sequence[str], threads: int, video: str | None, out: str | None
) -> bytes:
    """Replays one recording, for a job; the result as JSON. Arguments: of `replay`."""
    import json

    from ig2mj.demos.reader import Recording
    from ig2mj.demos.replay import Replayer
    from ig2mj.demos.replay_jobs import Observing
    from ig2mj.envs.registry import VECTORS

    options: dict[str, Any] = {"threads": threads} if threads else {}
    with Recording(file) as recording:
        replayer = Replayer(recording, by, observations=tuple(names) or VECTORS, **options)
        watchers: list[Any] = []
        observing = None
        try:
            if video is not None:
                watchers.append(_Filming(pathlib.Path(video), replayer.env))
            if names:
                observing = Observing.into(pathlib.Path(out or sensors_file(file)), names, recording)
                watchers.append(observing)

            def watch(state: EnvState, runs: dict[int, Run], frame: int) -> None:
                for watcher in watchers:
                    watcher.see(state, runs, frame)

            done = replayer(check, watch if watchers else None)
            found = {"runs": done.runs, "frames": done.frames, "warnings": done.warnings}
            return json.dumps({**found, "differences": [str(d) for d in done.differences]}).encode()
        except BaseException:
            if observing is not None:
                observing.discard()
            raise
        finally:
            for watcher in watchers:
                watcher.close()


def _replay_by_jobs(
    file: pathlib.Path,
    by: str,
    check: bool,
    sensors: Sequence[str],
    out: pathlib.Path | None,
    threads: int,
    where: Where,
) -> int:
    """Replays one recording; the exit status. Arguments: of `ig2mj demos replay`."""
    import contextlib
    import hashlib

    from ig2mj.cluster.job_runner import map_jobs
    from ig2mj.cluster.jobs import JobSet
    from ig2mj.demos.reader import Recording
    from ig2mj.demos.replay import objects_again
    from ig2mj.demos.replay_jobs import RECORDING, join_replays, replay_jobs
    from ig2mj.envs.shared_starts import shared_pool

    settings = {"file": str(file.resolve()), "by": by, "check": check, "sensors": list(sensors), "threads": threads}
    observed = (out or sensors_file(file)) if sensors else None
    with Recording(file) as recording:
        made = recording.value("made_with", dict)
        starts = {"task": recording.value("task", str), "split": made.get("split"), "count": made.get("pool_size")}
        starts |= {"objects": objects_again(recording, made["objects"])} if made.get("objects") else {}
        jobs = replay_jobs(recording, {**settings, "starts": starts})
    title = f"replaying {file.name}"
    shared = {} if where.cluster is None else {RECORDING: file.read_bytes(), **shared_pool(**starts)}
    work = JobSet(
        "ig2mj.demos.replay_jobs:replay_job", title, jobs, shared, ("ig2mj.envs.shared_starts:start_states", starts)
    )
    request = {"command": "demos replay", "digest": hashlib.sha256(file.read_bytes()).hexdigest(), **settings}
    with contextlib.ExitStack() as stack:
        journal = stack.enter_context(opened(observed or file.with_suffix(".replay"), request, where))
        store, failed = map_jobs(work, where, journal, stack.enter_context(follow(title)))
        parts = (store.get(job.name) for job in jobs if job.name not in failed)
        done = join_replays(parts, observed)
        if not failed:
            journal.finish()
    tell_failures(failed, len(jobs))
    return max(print_replay(file, done, by, check and not failed), 1 if failed else 0)


def print_replay(file: pathlib.Path, done: Mapping[str, Any], by: str, check: bool) -> int:
    """Prints the result of a replay; the exit status."""
    import sys

    for warning in done["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
    for difference in done["differences"]:
        print(f"{file}: {difference}")
    same = "" if not check or by == "state" or done["differences"] else ", all the same"
    print(f"{file}: {done['runs']} runs, {done['frames']} frames by {by}{same}")
    return 1 if done["differences"] else 0


def sensors_file(file: str | pathlib.Path) -> pathlib.Path:
    """The default file for the observations of a replay."""
    return pathlib.Path(file).with_suffix(".sensors.h5")


def export(
    file: Annotated[pathlib.Path, tyro.conf.Positional],
    out: pathlib.Path,
    to: str = "robomimic",
    by: str = "action",
    obs: str = "",
    success_only: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    include_incomplete: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    task: TaskOption = None,
) -> int:
    """Export a recording to another project's format, with observations computed by a replay.

    Episodes that were cut off, by the end of a rollout or Ctrl-C, are left out. The output is complete or not there.

    Args:
      file: the recording (`ig2mj rollout --record FILE`).
      out: output file; for lerobot and igibson a folder.
      to: robomimic (HDF5), lerobot (datasets v3.0: parquet and videos) or igibson (HDF5).
      by: replay by action (compares every byte) or by state.
      obs: observations, e.g. proprioception,rgb; default: those of the recorded environment. igibson has none.
      success_only: export successful episodes only.
      include_incomplete: export episodes that were cut off, too.
      task: the recording's task, if it is defined in a file of yours; this imports the file.
    """
    import sys

    from ig2mj.cli.common.files import check_output
    from ig2mj.demos.exports import EXPORTS
    from ig2mj.demos.reader import Recording
    from ig2mj.demos.replay import MODES, Replayer, recorded_observations
    from ig2mj.demos.selection import left_out, some_runs
    from ig2mj.demos.shipped import find_recording
    from ig2mj.errors import UnknownNameError

    for kind, name, known in (("format", to, tuple(EXPORTS)), ("way to replay", by, MODES)):
        if name not in known:
            raise UnknownNameError(kind, name, known)
    use_task(task)
    names = tuple(name.strip() for name in obs.split(",") if name.strip())
    if to == "robomimic":
        check_output(out)
    with Recording(find_recording(file)) as recording:
        runs = some_runs(recording, success_only, include_incomplete)
        replayer = Replayer(recording, by, observations=names or recorded_observations(recording))
        done = EXPORTS[to](replayer, out, success_only=success_only, incomplete=include_incomplete)
        others = left_out(recording, runs)
    print(f"{out}: {done.runs} runs of {file}")
    if others:
        print(f"left out: {others}", file=sys.stderr)
    return 0


class _Filming:
    """A video of the first run of the first world that is replayed."""

    def __init__(self, file: pathlib.Path, env: Any):
        from ig2mj.showcase.episode_video import EpisodeVideo

        self._film, self._run = EpisodeVideo(file, env), ""

    def see(self, state: EnvState, runs: dict[int, Run], frame: int) -> None:
        if 0 in runs and self._run in ("", runs[0].name):
            self._run = runs[0].name
            self._film.see(state)

    def close(self) -> None:
        self._film.close()
