"""ig2mj: iGibson 2.0 on MuJoCo and JAX."""

from __future__ import annotations

import importlib
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ig2mj.envs.registry import list_envs, make
    from ig2mj.scene.scene import Scene, load_scene
    from ig2mj.simulation import Simulation
    from ig2mj.worlds import Worlds

__all__ = ["Scene", "Simulation", "Worlds", "list_envs", "load_scene", "make"]

_HOME = {
    "Scene": "ig2mj.scene.scene",
    "list_envs": "ig2mj.envs.registry",
    "load_scene": "ig2mj.scene.scene",
    "make": "ig2mj.envs.registry",
    "Simulation": "ig2mj.simulation",
    "Worlds": "ig2mj.worlds",
}


def __getattr__(name: str) -> Any:
    """Imports the public names when they are first used, so that `import ig2mj` loads neither MuJoCo nor JAX."""
    if name not in _HOME:
        raise AttributeError(f"module 'ig2mj' has no attribute '{name}'")
    from ig2mj.process.collector import REST

    with REST:
        return getattr(importlib.import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})


if "gymnasium" in sys.modules:
    from ig2mj.envs import names

    names.register(sys.modules["gymnasium"])
