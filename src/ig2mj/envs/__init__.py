"""Environments: tasks in batches of worlds, and their faces for other libraries."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ig2mj.envs.environment import Environment, EnvState
    from ig2mj.envs.registry import list_envs, make

__all__ = ["EnvState", "Environment", "list_envs", "make"]

_HOME = {"EnvState": "environment", "Environment": "environment", "list_envs": "registry", "make": "registry"}


def __getattr__(name: str) -> Any:
    """Imports the public names when they are first used: names of environments are known without MuJoCo and JAX."""
    if name not in _HOME:
        raise AttributeError(f"module 'ig2mj.envs' has no attribute '{name}'")
    return getattr(importlib.import_module(f"ig2mj.envs.{_HOME[name]}"), name)
