"""`entry_point`: what holds wherever a user's call enters ig2mj.

**32 bits.** ig2mj computes with 32 bits, whatever JAX's option `jax_enable_x64` is. With that option JAX gives 64 bits
to every array whose type is not stated, draws other random numbers, and takes NumPy's constants as they are. Programs
would differ from those of a process without it, in results and in speed, and some would not compile, as a loop's values
must keep their types. A solver elsewhere in the process may need the option, and arrays that MJX and Flax make have no
stated types. So every entry point is traced and run with the option off, in this thread and until it returns.

**Memory.** Where a device or the machine has too little of it, every entry point raises EngineError with the remedy.

**No fork.** JAX's threads do not exist in a process that was forked from one where JAX runs, and the first program
there waits for them for ever. Every entry point refuses to run there.
"""

from __future__ import annotations

import functools
import inspect
import os
import sys
from collections.abc import Callable
from typing import Any, TypeVar

from ig2mj.errors import EngineError
from ig2mj.process.out_of_memory import is_out_of_memory, out_of_memory_text

T = TypeVar("T")

_SPECIAL = ("__init__", "__call__")

_jax: Any = None

_forked = False
"""This process was forked from one in which JAX had started."""


def entry_point(entry: T) -> T:
    """Decorates an entry point: a function, or a class, of which all public methods and properties are such.

    The function then raises EngineError in a process that was forked from one where JAX runs. A call costs 0.2
    microseconds more.
    """
    if inspect.isclass(entry):
        for name, member in list(vars(entry).items()):
            if not name.startswith("_") or name in _SPECIAL:
                setattr(entry, name, _of_member(name, entry, member))
        return entry
    return _guarded(entry)  # pyright: ignore[reportArgumentType, reportReturnType]


def _of_member(name: str, owner: type, member: Any) -> Any:
    if isinstance(member, classmethod | staticmethod):
        return type(member)(_guarded(member.__func__))
    if isinstance(member, property):
        get, put, drop = (f and _guarded(f) for f in (member.fget, member.fset, member.fdel))
        return property(get, put, drop, member.__doc__)
    if isinstance(member, functools.cached_property):
        found = functools.cached_property(_guarded(member.func))
        found.__set_name__(owner, name)
        return found
    return _guarded(member) if inspect.isfunction(member) else member


def _guarded(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        refuse_fork()
        try:
            if not (_jax or _imported()).config.jax_enable_x64:
                return function(*args, **kwargs)
            with _jax.enable_x64(False):
                return function(*args, **kwargs)
        except (RuntimeError, MemoryError) as error:
            if is_out_of_memory(error):
                raise EngineError(out_of_memory_text(error)) from error
            raise

    return call


def _imported() -> Any:
    """JAX, imported at the first call of an entry point."""
    global _jax
    import jax

    _jax = jax
    return jax


def refuse_fork() -> None:
    """Raises EngineError in a process that was forked from one where JAX runs."""
    if _forked:
        raise EngineError(
            "this process was forked from one in which JAX runs, whose threads do not exist here: start it with "
            "multiprocessing's 'spawn' (of Gymnasium: make_vec(..., vectorization_mode='async', "
            "vector_kwargs={'context': 'spawn'}))"
        )


def _note_fork() -> None:
    global _forked
    bridge = sys.modules.get("jax._src.xla_bridge")
    started = getattr(bridge, "backends_are_initialized", None)
    _forked = _forked or bool(started and started())


os.register_at_fork(after_in_child=_note_fork)
