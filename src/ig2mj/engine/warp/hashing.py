"""Hashes of Warp's modules, in which a function that many kernels call is hashed once.

The name of a module in Warp's cache has a hash of its kernels and of all functions that they call. Warp hashes each of
these again for every module: on an H200's host two thirds of a second at a warm start, of which most is the same.
"""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator
from typing import Any

import warp as wp

from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.process.imports import WARP_VERSION

_SHARED = ScopedReplacement()
_here = threading.local()
"""With `known`: the hashes that this thread's modules share."""


@contextlib.contextmanager
def shared_hashes() -> Iterator[None]:
    """Modules that this thread hashes inside the block share hashes of functions, until one is changed or built.

    Hashes are the same as outside. Other threads hash as ever. Without effect where Warp is another version.
    """
    if not wp.config.version.startswith(WARP_VERSION) or _SHARED.active:
        yield
        return
    _add_own()
    _here.known = {}
    try:
        with _SHARED.entered():
            yield
    finally:
        del _here.known


@functools.cache
def _add_own() -> None:
    from warp._src import context  # not before: other versions may have none

    hash_place = context.ModuleHasher, "hash_function"
    build_place = context.ModuleBuilder, "__init__"
    register_place = context.Module, "register_function"

    def hash_function(hasher: Any, function: Any) -> bytes:
        found = _here.known.get(function)
        if found is None:
            found = _here.known[function] = _SHARED.original(*hash_place)(hasher, function)
        return found

    def build(*args: Any, **kwargs: Any) -> None:
        """Building changes functions: expressions that stand for constants get their values."""
        _here.known.clear()
        try:
            _SHARED.original(*build_place)(*args, **kwargs)
        finally:
            _here.known.clear()

    def register_function(module: Any, function: Any, scope: dict[str, Any], *args: Any, **kwargs: Any) -> Any:
        if isinstance(scope.get(function.func.__name__), context.Function):
            _here.known.clear()  # that one gets another overload
        return _SHARED.original(*register_place)(module, function, scope, *args, **kwargs)

    _SHARED.add({hash_place: hash_function, build_place: build, register_place: register_function})
