"""Engines by name. An engine's module is imported when it is first asked for, so that the native one needs no MJX."""

from __future__ import annotations

import importlib
from typing import Any

from ig2mj.engine.base import Engine
from ig2mj.errors import UnknownNameError
from ig2mj.process.collector import REST
from ig2mj.process.imports import find_devices, import_mjx
from ig2mj.scene.scene import Scene

ENGINES = {
    "native": "ig2mj.engine.native.engine:NativeEngine",
    "warp": "ig2mj.engine.warp.engine:WarpEngine",
    "jax": "ig2mj.engine.mjx.jax_engine:JaxEngine",
}
"""Name: module and class."""


@REST
def make_engine(name: str, scene: Scene, num_worlds: int = 1, **options: Any) -> Engine:
    """Makes an engine for a scene.

    Args:
      name: a key of ENGINES.
      options: keyword arguments of the engine's class, e.g. `boxes="igibson"`.

    Raises:
      UnknownNameError: no such engine. EngineError: the engine cannot run this scene.
    """
    if name not in ENGINES:
        raise UnknownNameError("engine", name, ENGINES)
    if name != "native":
        find_devices()
        import_mjx()
    module, kind = ENGINES[name].split(":")
    return getattr(importlib.import_module(module), kind)(scene, num_worlds, **options)
