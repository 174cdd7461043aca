"""`Curves`: a run's figures in TensorBoard's file, written by a thread of its own.

The library that writes it imports PyTorch where that is installed, which takes ten seconds on a busy machine. The
thread begins with the first figures, so that nothing waits for it.
"""

from __future__ import annotations

import concurrent.futures
import functools
import pathlib
import sys
from collections.abc import Mapping
from typing import Any


class Curves:
    """See the module's text. What was added is written at the latest when the process ends."""

    def __init__(self, folder: pathlib.Path):
        """`folder`: of the run."""
        self._folder = folder
        self._thread = concurrent.futures.ThreadPoolExecutor(1, thread_name_prefix="curves")

    def add(self, step: int, values: Mapping[str, float]) -> None:
        """Adds a point to each curve."""
        self._thread.submit(self._write, step, dict(values))

    def close(self) -> None:
        """Waits until everything is written; nothing can be added afterwards."""
        self._thread.submit(lambda: self._writer.close() if self._writer is not None else None)
        self._thread.shutdown()

    def _write(self, step: int, values: dict[str, float]) -> None:
        if self._writer is not None:
            for name, value in values.items():
                self._writer.add_scalar(name, value, step)

    @functools.cached_property
    def _writer(self) -> Any:
        try:
            from tensorboardX import SummaryWriter

            return SummaryWriter(str(self._folder), flush_secs=10)
        except ModuleNotFoundError:
            print("no TensorBoard file: the package tensorboardX is not installed", file=sys.stderr)
        except Exception as e:  # a thread's error is said nowhere else; the run and `progress.csv` go on
            print(f"no TensorBoard file: {e}", file=sys.stderr)
        return None
