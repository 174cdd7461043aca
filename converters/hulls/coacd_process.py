"""CoACD in a process of its own, with limits: it may hang or crash, and must not take the converter along.

The parent writes the mesh to a temporary file and runs `python -m ig2mj_converters.hulls.coacd_process IN OUT`; the
child writes the pieces. The limit is processor time, so that a busy machine gives the same result as an idle one. The
child ends with its parent: the pipe that is its standard input closes then.
"""

from __future__ import annotations

import math
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from typing import Any

import numpy as np

COMMAND = (sys.executable, "-m", "ig2mj_converters.hulls.coacd_process")
"""What is run; the names of the input and output files follow."""

ASLEEP_FACTOR, ASLEEP_GRACE = 20.0, 10.0
"""A process that has not ended after so many times its processor time, and so many seconds more, hangs."""

try:
    import resource
except ImportError:  # no POSIX: there is only the clock on the wall
    resource = None
    ASLEEP_FACTOR = 1.0


class DecompositionError(Exception):
    """CoACD gave no result; the message says why in a few words.

    stopped: it was ended from outside, for its time or by a signal (memory, say): another run may do better.
    """

    def __init__(self, message: str, *, stopped: bool = False):
        super().__init__(message)
        self.stopped = stopped


def run_coacd(
    vertices: np.ndarray,
    faces: np.ndarray,
    parameters: Mapping[str, float | int | str | bool],
    *,
    cpu_limit: float,
    threads: int = 1,
) -> list[np.ndarray]:
    """The vertices [n, 3] of CoACD's convex parts, in an order that does not depend on threads.

    Args:
      parameters: keyword arguments of `coacd.run_coacd`.
      cpu_limit: seconds of processor time, the start of the process included; whole ones, rounded up.

    Raises:
      DecompositionError: it hung, crashed or found nothing.
    """
    environment = os.environ | {"OMP_NUM_THREADS": str(max(threads, 1)), "OPENBLAS_NUM_THREADS": "1"}
    seconds = max(1, math.ceil(cpu_limit * max(threads, 1)))
    with tempfile.TemporaryDirectory(prefix="ig2mj-coacd-") as folder:
        given, found, said = (pathlib.Path(folder, name) for name in ("in.npz", "out.npz", "stderr"))
        names = np.array(list(parameters), dtype=str)
        values = np.array([repr(v) for v in parameters.values()], dtype=str)
        np.savez(given, vertices=vertices, faces=faces, names=names, values=values)
        status = _run([*COMMAND, str(given), str(found)], environment, said, seconds)
        if status != 0 or not found.exists():
            raise DecompositionError(_reason(status, said, seconds), stopped=status < 0)
        with np.load(found, allow_pickle=False) as file:
            pieces = [file[f"piece_{i}"] for i in range(int(file["count"]))]
    if not pieces:
        raise DecompositionError("found no pieces")
    return sorted(pieces, key=lambda p: tuple(np.round(p.mean(axis=0), 9)))


def _run(command: list[str], environment: dict[str, str], said: pathlib.Path, cpu_seconds: int) -> int:
    """The command's exit status, negative for the signal that ended it."""
    with (
        said.open("wb") as errors,
        subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors
        ) as process,
    ):
        try:
            if resource is not None and hasattr(resource, "prlimit"):
                resource.prlimit(process.pid, resource.RLIMIT_CPU, (cpu_seconds, cpu_seconds + 1))
            return process.wait(ASLEEP_FACTOR * cpu_seconds + ASLEEP_GRACE)
        except subprocess.TimeoutExpired as e:
            raise DecompositionError("did not end", stopped=True) from e
        finally:
            process.kill()


def _reason(status: int, said: pathlib.Path, cpu_seconds: int) -> str:
    if status == -getattr(signal, "SIGXCPU", 0):
        return f"took longer than {cpu_seconds} s of processor time"
    if status < 0:
        return f"crashed (signal {-status})"
    lines = [line.strip() for line in said.read_text(errors="replace").splitlines() if line.strip()]
    return f"failed: {lines[-1][:200]}" if lines else f"failed with status {status}"


def main(given: str, found: str) -> None:
    """What the child does."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    import ast

    import coacd

    coacd.set_log_level("off")
    with np.load(given, allow_pickle=False) as file:
        mesh = coacd.Mesh(file["vertices"], file["faces"])
        parameters = {str(n): ast.literal_eval(str(v)) for n, v in zip(file["names"], file["values"], strict=True)}
    pieces = [np.asarray(p[0], np.float64) for p in coacd.run_coacd(mesh, **parameters)]
    everything: dict[str, Any] = {"count": len(pieces)} | {f"piece_{i}": p for i, p in enumerate(pieces)}
    np.savez(found, **everything)


def _end_with_parent() -> None:
    """Waits until the other end of standard input is closed. CoACD runs without Python's lock, so this is heard.

    Without Python's buffer on top: a thread that holds its lock makes the interpreter abort when it ends.
    """
    os.read(0, 1)
    os._exit(1)


if __name__ == "__main__":
    main(*sys.argv[1:])
