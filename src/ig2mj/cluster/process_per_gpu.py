"""`run_on_each_gpu`: a command once for each GPU of this machine, as the processes of one distributed run.

Several GPUs train faster from a process each than from one: launching of kernels takes turns within a process.
"""

from __future__ import annotations

import contextlib
import math
import signal
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from types import FrameType

GRACE = 90.0
"""Seconds that processes have to write their last checkpoint and end, once one has failed or was interrupted."""


def visible_gpus(environ: Mapping[str, str]) -> list[str]:
    """The GPUs that programs of this machine may use, as CUDA_VISIBLE_DEVICES names them. CUDA is not started.

    There are none where JAX_PLATFORMS names other platforms, or NVIDIA's `nvidia-smi` does not answer.
    """
    platforms = environ.get("JAX_PLATFORMS", "")
    if platforms and not {"cuda", "gpu"} & {name.strip() for name in platforms.split(",")}:
        return []
    if "CUDA_VISIBLE_DEVICES" in environ:
        return [gpu.strip() for gpu in environ["CUDA_VISIBLE_DEVICES"].split(",") if gpu.strip() not in ("", "-1")]
    try:
        listed = subprocess.run(["nvidia-smi", "-L"], capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return []
    gpus = [line for line in listed.stdout.splitlines() if line.startswith("GPU ")]
    return [str(k) for k in range(len(gpus))] if listed.returncode == 0 else []


def run_on_each_gpu(gpus: Sequence[str], command: Sequence[str], environ: Mapping[str, str]) -> int:
    """Runs a command in a process for each GPU, with the variables of `process_topology.find_topology`.

    Ctrl+C and SIGTERM go to all of them. Returns the exit status: 0, or that of the first process that failed.
    """
    with socket.create_server(("localhost", 0)) as free:
        port = free.getsockname()[1]
    shared = {"JAX_COORDINATOR_ADDRESS": f"localhost:{port}", "JAX_NUM_PROCESSES": str(len(gpus))}
    processes = list[subprocess.Popen[bytes]]()
    with _forwarded(signal.SIGTERM, processes):
        for rank, gpu in enumerate(gpus):
            own = {"JAX_PROCESS_ID": str(rank), "CUDA_VISIBLE_DEVICES": gpu}
            processes.append(subprocess.Popen(command, env={**environ, **shared, **own}))
        try:
            return _first_failure(processes)
        except KeyboardInterrupt:
            _end(processes, signal.SIGINT)
            raise
        finally:
            _end(processes, signal.SIGTERM)


def _first_failure(processes: Sequence[subprocess.Popen[bytes]]) -> int:
    """Waits until all have ended; the status of the first that fails, or 0. The others notice by themselves that a
    process of their team has ended, say which, and have `GRACE` seconds for it."""
    failed, until, left = 0, math.inf, list(processes)
    while left and time.monotonic() < until:
        for process in list(left):
            with contextlib.suppress(subprocess.TimeoutExpired):
                status = process.wait(0.2 / len(left))
                left.remove(process)
                if status and not failed:
                    failed, until = status, time.monotonic() + GRACE
    return failed


def _end(processes: Sequence[subprocess.Popen[bytes]], how: signal.Signals) -> None:
    """Ends those that run: by a signal, and after `GRACE` seconds by SIGKILL."""
    running = [process for process in processes if process.poll() is None]
    for process in running:
        process.send_signal(how)
    for process in running:
        try:
            process.wait(GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextlib.contextmanager
def _forwarded(number: signal.Signals, processes: Sequence[subprocess.Popen[bytes]]) -> Iterator[None]:
    """Inside the block this signal goes to the processes; in threads other than the first it does what it did."""

    def forward(received: int, frame: FrameType | None) -> None:
        for process in processes:
            if process.poll() is None:
                process.send_signal(received)

    try:
        before = signal.signal(number, forward)
    except ValueError:
        yield
        return
    try:
        yield
    finally:
        signal.signal(number, before)
