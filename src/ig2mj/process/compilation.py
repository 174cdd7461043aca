"""First use: programs that are compiled once per machine are cached, and long compilations are reported.

Two compilers run before the first step. Warp compiles about 80 modules of physics kernels (minutes) and caches them in
its own folder under the user's cache. XLA compiles the step; its programs are cached below ig2mj's cache folder, unless
JAX was given a folder already. `ig2mj doctor` lists the folders; IG2MJ_CACHE_DIR moves both.
"""

from __future__ import annotations

import functools
import itertools
import os
import pathlib
import threading
from collections.abc import Callable
from typing import Any

import platformdirs

from ig2mj.process.waiting import WAITING, Work

CACHE_VARIABLE = "IG2MJ_CACHE_DIR"

MODULES = 80
"""Approximate number of Warp modules that a home's step needs."""

MIN_COMPILE_SECONDS = 0.0
"""Seconds. Programs that XLA compiles faster are not cached; dozens of small ones take 0.4 s of a rollout's start."""

XLA_EVENT = "/jax/core/compile/backend_compile_duration"
"""JAX's event: a scalar at the start of a compilation or cache look-up, a duration at its end."""

_REPORTING = "_ig2mj_reports_compilation"


def cache_folder() -> pathlib.Path:
    """ig2mj's cache folder: IG2MJ_CACHE_DIR, or the user's cache folder of this platform."""
    return pathlib.Path(os.environ.get(CACHE_VARIABLE) or platformdirs.user_cache_dir("ig2mj")).expanduser()


@functools.cache
def report_xla_compilation() -> None:
    """Makes this process report long compilations of XLA on stderr."""
    import jax.monitoring

    begun: dict[tuple[int, str], Work] = {}

    def begin(event: str, value: float | int, **about: str | int) -> None:
        if event == XLA_EVENT:
            name = str(about.get("fun_name", ""))
            begun[threading.get_ident(), name] = WAITING.begin(lambda: xla_text(name))

    def end(event: str, duration_secs: float, **about: str | int) -> None:
        key = threading.get_ident(), str(about.get("fun_name", ""))
        if event == XLA_EVENT and key in begun:
            WAITING.end(begun.pop(key))

    jax.monitoring.register_scalar_listener(begin)
    jax.monitoring.register_event_duration_secs_listener(end)


PROGRAMS = {
    "rules_fn": "the rules of states",
    "heat_fn": "the rules of temperatures",
    "idle_fn": "the check whether states change",
    "acts_fn": "the reach of heat sources",
    "statuses_fn": "the status of a goal",
    "run": "a predicate's question",
    "evaluate_fn": "rewards and observations",
    "evaluate_first_fn": "observations after a reset",
    "select_worlds": "the choice of worlds to reset",
    "draw_fn": "the draw of start states",
    "rows_fn": "the reset of worlds",
    "acted": "the robots' controllers",
    "updated": "the grasps of hands",
    "read": "the grasps of hands",
    "poses_fn": "the poses of cameras",
    "finish_fn": "the sensors' readings of images",
    "read_fn": "the sensors",
    "look_fn": "the looks of states for cameras",
    "start_all": "the start of physics in all worlds",
    "start_fn": "the start of all worlds",
    "load_fn": "the start of all worlds from saved states",
    "step_fn": "a step of all worlds",
    "step_autoreset_fn": "a step of all worlds, with the next episodes",
    "advance_fn": "a step of all worlds",
    "reset_fn": "the reset of worlds",
    "several_fn": "several steps of all worlds under a policy",
    "rollout_fn": "a rollout of all worlds",
    "expert_fn": "an expert",
    "choose": "a policy",
    "init": "a new learner",
    "whole": "an iteration of training",
    "collect": "a rollout of training",
    "learn": "the updates of a training iteration",
    "learn_fn": "an update of training",
    "one_round": "a measurement of buffers",
}
"""Descriptions of programs, by the names of the functions that JAX compiles, without leading underscores."""


def xla_text(program: str) -> str:
    """The message for a program of XLA, e.g. "jit(whole)"."""
    name = program.removeprefix("jit(").removesuffix(")").lstrip("_")
    what = PROGRAMS.get(name) or (f"a program ({name})" if name.isidentifier() else "a program")
    return f"compiling {what}, once per machine, scene and number of worlds"


def report_warp_compilation() -> None:
    """Makes this process report Warp's compilations on stderr, in place of Warp's own lines on stdout.

    Once per process; without effect if this version of Warp has no such internal function.
    """
    import warp as wp

    module = getattr(getattr(getattr(wp, "_src", None), "context", None), "Module", None)
    compile_module: Callable[..., bool] | None = getattr(module, "_compile", None)
    if module is None or compile_module is None or getattr(module, _REPORTING, False):
        return
    numbers = itertools.count(1)

    def compile_and_report(self: Any, device: Any = None, output_dir: Any = None, output_name: Any = None, *args, **kw):
        if output_dir is None or output_name is None or pathlib.Path(output_dir, output_name).exists():
            return compile_module(self, device, output_dir, output_name, *args, **kw)
        text = kernels_text(next(numbers))
        with WAITING.during(lambda: text, in_row=True):
            return compile_module(self, device, output_dir, output_name, *args, **kw)

    module._compile = compile_and_report
    setattr(module, _REPORTING, True)


def kernels_text(number: int) -> str:
    """The message for the module of this number, from 1."""
    return f"compiling physics kernels {number}/{max(MODULES, number)}, once per machine"
