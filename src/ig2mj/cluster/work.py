"""What a piece of work is, and how one is done.

A piece is a name, and arguments that JSON can hold, for a function that is found by its own name and gives bytes.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ig2mj.errors import Ig2mjError
from ig2mj.process import entry_point


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
class Answer:
    """What came of a piece: its bytes, or in `error` one line. `again`: another try may help.
    `kind`: the class of the error, where it is one of `ig2mj.errors`. `all_fail`: it is no fault of this piece's.
    `cause`: the error itself, where the piece was done in this process."""

    name: str
    result: bytes = b""
    error: str = ""
    kind: str = ""
    again: bool = False
    all_fail: bool = False
    cause: Exception | None = None


class WholeRunError(Exception):
    """Raised by a piece's function: what failed would fail in every piece. `cause`: what it was."""

    def __init__(self, cause: Ig2mjError):
        super().__init__(str(cause))
        self.cause = cause


def found(name: str) -> Callable[..., Any]:
    """A function by "package.module:function"."""
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


@entry_point
def do(function: str, piece: Piece, shared: Mapping[str, bytes]) -> Answer:
    """Does one piece; errors are part of the answer, since their classes need not exist where it is read."""
    options = {"shared": shared} if shared else {}
    try:
        return Answer(piece.name, found(function)(**piece.arguments, **options))
    except WholeRunError as e:
        return Answer(piece.name, error=str(e), kind=type(e.cause).__name__, all_fail=True, cause=e.cause)
    except Ig2mjError as e:
        return Answer(piece.name, error=" ".join(str(e).split()), kind=type(e).__name__)
    except Exception as e:
        line = " ".join(str(e).split())
        return Answer(piece.name, error=f"{type(e).__name__}: {line}" if line else type(e).__name__, again=True)
