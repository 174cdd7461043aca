"""`reports`: runs a program of its own process, and passes on the JSON that it reports, line by line.

A program that crashes, or that says nothing for too long, ends without harm to others: long runs of many independent
parts record what became of a part and go on with the next.
"""

from __future__ import annotations

import json
import os
import pathlib
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from ig2mj.errors import Ig2mjError

PREFIX = "report: "
"""Of the lines of standard output that are reports; other lines go to the log."""

ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}
"""Environment of a process that is one of many on a machine: libraries start no threads of their own."""


class ProcessEnded(Ig2mjError):
    """A process ended before it was done: it crashed, or it was silent for too long."""


def report(**content: Any) -> None:
    """Reports JSON to the process that started this one with `reports`."""
    sys.stdout.write(PREFIX + json.dumps(content) + "\n")
    sys.stdout.flush()


def end_with_parent() -> None:
    """Ends this process as soon as the one that started it with `reports` is gone."""

    def wait() -> None:
        sys.stdin.read()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def reports(
    command: Sequence[str],
    silence: Callable[[], float],
    log: pathlib.Path,
    environment: Mapping[str, str] = ONE_THREAD,
    cwd: pathlib.Path | None = None,
) -> Iterator[dict[str, Any]]:
    """Starts a program, and yields what it reports. Closing the iterator ends the program.

    Args:
      command: program and arguments. silence: seconds without a report after which the program is ended; asked again
        for each report. log: file that gets everything else that it prints.
      environment: variables that are set in addition to those of this process. cwd: folder that it runs in.

    Raises:
      ProcessEnded: it did not end by itself with status 0.
    """
    lines: queue.Queue[str | None] = queue.Queue()
    with log.open("a", encoding="utf-8") as errors:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            encoding="utf-8",
            errors="replace",
            env={**os.environ, **environment},
            cwd=cwd,
            start_new_session=True,  # Ctrl-C is handled here
        )
        assert process.stdout is not None
        threading.Thread(target=_read, args=(process.stdout, lines), daemon=True).start()
        try:
            while True:
                limit = silence()
                try:
                    line = lines.get(timeout=limit)
                except queue.Empty:
                    raise ProcessEnded(f"nothing was reported for {limit:.0f} s") from None
                if line is None:
                    break
                if line.startswith(PREFIX):
                    yield json.loads(line[len(PREFIX) :])
                else:
                    errors.write(line)
            if status := process.wait():
                raise ProcessEnded(f"the process ended with status {status}")
        finally:
            process.kill()
            process.wait()
            process.stdout.close()
            if process.stdin is not None:
                process.stdin.close()


def _read(stream: Iterable[str], lines: queue.Queue[str | None]) -> None:
    try:
        for line in stream:
            lines.put(line)
    except ValueError:  # closed
        pass
    lines.put(None)
