"""Public names of packages that are imported when they are first used, so that importing the package loads nothing."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import sys
from collections.abc import Mapping
from typing import Any

from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.process.variables import error_of_variable

EMPTY: Mapping[str, str] = {}


def public_name(package: str, name: str, homes: Mapping[str, str] = EMPTY) -> Any:
    """What a package's `__getattr__` gives: a name of one of its modules, or one of its modules.

    Args:
      homes: module of each name.

    Raises:
      AttributeError: no such name. EngineError: an environment variable has a value that MuJoCo or JAX refuses.
    """
    if name not in homes and (name.startswith("_") or importlib.util.find_spec(f"{package}.{name}") is None):
        raise AttributeError(f"module '{package}' has no attribute '{name}'")
    try:
        with GC_PAUSED:
            if name in homes:
                return getattr(importlib.import_module(homes[name]), name)
            return importlib.import_module(f"{package}.{name}")
    except (RuntimeError, ValueError) as e:
        if (known := error_of_variable(e)) is not None:
            raise known from None
        raise


def offer_modules(package: str) -> None:
    """Makes modules of a package, called in its `__init__`, attributes of it that are imported when they are used."""
    sys.modules[package].__getattr__ = functools.partial(public_name, package)  # pyright: ignore
