"""`run`: a list of independent, seeded pieces of work, on this machine's processes or on a Ray cluster.

A piece is a name, and arguments that JSON can hold, for a function that is found by its own name and gives bytes. What
it gives depends on the arguments alone, so that it does not matter where a piece is done, or in which order. One that
fails is tried again, elsewhere where there is an elsewhere, then listed with its reason while the others go on.
"""

from __future__ import annotations

import collections
import dataclasses
import importlib
import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from ig2mj import errors
from ig2mj.cluster.journal import Journal, Memory
from ig2mj.errors import ClusterError, Ig2mjError

RETRIES = 2
"""Times that a failed piece is tried again. What the user did wrong is wrong every time and is not tried again."""


@dataclasses.dataclass(frozen=True)
class Piece:
    """One piece. `name`: of letters, digits, "-", "_", "." and "/"; no two of a run have the same."""

    name: str
    arguments: Mapping[str, Any]


@dataclasses.dataclass(frozen=True)
class Work:
    """All pieces of a run.

    Attributes:
      function: "package.module:function": takes a piece's arguments, and `shared` where there is any, and gives bytes.
      title: what is done, for the progress bar. pieces: in the order of their results.
      shared: bytes that all pieces need, by name: files that need not be on every machine.
      check: "package.module:function" and its arguments: called once on every machine before any work, it must give the
        same text everywhere: a digest of the files that the pieces read there. gpu: a piece needs one.
    """

    function: str
    title: str
    pieces: Sequence[Piece]
    shared: Mapping[str, bytes] = dataclasses.field(default_factory=dict)
    check: tuple[str, Mapping[str, Any]] | None = None
    gpu: bool = False


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


@dataclasses.dataclass(frozen=True)
class Answer:
    """What came of a piece: its bytes, or in `error` one line. `again`: another try may help.
    `kind`: the class of the error, where it is one of `ig2mj.errors`. `all_fail`: it is no fault of this piece's."""

    name: str
    result: bytes = b""
    error: str = ""
    kind: str = ""
    again: bool = False
    all_fail: bool = False


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


class WholeRunError(Exception):
    """Raised by a piece's function: what failed would fail in every piece. `cause`: what it was."""

    def __init__(self, cause: Ig2mjError):
        super().__init__(str(cause))
        self.cause = cause


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
                    raise getattr(errors, answer.kind, ClusterError)(answer.error)
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


def found(name: str) -> Callable[..., Any]:
    """A function by "package.module:function"."""
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def do(function: str, piece: Piece, shared: Mapping[str, bytes]) -> Answer:
    """Does one piece; errors are part of the answer, since their classes need not exist where it is read."""
    options = {"shared": shared} if shared else {}
    try:
        return Answer(piece.name, found(function)(**piece.arguments, **options))
    except WholeRunError as e:
        return Answer(piece.name, error=str(e), kind=type(e.cause).__name__, all_fail=True)
    except Ig2mjError as e:
        return Answer(piece.name, error=" ".join(str(e).split()), kind=type(e).__name__)
    except Exception as e:
        line = " ".join(str(e).split())
        return Answer(piece.name, error=f"{type(e).__name__}: {line}" if line else type(e).__name__, again=True)
