"""`Job`: one unit of distributed work.

A job is a name and JSON arguments for a function that is referenced by its own name and returns bytes.
"""

from __future__ import annotations

import dataclasses
import importlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Generic, TypeVar

from ig2mj.errors import Ig2mjError
from ig2mj.process import entry_point


@dataclasses.dataclass(frozen=True)
class Job:
    """One job. `name`: letters, digits, "-", "_", "." and "/"; unique within its set."""

    name: str
    arguments: Mapping[str, Any]


Jobs = TypeVar("Jobs", bound=Iterable[Job], covariant=True)


@dataclasses.dataclass(frozen=True)
class JobSet(Generic[Jobs]):
    """Jobs of one function.

    Attributes:
      function: "package.module:function"; it takes a job's arguments, and `shared` if there is any, and returns bytes.
      title: what is done, for progress bars.
      jobs: the jobs in the order of their results. An iterator is advanced whenever a worker is free.
      shared: bytes that all jobs need, by name, for files that need not be on every machine.
      check: "package.module:function" and its arguments. It is called once on every machine before the first job and
        must return the same text everywhere, e.g. a digest of the files that the jobs read.
      gpu: whether each job needs a GPU.
    """

    function: str
    title: str
    jobs: Jobs
    shared: Mapping[str, bytes] = dataclasses.field(default_factory=dict)
    check: tuple[str, Mapping[str, Any]] | None = None
    gpu: bool = False


@dataclasses.dataclass(frozen=True)
class JobResult:
    """Outcome of a job.

    Attributes:
      result: the bytes that the function returned. error: one line; "" if the job succeeded.
      kind: name of the error's class if it is one of `ig2mj.errors`. again: whether a retry may help.
      all_fail: whether every job of the set would fail in the same way.
      cause: the error itself, if the job ran in this process.
    """

    name: str
    result: bytes = b""
    error: str = ""
    kind: str = ""
    again: bool = False
    all_fail: bool = False
    cause: Exception | None = None


class WholeRunError(Exception):
    """Raised by a job's function for a failure that every job of the set shares. `cause`: the failure."""

    def __init__(self, cause: Ig2mjError):
        super().__init__(str(cause))
        self.cause = cause


def import_function(name: str) -> Callable[..., Any]:
    """Imports the function "package.module:function"."""
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


@entry_point
def run_job(function: str, job: Job, shared: Mapping[str, bytes]) -> JobResult:
    """Runs one job. Errors become part of the result: their classes may not exist where it is read."""
    options = {"shared": shared} if shared else {}
    try:
        return JobResult(job.name, import_function(function)(**job.arguments, **options))
    except WholeRunError as e:
        return JobResult(job.name, error=str(e), kind=type(e.cause).__name__, all_fail=True, cause=e.cause)
    except Ig2mjError as e:
        return JobResult(job.name, error=" ".join(str(e).split()), kind=type(e).__name__)
    except Exception as e:
        line = " ".join(str(e).split())
        return JobResult(job.name, error=f"{type(e).__name__}: {line}" if line else type(e).__name__, again=True)
