"""CoACD in a process of its own, with a time limit: it may hang or crash, and must not take the converter along.

The parent writes the mesh to a temporary file and runs `python -m ig2mj_converters.hulls.workers IN OUT`; the child
writes the pieces. On a time-out the child, and only it, is killed.
"""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np

COMMAND = (sys.executable, "-m", "ig2mj_converters.hulls.workers")
"""What is run; the names of the input and output files follow."""


class WorkerError(Exception):
    """The worker gave no result; the message says why in a few words.

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
    time_limit: float,
    threads: int = 1,
) -> list[np.ndarray]:
    """The vertices [n, 3] of CoACD's convex parts, in an order that does not depend on threads.

    Args:
      parameters: keyword arguments of `coacd.run_coacd`.
      time_limit: seconds, the start of the process included.

    Raises:
      WorkerError: it hung, crashed or found nothing.
    """
    environment = os.environ | {"OMP_NUM_THREADS": str(max(threads, 1)), "OPENBLAS_NUM_THREADS": "1"}
    environment["IG2MJ_WORKER_CPU_LIMIT"] = str(int(time_limit * max(threads, 1)) + 5)
    with tempfile.TemporaryDirectory(prefix="ig2mj-coacd-") as folder:
        given, found = pathlib.Path(folder, "in.npz"), pathlib.Path(folder, "out.npz")
        names = np.array(list(parameters), dtype=str)
        values = np.array([repr(v) for v in parameters.values()], dtype=str)
        np.savez(given, vertices=vertices, faces=faces, names=names, values=values)
        try:
            done = subprocess.run(
                [*COMMAND, str(given), str(found)],
                env=environment,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=max(time_limit, 0.01),
                check=False,
            )
        except subprocess.TimeoutExpired as e:
            raise WorkerError(f"took longer than {time_limit:.0f} s", stopped=True) from e
        if done.returncode != 0 or not found.exists():
            raise WorkerError(_reason(done), stopped=done.returncode < 0)
        with np.load(found, allow_pickle=False) as file:
            pieces = [file[f"piece_{i}"] for i in range(int(file["count"]))]
    if not pieces:
        raise WorkerError("found no pieces")
    return sorted(pieces, key=lambda p: tuple(np.round(p.mean(axis=0), 9)))


def _reason(done: subprocess.CompletedProcess[bytes]) -> str:
    if done.returncode < 0:
        return f"crashed (signal {-done.returncode})"
    lines = [line.strip() for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
    return f"failed: {lines[-1][:200]}" if lines else f"failed with status {done.returncode}"


def main(given: str, found: str) -> None:
    """What the child does."""
    _limit_cpu(int(os.environ.get("IG2MJ_WORKER_CPU_LIMIT", "0")))
    import ast

    import coacd

    coacd.set_log_level("off")
    with np.load(given, allow_pickle=False) as file:
        mesh = coacd.Mesh(file["vertices"], file["faces"])
        parameters = {str(n): ast.literal_eval(str(v)) for n, v in zip(file["names"], file["values"], strict=True)}
    pieces = [np.asarray(p[0], np.float64) for p in coacd.run_coacd(mesh, **parameters)]
    everything: dict[str, Any] = {"count": len(pieces)} | {f"piece_{i}": p for i, p in enumerate(pieces)}
    np.savez(found, **everything)


def _limit_cpu(seconds: int) -> None:
    """Ends this process after so much processor time, for the case that the parent dies first and cannot."""
    try:
        import resource
    except ImportError:  # no POSIX: the parent's time limit alone must do
        return
    if seconds > 0:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))


if __name__ == "__main__":
    main(*sys.argv[1:])
