"""First use: what is compiled once per machine is kept, and the wait is not silent.

Two compilers work before the first step. Warp compiles about 80 modules of physics kernels (minutes), and keeps them in
its own folder under the user's cache. XLA compiles the step; its programs are kept below ig2mj's cache folder, unless
JAX was given a folder already. `ig2mj doctor` lists the folders; IG2MJ_CACHE_DIR moves both.
"""

from __future__ import annotations

import os
import pathlib
import sys
import threading
from collections.abc import Callable
from typing import Any

import jax
import platformdirs

ENVIRONMENT = "IG2MJ_CACHE_DIR"

MODULES = 80
"""About as many Warp modules does a home's step need."""

WORTH_KEEPING = 0.1
"""Seconds. Programs that XLA compiles faster than this are not kept."""

_REPORTING = "_ig2mj_reports_compilation"


def cache_folder() -> pathlib.Path:
    """ig2mj's cache folder: IG2MJ_CACHE_DIR, or the user's cache folder of this platform."""
    return pathlib.Path(os.environ.get(ENVIRONMENT) or platformdirs.user_cache_dir("ig2mj")).expanduser()


def keep_jax_programs() -> pathlib.Path | None:
    """Lets JAX keep compiled programs from one process to the next. Says where; None: it cannot.

    What the user told JAX (its option `jax_compilation_cache_dir`, or the variable of that name in capitals) stands.
    """
    chosen = getattr(jax.config, "jax_compilation_cache_dir", None)
    if chosen:
        return pathlib.Path(chosen)
    folder = cache_folder() / "jax"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    if not os.access(folder, os.W_OK):
        return None
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", WORTH_KEEPING)
    return folder


def report_warp_compilation() -> None:
    """From now on this process tells on stderr that Warp compiles kernels, instead of Warp's own lines on stdout.

    Once per process; without effect where Warp's inner workings are not those of 1.18.
    """
    import warp as wp

    if wp.config.log_level == wp.LOG_INFO:  # nobody asked for more or for less
        wp.config.log_level = wp.LOG_WARNING
    if os.environ.get(ENVIRONMENT) and "WARP_CACHE_PATH" not in os.environ and not wp.config.kernel_cache_dir:
        wp.config.kernel_cache_dir = str(cache_folder() / "warp")
    module = getattr(getattr(getattr(wp, "_src", None), "context", None), "Module", None)
    compile_module: Callable[..., bool] | None = getattr(module, "_compile", None)
    if module is None or compile_module is None or getattr(module, _REPORTING, False):
        return
    report = CompileReport()

    def compile_and_report(self: Any, device: Any = None, output_dir: Any = None, output_name: Any = None, *args, **kw):
        def work() -> bool:
            return compile_module(self, device, output_dir, output_name, *args, **kw)

        if output_dir is None or output_name is None or pathlib.Path(output_dir, output_name).exists():
            return work()
        return report.during(work)

    module._compile = compile_and_report
    setattr(module, _REPORTING, True)


class CompileReport:
    """Tells how many modules were compiled: in a terminal a line that comes and goes, elsewhere a line now and then."""

    EVERY = 10
    """Modules between two lines where there is no terminal."""

    def __init__(self) -> None:
        self.done = 0
        self._one = threading.Lock()

    def during(self, work: Callable[[], bool]) -> bool:
        """Does the work and tells of it."""
        from rich.console import Console

        if not self._one.acquire(blocking=False):  # another thread compiles, and tells
            return work()
        try:
            console = Console(file=sys.stderr)
            if console.is_terminal:
                try:
                    with console.status(f"{self.text()} ..."):
                        return work()
                finally:
                    self.done += 1
            if self.done % self.EVERY == 0:
                print(self.text(), file=sys.stderr, flush=True)
            self.done += 1
            return work()
        finally:
            self._one.release()

    def text(self) -> str:
        """The line."""
        return f"compiling physics kernels {self.done + 1}/{max(MODULES, self.done + 1)}, once per machine"
