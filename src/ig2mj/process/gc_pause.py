"""Pauses of Python's cyclic garbage collector.

The collector scans all live objects repeatedly while new ones are allocated. JAX allocates hundreds of thousands when
it traces a program, and a third of the tracing time is the collector's (0.6 s with it, 0.4 s without, for the first
answer of `next_to`). For the same reason the imports of MJX and Warp are paused: a Warp engine starts in 5.0 s of
processor time instead of 6.8. The garbage of a pause, some megabytes, is collected afterwards. The collector must not
run at all while Warp captures a CUDA graph (`ig2mj.process.warp_repairs`).
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import functools
import gc
import threading
from collections.abc import Callable, Iterable
from typing import Any

from ig2mj.process.large_constants import WithLargeConstants
from ig2mj.process.worker_threads import spawn


class GcPause(contextlib.ContextDecorator):
    """Keeps the cyclic garbage collector off while at least one block is entered, in any thread. Also a decorator."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._entered = 0
        self._was_on = False

    def __enter__(self) -> None:
        self.begin()

    def __exit__(self, *_: object) -> None:
        self.end()

    def begin(self) -> None:
        """Enters a block and turns the collector off."""
        with self._lock:
            if self._entered == 0:
                self._was_on = gc.isenabled()
                gc.disable()
            self._entered += 1

    def end(self) -> None:
        """Leaves a block. After the last one the collector is on again if it was on before."""
        with self._lock:
            self._entered -= 1
            if self._entered == 0 and self._was_on:
                gc.enable()


GC_PAUSED = GcPause()
"""The pause of this process, which has one collector."""


SELDOM = (50_000, 20, 20)
"""Thresholds of the collector in commands: new objects until it looks at the youngest, and how often at older ones.
Imports, tracing and decoration make millions of objects that stay; with Python's 700, 10 and 10 a training's start
takes 2.2 s more of a processor's 13."""


def collect_seldom() -> None:
    """Lets the collector run less often in this process, unless somebody chose its thresholds."""
    if gc.get_threshold() == (700, 10, 10):
        gc.set_threshold(*SELDOM)


class Compiled:
    """`jax.jit` of a function, traced and lowered while the collector is paused, large constants passed as arguments
    (`ig2mj.process.large_constants`). Offers what `jax.jit` offers.

    Arrays of donated arguments that the function does not read are kept as arguments. JAX leaves them out, and what a
    call returns in their place lies elsewhere after every call. XLA puts other arrays there before, and Warp captures
    a CUDA graph again for each place (`ig2mj.engine.warp.patches.graphs`).

    For programs of a millisecond or more: each call costs half a microsecond extra.
    """

    def __init__(self, function: Callable[..., Any], check: Callable[[Any], None] | None = None, **options: Any):
        """
        Args:
          check: called with the first argument before every call.
          options: of `jax.jit`. With others than `donate_argnums` constants stay in the program.
        """
        import jax

        whole = options.keys() - {"donate_argnums"}
        if "donate_argnums" in options:
            options["keep_unused"] = True
        self._compiled: Any = jax.jit(function, **options) if whole else WithLargeConstants(function, **options)
        self._check = check

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        if self._check is not None:
            self._check(args[0])
        with GC_PAUSED:
            return self._compiled(*args, **kwargs)

    def traced(self, *args: Any) -> Traced:
        """Traces the function for these shapes (arrays or `jax.ShapeDtypeStruct`), for `compile_together`."""
        with GC_PAUSED:
            return Traced(self._compiled.trace(*args))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._compiled, name)


class Traced:
    """A traced program, neither lowered nor compiled.

    Attributes:
      returned: shapes of the values that a call returns.
    """

    def __init__(self, traced: Any):
        """`traced`: `jax.stages.Traced`."""
        self.returned = traced.out_info
        self._traced = traced

    def compiling(self) -> concurrent.futures.Future[Any]:
        """Lowers the program here and compiles it in a thread; done when a call finds it compiled."""
        with GC_PAUSED:
            lowered = self._traced.lower()
        done: concurrent.futures.Future[Any] = concurrent.futures.Future()

        def compile_it() -> None:
            try:
                done.set_result(lowered.compile())
            except BaseException as failure:
                done.set_exception(failure)

        spawn(compile_it, "ig2mj-program")
        return done


def compile_together(programs: Iterable[Traced]) -> None:
    """Compiles programs, or reads them from the cache, without running them.

    Lowering holds Python's lock and is sequential; compilation runs in parallel to it, and so does tracing where
    `programs` traces each program when it is asked for it. List the longest program first.
    """
    for compiling in [program.compiling() for program in programs]:
        compiling.result()


class PendingCall:
    """A call of a program that is compiled in a thread while others are traced.

    Attributes:
      returned: shapes of the values that it returns.
    """

    def __init__(self, program: Compiled, *args: Any):
        traced = program.traced(*args)
        self.returned = traced.returned
        self._compiling = traced.compiling()
        self._call = functools.partial(program, *args)

    def result(self) -> Any:
        """Waits until the program is compiled, and runs it."""
        self._compiling.result()
        return self._call()
