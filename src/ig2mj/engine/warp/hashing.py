"""Hashes of Warp's modules, in which a function that many kernels call is hashed once.

The name of a module in Warp's cache has a hash of its kernels and of all functions that they call. Warp hashes each of
these again for every module: on an H200's host two thirds of a second at a warm start, of which most is the same.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import warp as wp

VERSION = "1.18."
"""Of Warp: its inner workings are others before and after."""

_here = threading.local()
_lock = threading.Lock()
_entered = 0


@contextlib.contextmanager
def shared_hashes() -> Iterator[None]:
    """Modules that this thread hashes inside the block share hashes of functions, until one is changed or built.

    Hashes are the same as outside. Other threads hash as ever. Without effect where Warp is another version.
    """
    if not wp.config.version.startswith(VERSION) or getattr(_here, "known", None) is not None:
        yield
        return
    _here.known = {}
    try:
        with _replaced():
            yield
    finally:
        _here.known = None


@contextlib.contextmanager
def _replaced() -> Iterator[None]:
    """While a block is entered in any thread, Warp's classes are those that share."""
    global _entered
    from warp._src import context  # not before: other versions may have none

    with _lock:
        if _entered == 0:
            _put(context)
        _entered += 1
    try:
        yield
    finally:
        with _lock:
            _entered -= 1
            if _entered == 0:
                context.ModuleHasher, context.ModuleBuilder = _originals.pop("hasher"), _originals.pop("builder")
                context.Module.register_function = _originals.pop("register")


_originals: dict[str, Any] = {}


def _put(context: Any) -> None:
    hasher, builder, register = context.ModuleHasher, context.ModuleBuilder, context.Module.register_function

    class SharingHasher(hasher):
        """Keeps hashes of functions where the thread has them."""

        @property
        def function_hashes(self) -> dict[Any, bytes]:
            known = getattr(_here, "known", None)
            return self.__dict__["function_hashes"] if known is None else known

        @function_hashes.setter
        def function_hashes(self, empty: dict[Any, bytes]) -> None:
            self.__dict__["function_hashes"] = empty

    class ForgettingBuilder(builder):
        """Building changes functions: expressions that stand for constants get their values."""

        def __init__(self, *args: Any, **kwargs: Any):
            _forget()
            try:
                super().__init__(*args, **kwargs)
            finally:
                _forget()

    def register_function(module: Any, function: Any, scope: dict[str, Any], *args: Any, **kwargs: Any) -> Any:
        if isinstance(scope.get(function.func.__name__), context.Function):
            _forget()  # that one gets another overload
        return register(module, function, scope, *args, **kwargs)

    _originals.update(hasher=hasher, builder=builder, register=register)
    context.ModuleHasher, context.ModuleBuilder = SharingHasher, ForgettingBuilder
    context.Module.register_function = register_function


def _forget() -> None:
    known = getattr(_here, "known", None)
    if known is not None:
        known.clear()
