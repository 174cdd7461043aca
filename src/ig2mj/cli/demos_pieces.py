"""`ig2mj demos replay --cluster`: the runs of a recording in pieces, with a journal."""

from __future__ import annotations

import contextlib
import hashlib
import pathlib
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ig2mj.cli.pieces import follow, opened, tell_failures

if TYPE_CHECKING:
    from ig2mj.cluster.pieces import Where


def replay_in_pieces(
    file: pathlib.Path,
    by: str,
    check: bool,
    sensors: Sequence[str],
    out: pathlib.Path | None,
    threads: int,
    where: Where,
) -> int:
    """Replays one recording; the exit status. Arguments: of `ig2mj demos replay`."""
    from ig2mj.cluster.pieces import run
    from ig2mj.cluster.work import Work
    from ig2mj.demos.pieces import RECORDING, join_replays, replay_pieces
    from ig2mj.demos.reader import Recording
    from ig2mj.envs.pieces import shared_pool

    settings = {"file": str(file.resolve()), "by": by, "check": check, "sensors": list(sensors), "threads": threads}
    observed = (out or file.with_suffix(".sensors.h5")) if sensors else None
    with Recording(file) as recording:
        made = recording.value("made_with", dict)
        starts = {"task": recording.value("task", str), "split": made.get("split"), "count": made.get("pool_size")}
        pieces = replay_pieces(recording, {**settings, "starts": starts})
    title = f"replaying {file.name}"
    shared = {} if where.cluster is None else {RECORDING: file.read_bytes(), **shared_pool(**starts)}
    work = Work("ig2mj.demos.pieces:replay_piece", title, pieces, shared, ("ig2mj.envs.pieces:start_states", starts))
    request = {"command": "demos replay", "digest": hashlib.sha256(file.read_bytes()).hexdigest(), **settings}
    with contextlib.ExitStack() as stack:
        journal = stack.enter_context(opened(observed or file.with_suffix(".replay"), request, where))
        store, failed = run(work, where, journal, stack.enter_context(follow(title, where)))
        parts = (store.get(piece.name) for piece in pieces if piece.name not in failed)
        done = join_replays(parts, observed)
        if not failed:
            journal.finish()
    tell_failures(failed, len(pieces))
    for warning in done["warnings"]:
        print(f"warning: {warning}", file=sys.stderr)
    for difference in done["differences"]:
        print(f"{file}: {difference}")
    same = "" if not check or by == "state" or done["differences"] or failed else ", all the same"
    print(f"{file}: {done['runs']} runs, {done['frames']} frames by {by}{same}")
    return 1 if done["differences"] or failed else 0
