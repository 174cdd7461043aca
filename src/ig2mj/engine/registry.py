"""Engines by name. An engine's module is imported when it is first asked for, so that the native one needs no MJX."""

from __future__ import annotations

import contextlib
import importlib
import inspect
import typing
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ig2mj.engine.base import Engine
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.process import entry_point, run_programs_inline
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.process.imports import find_devices, import_mjx
from ig2mj.process.together import TOGETHER
from ig2mj.scene.scene import Scene

ENGINES = {
    "native": "ig2mj.engine.native.engine:NativeEngine",
    "warp": "ig2mj.engine.warp.engine:WarpEngine",
    "jax": "ig2mj.engine.mjx.jax_engine:JaxEngine",
}
"""Name: module and class."""


@typing.overload
def choose_engine(engine: str | None) -> str: ...


@typing.overload
def choose_engine(engine: str | Engine | None) -> str | Engine: ...


def choose_engine(engine: str | Engine | None) -> str | Engine:
    """The engine that is asked for; None: "warp" where JAX has a GPU, else "native".

    To be called before JAX is first used: options of the process that suit the engine are set where it can be native.

    Raises:
      EngineError: it is neither a name nor an engine.
    """
    if engine in (None, "native"):
        run_programs_inline()
    if not isinstance(engine, str | Engine | None):
        raise EngineError(f"engine = {engine!r}: the name of an engine ({', '.join(ENGINES)}), or one that is made")
    if engine is None:
        import jax

        return "warp" if jax.default_backend() == "gpu" else "native"
    return engine


def made_together() -> contextlib.AbstractContextManager[None]:
    """A block in which engines and what sees their worlds are made before any of their kernels is loaded: kernels of
    all of them are loaded together, from its end on. Worlds that start inside it do not wait for the end."""
    return TOGETHER.block()


@entry_point
@GC_PAUSED
def make_engine(name: str, scene: Scene, num_worlds: int = 1, **options: Any) -> Engine:
    """Makes an engine for a scene.

    Args:
      name: a key of ENGINES.
      options: keyword arguments of the engine's class, e.g. `boxes="igibson"`.

    Raises:
      UnknownNameError: no such engine or option. EngineError: the engine cannot run this scene.
    """
    check_options(f"the {name} engine", options, name)
    if name != "native":
        find_devices()
    return _kind_of(name)(scene, num_worlds, **options)


def check_options(
    what: str, options: Mapping[str, Any], engine: str | Engine, own: Callable[..., Any] | None = None
) -> None:
    """Checks names of options before anything is made.

    Args:
      what: takes the options, for the message. engine: they go to; an engine that is made already takes none.
      own: what else takes arguments by name: a function or class, whose names are among the near matches.

    Raises:
      UnknownNameError: no such engine, or an option that neither has, with near matches.
    """
    if isinstance(engine, str) and engine not in ENGINES:
        raise UnknownNameError("engine", engine, ENGINES)
    if not options:
        return
    taken = set(_arguments(_kind_of(engine))) - {"scene", "num_worlds"} if isinstance(engine, str) else set[str]()
    for name in options:
        if name not in taken:
            raise UnknownNameError(f"option of {what}", name, [*(_arguments(own) if own else ()), *sorted(taken)])


def _kind_of(name: str) -> type:
    """The engine's class."""
    if name != "native":
        import_mjx()
    module, kind = ENGINES[name].split(":")
    return getattr(importlib.import_module(module), kind)


def _arguments(taker: Callable[..., Any]) -> Iterable[str]:
    """Names of the arguments of a function, or of a class and those above it to which it hands others on."""
    for function in [t.__init__ for t in taker.__mro__[:-1]] if inspect.isclass(taker) else [taker]:
        found = inspect.signature(function).parameters.values()
        yield from (p.name for p in found if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY) and p.name != "self")
        if not any(p.kind is p.VAR_KEYWORD for p in found):
            return
