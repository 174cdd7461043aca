"""What commands share that run jobs: options, the journal next to the output, the progress bar."""

from __future__ import annotations

import contextlib
import pathlib
import sys
import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from ig2mj.callbacks import ProgressCallback
    from ig2mj.cluster.job_runner import Where
    from ig2mj.cluster.journal import Deliver, Journal

Cluster = Annotated[str | None, tyro.conf.arg(metavar="auto|ADDRESS")]
"""Option: the Ray cluster that does the work."""

Resume = Annotated[bool, tyro.conf.FlagCreatePairsOff]
"""Option: continue an interrupted run."""

EVERY = 30.0
"""Seconds between two lines where there is no terminal."""

LISTED = 20
"""Number of failed jobs to list by name."""


def where_of(jobs: int, cluster: str | None, resume: bool) -> Where:
    """Where jobs run. Raises ClusterError if the cluster does not answer, before any output is made."""
    from ig2mj.cluster.job_runner import Where

    if cluster is not None:
        from ig2mj.cluster.ray_nodes import check_address

        check_address(cluster)
    return Where(jobs, cluster, resume)


def opened(
    out: pathlib.Path, request: Mapping[str, Any], where: Where, deliver: Deliver | None = None, **options: Any
) -> Journal:
    """Opens the journal of a run with this output. Raises ClusterError, InputError."""
    from ig2mj.cluster.journal import Journal
    from ig2mj.cluster.versions import versions

    return Journal(out, {**request, "versions": versions()}, where.resume, deliver, **options)


@contextlib.contextmanager
def follow(title: str) -> Iterator[ProgressCallback]:
    """A progress bar on a terminal, else a line every `EVERY` seconds. The progress text of a job that runs in this
    process (`ig2mj.process.progress`) is shown next to the bar."""
    from ig2mj.cli.common.printing import add_bar, progress_bar
    from ig2mj.process.progress import shown_by

    printed, counts, job_text = time.monotonic(), (0.0, None, ""), ""
    with progress_bar() as bar, contextlib.ExitStack() as stack:
        move = add_bar(bar, title)

        def show() -> None:
            done, total, text = counts
            move(done, total, "; ".join(part for part in (text, job_text) if part))

        def report(done: float | int, total: float | int | None, text: str = "", /) -> None:
            nonlocal printed, counts, job_text
            counts, job_text = (done, total, text), ""
            show()
            if bar.disable and time.monotonic() - printed > EVERY:
                printed = time.monotonic()
                print(f"{title}: {done} of {total} done, {text}", file=sys.stderr, flush=True)

        def say(text: str) -> None:
            nonlocal job_text
            job_text = text
            show()

        if not bar.disable:
            stack.enter_context(shown_by(say))
        yield report


def tell_failures(failed: Mapping[str, str], total: int, again: str = "--resume") -> None:
    """Lists failed jobs on standard error, by reason; one line where all fail alike. `again`: what tries them again."""
    if not failed:
        return
    named: dict[str, list[str]] = {}
    for name, reason in failed.items():
        named.setdefault(reason, []).append(name)
    if len(named) == 1 and len(failed) == total > 1:
        print(f"error: all {total} jobs failed: {next(iter(named))}", file=sys.stderr)
        return
    print(f"{len(failed)} of {total} jobs failed; {again} tries them again:", file=sys.stderr)
    for reason, names in list(named.items())[:LISTED]:
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        print(f"  {names[0]}{more}: {reason}", file=sys.stderr)
    if len(named) > LISTED:
        print(f"  and {len(named) - LISTED} more reasons", file=sys.stderr)
