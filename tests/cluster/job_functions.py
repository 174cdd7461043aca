"""Functions that tests of jobs call by name: `job_functions:NAME`, here and on nodes of a Ray cluster."""

from __future__ import annotations

import errno
import hashlib
import os
import pathlib
import time

from ig2mj.cluster.jobs import WholeRunError
from ig2mj.errors import EngineError, Ig2mjError


def digest(number: int, seconds: float = 0.0, note: str = "", shared: dict[str, bytes] | None = None) -> bytes:
    """Bytes that depend on the arguments alone. `note`: a folder in which who works leaves its process id."""
    if note:
        (pathlib.Path(note) / f"{number}-{os.getpid()}").touch()
    time.sleep(seconds)
    return hashlib.sha256(f"{number}".encode() + b"".join((shared or {}).values())).digest()


def failing(number: int, how: str, folder: str) -> bytes:
    """Fails in one way or another where the number is 2; counts its tries in files."""
    if number == 2:
        (pathlib.Path(folder) / f"try-{len(list(pathlib.Path(folder).glob('try-*')))}").touch()
        if how == "once" and len(list(pathlib.Path(folder).glob("try-*"))) > 1:
            return b"at last"
        if how == "death":
            os._exit(9)
        if how == "disk":
            raise OSError(errno.ENOSPC, "No space left on device", "/data/x")
        if how == "input":
            raise Ig2mjError("the object is broken")
        if how == "all":
            raise WholeRunError(EngineError("the scene does not come to rest"))
        raise ValueError("a bug\nof two lines")
    return b"%d" % number


def on_disk(number: int, note: str) -> bytes:
    """The number, which is written first to the file that this node's variable JOBS_DISK names."""
    file = os.environ.get("JOBS_DISK", "/dev/null")
    if file == "/dev/full":
        (pathlib.Path(note) / f"full-{number}-{time.monotonic_ns()}").touch()
    time.sleep(0.2)
    pathlib.Path(file).write_text(str(number))
    return b"%d" % number


def node_files(path: str) -> str:
    """A check: what a file of this machine holds."""
    return pathlib.Path(path).read_text()
