"""`ig2mj demos replay --cluster`: the runs of a recording in jobs, with a journal."""

from __future__ import annotations

import contextlib
import hashlib
import pathlib
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ig2mj.cli.common.jobs import follow, opened, tell_failures

if TYPE_CHECKING:
    from ig2mj.cluster.job_runner import Where


def replay_by_jobs(
    file: pathlib.Path,
    by: str,
    check: bool,
    sensors: Sequence[str],
    out: pathlib.Path | None,
    threads: int,
    where: Where,
) -> int:
    """Replays one recording; the exit status. Arguments: of `ig2mj demos replay`."""
    from ig2mj.cluster.job_runner import map_jobs
    from ig2mj.cluster.jobs import JobSet
    from ig2mj.demos.reader import Recording
    from ig2mj.demos.replay_jobs import RECORDING, join_replays, replay_jobs
    from ig2mj.envs.shared_starts import shared_pool

    settings = {"file": str(file.resolve()), "by": by, "check": check, "sensors": list(sensors), "threads": threads}
    observed = (out or file.with_suffix(".sensors.h5")) if sensors else None
    with Recording(file) as recording:
        made = recording.value("made_with", dict)
        starts = {"task": recording.value("task", str), "split": made.get("split"), "count": made.get("pool_size")}
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
    for warning in done["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
    for difference in done["differences"]:
        print(f"{file}: {difference}")
    same = "" if not check or by == "state" or done["differences"] or failed else ", all the same"
    print(f"{file}: {done['runs']} runs, {done['frames']} frames by {by}{same}")
    return 1 if done["differences"] or failed else 0
