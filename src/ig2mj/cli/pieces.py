"""What commands share that do their work in pieces: options, the journal beside the output, the progress bar."""

from __future__ import annotations

import contextlib
import pathlib
import sys
import time
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from ig2mj.cluster.journal import Deliver, Journal
    from ig2mj.cluster.pieces import Report, Status, Where

Cluster = Annotated[str | None, tyro.conf.arg(metavar="auto|ADDRESS")]
"""Option: the Ray cluster that does the work."""

Resume = Annotated[bool, tyro.conf.FlagCreatePairsOff]
"""Option: go on with a run that was broken off."""

EVERY = 30.0
"""Seconds between two lines where there is no terminal."""

LISTED = 20
"""Failed pieces that are listed by name."""


def where_of(jobs: int, cluster: str | None, resume: bool) -> Where:
    """Where pieces are to be done. Raises ClusterError where the cluster does not answer, before anything is made."""
    from ig2mj.cluster.pieces import Where

    if cluster is not None:
        from ig2mj.cluster.ray_nodes import check_address

        check_address(cluster)
    return Where(jobs, cluster, resume)


def opened(
    out: pathlib.Path, request: Mapping[str, Any], where: Where, deliver: Deliver | None = None, **options: Any
) -> Journal:
    """The journal of a run with this output. Raises ClusterError, InputError."""
    from ig2mj.cluster.journal import Journal
    from ig2mj.cluster.versions import versions

    return Journal(out, {**request, "versions": versions()}, where.resume, deliver, **options)


@contextlib.contextmanager
def follow(title: str, where: Where) -> Iterator[Report]:
    """A bar on the terminal, or lines now and then where there is none. What a piece that is done in this process says
    of itself (`ig2mj.process.progress`) stands next to the bar."""
    from ig2mj.cli.common.printing import add_bar, progress_bar
    from ig2mj.process.progress import shown_by

    last, words = [time.monotonic()], [""]
    told: list[Status] = []
    with progress_bar() as bar, contextlib.ExitStack() as stack:
        move = add_bar(bar, title)

        def show() -> None:
            status = told[-1] if told else None
            texts = [*([str(status)] if status else []), *([words[0]] if words[0] else [])]
            move("; ".join(texts), status.done + status.failed if status else 0, status.total if status else None)

        def report(status: Status) -> None:
            told.append(status)
            words[0] = ""
            show()
            if bar.disable and time.monotonic() - last[0] > EVERY:
                last[0] = time.monotonic()
                print(f"{title}: {status.done} of {status.total} done, {status}", file=sys.stderr, flush=True)

        def say(text: str) -> None:
            words[0] = text
            show()

        if not bar.disable:
            stack.enter_context(shown_by(say))
        yield report


def tell_failures(failed: Mapping[str, str], total: int) -> None:
    """Lists failed pieces with their reasons, on standard error."""
    if not failed:
        return
    print(f"{len(failed)} of {total} pieces failed; --resume tries them again:", file=sys.stderr)
    for name, reason in list(failed.items())[:LISTED]:
        print(f"  {name}: {reason}", file=sys.stderr)
    if len(failed) > LISTED:
        print(f"  and {len(failed) - LISTED} more", file=sys.stderr)
