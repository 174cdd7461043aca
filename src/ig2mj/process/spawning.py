"""Processes of this machine that work for this one, and how many may be started without being asked for.

A spawned process imports the main script again. A user's script without the guard `if __name__ == "__main__"` would
begin again in each of them, so that the library starts none by itself; ig2mj's own commands may.
"""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable
from typing import Any

from ig2mj.process.processors import available

_allowed = False


def allow_spawning() -> None:
    """Called by ig2mj's commands, whose main module can be imported again."""
    global _allowed
    _allowed = True


def processes_for(parts: int) -> int:
    """Number of processes that share so many equal parts of a work: in a command of ig2mj at most one per processor,
    elsewhere 1."""
    return max(1, min(parts, available())) if _allowed else 1


def worker_processes(
    count: int,
    *,
    gpu: bool = False,
    ctrl_c: bool = False,
    begin: Callable[..., None] | None = None,
    arguments: tuple[Any, ...] = (),
) -> concurrent.futures.ProcessPoolExecutor:
    """Processes that end with this one. None starts before it is needed.

    Args:
      gpu: whether they may use one; many processes would fill its memory.
      ctrl_c: whether Ctrl-C, which reaches all processes of a terminal, interrupts them; else this one ends them.
      begin: called in each at first, with `arguments`.
    """
    context = multiprocessing.get_context("spawn")  # a forked process that has threads can hang
    settings = gpu, ctrl_c, begin, arguments
    return concurrent.futures.ProcessPoolExecutor(count, context, initializer=_begin, initargs=settings)


def _begin(gpu: bool, ctrl_c: bool, begin: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    if not ctrl_c:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if begin is not None:
        begin(*arguments)
    if not gpu:
        from ig2mj.process.settings import use_processor_only

        use_processor_only()


def _end_with_parent() -> None:
    """Exits when the parent process ends for any reason."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
