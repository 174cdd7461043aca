"""When Python's cyclic garbage collector rests.

It looks through all that lives again and again while new objects are made, which JAX does by the hundred thousand where
it traces a program: a third of the time that tracing takes (0.6 s instead of 0.4 for `next_to`, whose first answer
somebody waits for). The imports of MJX and Warp make so many that a Warp engine's start takes 5.0 s of processor time
instead of 6.8. What becomes garbage meanwhile, some megabytes, is collected afterwards. While Warp captures a CUDA
graph it must not run at all (`ig2mj.process.warp_repairs`).
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import gc
import threading
from collections.abc import Callable, Sequence
from typing import Any

from ig2mj.process.crew import spawn


class CollectorRest(contextlib.ContextDecorator):
    """Keeps Python's cyclic garbage collector off while at least one block is entered, in any thread; `@REST` makes a
    function such a block."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._entered = 0
        self._was_on = False

    def __enter__(self) -> None:
        self.begin()

    def __exit__(self, *_: object) -> None:
        self.end()

    def begin(self) -> None:
        """Enters a block: the collector goes off."""
        with self._lock:
            if self._entered == 0:
                self._was_on = gc.isenabled()
                gc.disable()
            self._entered += 1

    def end(self) -> None:
        """Leaves a block; after the last one the collector is on again, if it was."""
        with self._lock:
            self._entered -= 1
            if self._entered == 0 and self._was_on:
                gc.enable()


REST = CollectorRest()
"""The one of this process: there is only one collector."""


class Compiled:
    """`jax.jit` of a function, traced and lowered while the collector rests. Has what `jax.jit`'s functions have.

    For programs that take a millisecond or more: a call takes half a microsecond longer.
    """

    def __init__(self, function: Callable[..., Any], check: Callable[[Any], None] | None = None, **options: Any):
        """
        Args:
          check: called with the first argument before every call.
          options: of `jax.jit`.
        """
        import jax

        self._compiled: Any = jax.jit(function, **options)
        self._check = check

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        if self._check is not None:
            self._check(args[0])
        with REST:
            return self._compiled(*args, **kwargs)

    def traced(self, *args: Any) -> Traced:
        """Traces it for arguments of such shapes (arrays or `jax.ShapeDtypeStruct`), for `compile_together`."""
        with REST:
            return Traced(self._compiled.trace(*args))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._compiled, name)


class Traced:
    """A program that has been traced and is neither lowered nor compiled yet.

    Attributes:
      returned: shapes of what a call will return.
    """

    def __init__(self, traced: Any):
        """`traced`: `jax.stages.Traced`."""
        self.returned = traced.out_info
        self._traced = traced

    def compiling(self) -> concurrent.futures.Future[Any]:
        """Lowers it, and compiles it in a thread: ends when a call finds the program."""
        with REST:
            lowered = self._traced.lower()
        done: concurrent.futures.Future[Any] = concurrent.futures.Future()

        def compile_it() -> None:
            try:
                done.set_result(lowered.compile())
            except BaseException as failure:
                done.set_exception(failure)

        spawn(compile_it, "ig2mj-program")
        return done


def compile_together(programs: Sequence[Traced]) -> None:
    """Compiles programs, or reads them where they are cached, and runs nothing: calls find them.

    Python is needed for lowering, one program after the other, and not for the rest, which goes on meanwhile. So the
    longest should come first.
    """
    for compiling in [program.compiling() for program in programs]:
        compiling.result()
