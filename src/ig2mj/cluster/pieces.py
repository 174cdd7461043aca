"""`run`: a list of independent, seeded pieces of work, on this machine's processes or on a Ray cluster.

A piece is a name, and arguments that JSON can hold, for a function that is found by its own name and gives bytes. What
it gives depends on the arguments alone, so that it does not matter where a piece is done, or in which order. One that
fails is tried again, elsewhere where there is an elsewhere, then listed with its reason while the others go on.
"""

from __future__ import annotations

import collections
import dataclasses
import os
import time
from collections.abc import Callable
from typing import Protocol, runtime_checkable

from ig2mj.cluster.journal import Journal, Memory
from ig2mj.cluster.work import Answer, Piece, Work
from ig2mj.errors import ClusterError, EngineError, Ig2mjError, StateError

RETRIES = 2
"""Times that a failed piece is tried again. What the user did wrong is wrong every time and is not tried again."""


SIMPLE = {kind.__name__: kind for kind in (EngineError, StateError, ClusterError)}
"""Errors that are made of their message alone."""


@dataclasses.dataclass(frozen=True)
class Where:
    """Where pieces are done.

    Attributes:
      jobs: processes of this machine; 1: this one; 0: one for each processor.
      cluster: address of a Ray cluster, or "auto" for the one that this machine belongs to; None: this machine.
      resume: go on with the run that was broken off.
    """

    jobs: int = 1
    cluster: str | None = None
    resume: bool = False


@dataclasses.dataclass(frozen=True)
class Status:
    """How far a run is. `seconds_left`: from the pace so far; None before the first piece is done."""

    done: int
    failed: int
    running: int
    total: int
    seconds_left: float | None

    def __str__(self) -> str:
        parts = [f"{self.running} running"]
        if self.failed:
            parts.insert(0, f"{self.failed} failed")
        if self.seconds_left is not None:
            left = round(self.seconds_left)
            parts.append(f"{left // 3600}:{left // 60 % 60:02}:{left % 60:02} left" if left else "nearly done")
        return ", ".join(parts)


@runtime_checkable
class Workers(Protocol):
    """Who does pieces: `LocalProcesses`, `ThisProcess`, `RayNodes`. `width`: pieces that are worth handing out."""

    @property
    def width(self) -> int: ...

    @property
    def running(self) -> int: ...

    def submit(self, piece: Piece) -> None:
        """Hands a piece out."""
        ...

    def wait(self) -> list[Answer]:
        """Waits for at least one."""
        ...

    def close(self, now: bool) -> None:
        """Ends; `now`: whatever is still being done."""
        ...


Report = Callable[[Status], None]


def run(
    work: Work,
    where: Where = Where(),
    store: Journal | Memory | None = None,
    report: Report = lambda status: None,
) -> tuple[Journal | Memory, dict[str, str]]:
    """Does all pieces that the store does not have yet.

    Args:
      store: keeps results as they come; None: in memory.

    Returns:
      The store, and for each piece that failed the reason, in the order of the pieces.

    Raises:
      ClusterError: the cluster cannot be reached, or cannot do this work. Whatever a piece says all of them would.
    """
    store = Memory() if store is None else store
    todo = collections.deque(piece for piece in work.pieces if piece.name not in store.names())
    failed: dict[str, str] = {}
    if not todo:
        return store, failed
    workers, began, before = _workers(work, where, len(todo)), time.monotonic(), len(work.pieces) - len(todo)
    by_name, tries = {piece.name: piece for piece in work.pieces}, collections.Counter[str]()
    clean = False

    def tell() -> None:
        done = len(work.pieces) - len(todo) - workers.running - len(failed)
        fresh, spent = done - before + len(failed), time.monotonic() - began
        left = (len(todo) + workers.running) * spent / fresh if fresh else None
        report(Status(done, len(failed), workers.running, len(work.pieces), left))

    try:
        while todo or workers.running:
            while todo and workers.running < workers.width:
                workers.submit(todo.popleft())
            tell()
            for answer in workers.wait():
                if not answer.error:
                    store.put(answer.name, answer.result)
                    continue
                if answer.all_fail:
                    raise answer.cause or SIMPLE.get(answer.kind, Ig2mjError)(answer.error)
                tries[answer.name] += 1
                if answer.again and tries[answer.name] <= RETRIES:
                    todo.append(by_name[answer.name])
                else:
                    failed[answer.name] = answer.error
        tell()
        clean = True
    finally:
        workers.close(now=not clean)
    return store, {piece.name: failed[piece.name] for piece in work.pieces if piece.name in failed}


def _workers(work: Work, where: Where, count: int) -> Workers:
    if where.cluster is not None:
        from ig2mj.cluster.ray_nodes import RayNodes

        return RayNodes(work, where.cluster)
    from ig2mj.cluster.processes import LocalProcesses, ThisProcess

    jobs = min(where.jobs or os.cpu_count() or 1, count)
    return ThisProcess(work) if jobs == 1 else LocalProcesses(work, jobs)
